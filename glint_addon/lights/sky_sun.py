"""The sun of a Sky Texture: where it is, how wide and about how strong."""

from __future__ import annotations

from math import asin, degrees, exp, sin

from ..nodes.driven import Driven
from ..nodes.glint_lights import KIND_SUN
from .node_numbers import Number, node_number, read
from .trigonometry import Angles, Sum, multiplied

SKIES_WITH_SUN = {"SINGLE_SCATTERING", "MULTIPLE_SCATTERING"}
SMALLEST_DIAMETER = 0.0005  # radians; Cycles widens smaller suns to it (SkyTextureNode::get_sun_size)

# Irradiance [W/m^2] of the sun above the air, in red, where it is strongest, and the depth of air and aerosols of
# density 1 above sea level: measured from renders of both skies. Both suns keep within a third of it above 2 degrees.
SUN_IRRADIANCE = 170.0
AIR_DEPTH = 0.05
AEROSOL_DEPTH = 0.03


def sun_vector(elevation: Number, rotation: Number, angles: Angles) -> list[Sum]:
    """Unit vector towards the sun (SkyTextureNode::simplify_settings and sky.h): from +Y, clockwise seen from above."""
    up_cos, up_sin = angles.cos_sin(elevation)
    round_cos, round_sin = angles.cos_sin(rotation)
    return [multiplied(up_cos, round_sin), multiplied(up_cos, round_cos), up_sin]


def sun_half_angle(size: Number) -> Driven | float:
    """Half of the sun's diameter [rad]."""
    if not size.moves:
        return max(size.value, SMALLEST_DIAMETER) / 2
    return Driven(f"max(size, {SMALLEST_DIAMETER}) / 2", (read("size", size),))


def sun_kind(elevation: Number, size: Number) -> Driven | int:
    """KIND_SUN, or none while the whole sun is below the horizon, where it moves."""
    if not (elevation.moves or size.moves):
        return KIND_SUN
    return Driven(f"{KIND_SUN} if sin(up) + size / 2 > 0 else 0", (read("up", elevation), read("size", size)))


def sun_irradiance(world, node) -> float:
    """About how much the sun shines [W/m^2], 0 where it is below the horizon; from above, where it moves."""
    elevation = node_number(world, node, "sun_elevation")
    height = 1.0 if elevation.moves else sin(elevation.value)
    if height + node.sun_size / 2 <= 0:
        return 0.0
    depth = AIR_DEPTH * node.air_density + AEROSOL_DEPTH * node.aerosol_density
    return node_number(world, node, "sun_intensity").peak * SUN_IRRADIANCE * exp(-depth * air_mass(max(height, 0.0)))


def air_mass(height: float) -> float:
    """Air on the way of a ray that rises by `height`, the sine of its elevation, in that of an upright one.

    Kasten and Young, "Revised optical air mass tables and approximation formula", Applied Optics 28, 1989.
    """
    return 1 / (height + 0.50572 * (degrees(asin(min(height, 1.0))) + 6.07995) ** -1.6364)
