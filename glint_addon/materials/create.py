"""Make a material with glints: of a map and settings, or of a preset."""

from __future__ import annotations

import bpy

from ..errors import MapError
from ..nodes.glint_bsdf import ROUGHNESS, STRENGTH
from ..nodes.map_choices import CONVENTION, DISTRIBUTION, EXTENSION, INTERPOLATION, SURFACE, VARIATION
from .build import built_material
from .preset_material import preset_material
from .presets import preset_named


def create_glint_material(
    name,
    normal_map=None,
    *,
    roughness=ROUGHNESS.default,
    distribution=DISTRIBUTION.default,
    interpolation=INTERPOLATION.default,
    convention=CONVENTION.default,
    color=None,
    strength=STRENGTH.default,
    uv_map="",
    extension=EXTENSION.default,
    variation=VARIATION.default,
    scale=None,
    surface=SURFACE.default,
    edge_tint=None,
    ior=None,
    extinction=None,
    metal="",
    presence=None,
    flake_color=None,
    base_color=(0.8, 0.8, 0.8),
    preset="",
) -> bpy.types.Material:
    """A new material whose glints come from `normal_map`, a path ("<UDIM>" for all tiles) or a bpy.types.Image, or a
    ready one of a `preset`, by a name of `presets()`, whose map is generated.

    roughness 0..1 of a single facet (alpha is its square); distribution 'BECKMANN' or 'GGX'; interpolation 'LINEAR' or
    'CLOSEST'; convention 'OPENGL' (+Y) or 'DIRECTX' (-Y); strength scales the slopes; uv_map "" is the one active for
    rendering; extension 'REPEAT', 'EXTEND', 'CLIP' or 'MIRROR', as of an Image Texture node: where a footprint meets
    the map's edge, and beyond, all but the first have the noise of Blender's nodes; variation 'REPEAT' or 'SHUFFLE', by
    which each repeat is another cut of the map, for 'CLOSEST'; scale: metres of one repeat, None: as the UV map says.
    surface: what facets are made of, as the BSDF node that follows Image Texture -> Normal Map: 'TINT' is Glossy BSDF
    of `color`; 'METAL' Metallic BSDF of base colour `color` and `edge_tint`; 'CONDUCTOR' Metallic BSDF of `ior` and
    `extinction`, three numbers each; 'DIELECTRIC' the reflection of Principled BSDF of `ior` and specular tint `color`,
    always GGX. Colours are linear RGB; None is the node's default, and white for 'TINT'. metal: a name in METALS
    (nodes/surface_kinds.py), as "Gold", for the numbers of METAL or CONDUCTOR.
    presence: path or image that says which texels are flakes (brighter than 0.5); between flakes lies a Principled BSDF
    of `base_color`, or whatever is linked to Base afterwards. flake_color: path or image with a colour for each texel,
    which multiplies the surface's. Both are of the size of the map, and need interpolation 'CLOSEST'.
    With a preset all arguments that are not given are the preset's; given values of the surface take their place.
    Call `prepare_scene` before rendering. Raises MapError or ShaderError, and then leaves nothing behind.
    """
    settings = {name: value for name, value in locals().items() if name not in ("name", "normal_map", "preset")}
    if preset:
        defaults = create_glint_material.__kwdefaults__
        given = {name: value for name, value in settings.items() if value != defaults[name]}
        return preset_material(name, preset_named(preset), normal_map, defaults | given, given)
    if normal_map is None:
        raise MapError(f"Glint material {name} has neither a normal map nor a preset: give one of them.")
    return built_material(name, normal_map, **settings)
