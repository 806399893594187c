"""The sun of a Sky Texture: its place, its width, and an estimate of its strength.

Blender's drivers cannot follow the properties of a node, only its sockets: a sun that moves is written as keys.
"""

from __future__ import annotations

from math import asin, cos, degrees, exp, sin

import bpy

from ...animation.curves import is_animated, peak_value, values_over
from ...nodes.driven import Keyed
from ...nodes.glint_lights import KIND_NONE, KIND_SUN

PLACE = ("sun_elevation", "sun_rotation", "sun_size")  # properties of the node, all in radians
SKIES_WITH_SUN = {"SINGLE_SCATTERING", "MULTIPLE_SCATTERING"}
SMALLEST_DIAMETER = 0.0005  # radians; Cycles widens smaller suns to it (SkyTextureNode::get_sun_size)

# Irradiance [W/m^2] of the sun above the air, in red, where it is strongest, and the optical depths of air and aerosols
# of density 1 above sea level, fitted to renders of both skies: decision 47.
SUN_IRRADIANCE = 170.0
AIR_DEPTH = 0.05
AEROSOL_DEPTH = 0.03


def sun_numbers(elevation: float, rotation: float, size: float) -> tuple[float, float, float, int, float]:
    """Unit vector towards the sun, its kind, none below the horizon, and its half-angle [rad]; all angles in radians.

    From +Y, clockwise seen from above (SkyTextureNode::simplify_settings and node_sky_texture.osl in Cycles).
    """
    kind = KIND_SUN if sin(elevation) + size / 2 > 0 else KIND_NONE
    flat = cos(elevation)
    return flat * sin(rotation), flat * cos(rotation), sin(elevation), kind, max(size, SMALLEST_DIAMETER) / 2


def sun_now(node: bpy.types.ShaderNode) -> tuple[float, float, float, int, float]:
    """`sun_numbers` of a Sky Texture at the present frame."""
    return sun_numbers(*(getattr(node, name) for name in PLACE))


def sun_over_time(scene: bpy.types.Scene, node: bpy.types.ShaderNode) -> tuple[Keyed | float, ...] | None:
    """`sun_numbers` of a Sky Texture with keys at the frames of `scene`; None if the sun stands still."""
    tree, paths = node.id_data, [node.path_from_id(name) for name in PLACE]
    if not any(is_animated(tree, path) for path in paths):
        return None
    frames, values = values_over(scene, tree, paths)
    columns = zip(*(sun_numbers(*entry) for entry in values), strict=True)
    return tuple(Keyed(tuple(frames), column) if len(set(column)) > 1 else column[0] for column in columns)


def sun_irradiance(node: bpy.types.ShaderNode) -> float:
    """Estimated irradiance [W/m^2] of the sun at its place now, or from above if its height is animated."""
    tree = node.id_data
    height = 1.0 if is_animated(tree, node.path_from_id(PLACE[0])) else max(sin(node.sun_elevation), 0.0)
    depth = AIR_DEPTH * node.air_density + AEROSOL_DEPTH * node.aerosol_density
    return peak_value(tree, node.path_from_id("sun_intensity")) * SUN_IRRADIANCE * exp(-depth * air_mass(height))


def air_mass(height: float) -> float:
    """Mass of air along a ray whose elevation has the sine `height`, relative to the mass along an upright ray.

    Kasten and Young, "Revised optical air mass tables and approximation formula", Applied Optics 28, 1989.
    """
    return 1 / (height + 0.50572 * (degrees(asin(min(height, 1.0))) + 6.07995) ** -1.6364)
