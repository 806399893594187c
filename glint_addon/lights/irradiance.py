"""How strongly a light may shine on the glints: an estimate to rank lights by, without shadows, cosines or textures.

Formulas are those of Cycles' own light units (scene/light.cpp): energy is W/m^2 for suns and W for all other lights.
"""

from __future__ import annotations

from math import atan, pi, sin, tan

import numpy as np

from . import size
from .emission import lamp_factor

NEAREST = 1e-3  # metres; a point light inside the bounds still gets a finite number


def irradiance(lamp, low: np.ndarray, high: np.ndarray, energy: float) -> float:
    """Largest irradiance [W/m^2] of light object `lamp` on boxes `low`..`high` ((n, 3), world space, metres)."""
    return float(irradiances(lamp, low, high, energy).max(initial=0.0))


def irradiances(lamp, low: np.ndarray, high: np.ndarray, energy: float) -> np.ndarray:
    """Irradiance [W/m^2] of light object `lamp` on each of the boxes, (n,)."""
    colours = zip(tint(lamp.data), lamp_factor(lamp.data), strict=True)
    flux = energy * max(first * second for first, second in colours) * _flux_factor(lamp)
    if lamp.data.type == "SUN":
        return np.full(len(low), flux)
    position = np.array(lamp.matrix_world.translation)
    axis = np.array(lamp.matrix_world.col[2][:3])
    axis /= max(np.linalg.norm(axis), np.finfo(float).tiny)

    # Take the distance to the nearest point of each box.
    offset = np.clip(position, low, high) - position
    distance = np.maximum(np.linalg.norm(offset, axis=1), NEAREST)

    if lamp.data.type == "AREA":
        # Exact on the axis of a disk; close by it is what the surface itself sends out.
        half_spread = lamp.data.spread / 2
        values = flux / (_spread_part(half_spread) * pi * distance**2 + size.emitter_area(lamp))
        values = values * _in_front(position, axis, low, high)
        radius = size.light_size(lamp)
        values = values * _in_cone(position, axis, half_spread, low - radius, high + radius)
    else:
        values = flux / (4 * pi * np.maximum(distance, size.light_size(lamp)) ** 2)
    if lamp.data.type == "SPOT":
        # Each point of a soft spot has its own cone: as if the boxes were larger by the light's radius.
        radius = size.light_size(lamp)
        values = values * _in_cone(position, axis, _cone_half_angle(lamp), low - radius, high + radius)
    return values


def tint(light) -> tuple[float, float, float]:
    """What a light's colour, temperature and exposure multiply its energy with, linear RGB."""
    white = light.temperature_color if light.use_temperature else (1.0, 1.0, 1.0)
    return tuple(2.0**light.exposure * colour * warmth for colour, warmth in zip(light.color, white, strict=True))


def _flux_factor(lamp) -> float:
    """Without `normalize` the energy is that of each piece of the emitter, not that of the whole."""
    light = lamp.data
    if light.normalize:
        return 1.0
    if light.type == "SUN":
        return pi * sin(light.angle / 2) ** 2 or 1.0  # a sun without size stays as it is
    return size.emitter_area(lamp) or 1.0


def _spread_part(half_spread) -> float:
    """Solid angle of an area light's beam relative to one that shines all around (`AreaLight::copy_to_kernel`)."""
    return 1.0 - half_spread / tan(half_spread) if half_spread > 0 else 0.0


def _in_front(position, axis, low, high):
    """Whether some of each box is on the side to which an area light shines (its -Z), (n,)."""
    # The corner furthest along -axis decides.
    corner = np.where(axis > 0, low, high)
    return (corner - position) @ axis < 0


def _cone_half_angle(lamp) -> float:
    """Wider half-angle [rad] of a spot's cone, which the object's scale stretches along its X and Y."""
    x, y, z = (lamp.matrix_world.col[axis].length for axis in range(3))
    return atan(tan(lamp.data.spot_size / 2) * max(x, y) / z) if z else pi / 2


def _in_cone(position, axis, half_angle, low, high):
    """Whether the bounding sphere of each box meets the spot's cone around its -Z, (n,)."""
    centre = (low + high) / 2
    radius = np.linalg.norm(high - low, axis=1) / 2
    offset = centre - position
    distance = np.linalg.norm(offset, axis=1)
    inside = distance <= radius
    distance = np.where(inside, 1.0, distance)
    angle = np.arccos(np.clip(-(offset @ axis) / distance, -1, 1))
    return inside | (angle - np.arcsin(np.minimum(radius / distance, 1)) <= half_angle)
