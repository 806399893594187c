"""How strongly a light may shine on the glints: an estimate to rank lights by, without shadows, cosines or textures.

Formulas are those of Cycles' own light units (scene/light.cpp): energy is W/m^2 for suns and W for all other lights.
"""

from __future__ import annotations

import bpy
import numpy as np

from .emission import Rgb, lamp_factor
from .kind import Lamp, Local
from .kinds import kind_of

NEAREST = 1e-3  # metres; a point light inside the bounds still gets a finite number


def irradiance(lamp: Lamp, low: np.ndarray, high: np.ndarray, energy: float) -> float:
    """Largest irradiance [W/m^2] of light object `lamp` on boxes `low`..`high` ((n, 3), world space, metres)."""
    return float(irradiances(lamp, low, high, energy).max(initial=0.0))


def irradiances(lamp: Lamp, low: np.ndarray, high: np.ndarray, energy: float) -> np.ndarray:
    """Irradiance [W/m^2] of light object `lamp` on each of the boxes, (n,)."""
    colours = zip(tint(lamp.data), lamp_factor(lamp.data), strict=True)
    kind = kind_of(lamp)
    flux = energy * max(first * second for first, second in colours) * _flux_factor(lamp)
    if not isinstance(kind, Local):  # a sun is as bright everywhere
        return np.full(len(low), flux)
    position = np.array(lamp.matrix_world.translation)
    axis = np.array(lamp.matrix_world.col[2][:3])
    axis /= max(np.linalg.norm(axis), np.finfo(float).tiny)

    # Take the distance to the nearest point of each box.
    offset = np.clip(position, low, high) - position
    distance = np.maximum(np.linalg.norm(offset, axis=1), NEAREST)

    values = flux / kind.spread_out(lamp, distance)
    if kind.is_one_sided:
        values = values * _in_front(position, axis, low, high)
    half_angle = kind.cone(lamp)
    if half_angle is not None:
        # Each point of a soft light has its own cone: as if the boxes were larger by the light's radius.
        radius = kind.size(lamp)
        values = values * _in_cone(position, axis, half_angle, low - radius, high + radius)
    return values


def tint(light: bpy.types.Light) -> Rgb:
    """What a light's colour, temperature and exposure multiply its energy with, linear RGB."""
    white = light.temperature_color if light.use_temperature else (1.0, 1.0, 1.0)
    red, green, blue = (2.0**light.exposure * colour * warmth
                        for colour, warmth in zip(light.color, white, strict=True))
    return red, green, blue


def _flux_factor(lamp: Lamp) -> float:
    """Without `normalize` the energy is that of each piece of the emitter, not that of the whole.

    A light without size stays as it is.
    """
    return 1.0 if lamp.data.normalize else kind_of(lamp).extent(lamp) or 1.0


def _in_front(position: np.ndarray, axis: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Whether some of each box is on the side to which a light with a front shines (its -Z), (n,)."""
    # The corner furthest along -axis decides.
    corner = np.where(axis > 0, low, high)
    return (corner - position) @ axis < 0


def _in_cone(
    position: np.ndarray, axis: np.ndarray, half_angle: float, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Whether the bounding sphere of each box meets the light's cone around its -Z, (n,)."""
    centre = (low + high) / 2
    radius = np.linalg.norm(high - low, axis=1) / 2
    offset = centre - position
    distance = np.linalg.norm(offset, axis=1)
    inside = distance <= radius
    distance = np.where(inside, 1.0, distance)
    angle = np.arccos(np.clip(-(offset @ axis) / distance, -1, 1))
    return inside | (angle - np.arcsin(np.minimum(radius / distance, 1)) <= half_angle)
