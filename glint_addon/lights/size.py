"""Sizes of light objects as Cycles has them; the same numbers as the drivers' (a test compares them)."""

from __future__ import annotations

from math import hypot, pi


def light_size(lamp) -> float:
    """Half-angle [rad] of a sun; bounding radius [m] of a point, spot or area light object.

    Cycles scales area lights with the object, by the lengths of its world axes; points and spots it does not scale.
    """
    light = lamp.data
    if light.type == "SUN":
        return light.angle / 2
    if light.type != "AREA":
        return light.shadow_soft_size
    width, height = _sides(lamp)
    return max(width, height) / 2 if _is_round(light) else hypot(width, height) / 2


def emitter_area(lamp) -> float:
    """Area [m^2] of the surface of a point, spot or area light object."""
    if lamp.data.type != "AREA":
        return 4 * pi * lamp.data.shadow_soft_size**2
    width, height = _sides(lamp)
    return width * height * (pi / 4 if _is_round(lamp.data) else 1)


def cross_section(lamp) -> float:
    """Area [m^2] that a point, spot or area light object shows from afar: an area light from the front."""
    area = emitter_area(lamp)
    return area if lamp.data.type == "AREA" else area / 4


def _sides(lamp):
    """Width and height of an area light in metres; squares and disks have one length for both."""
    light = lamp.data
    height = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
    return light.size * lamp.matrix_world.col[0].length, height * lamp.matrix_world.col[1].length


def _is_round(light) -> bool:
    return light.shape in {"DISK", "ELLIPSE"}
