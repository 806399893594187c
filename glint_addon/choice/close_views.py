"""Whether cameras see a map of texels so near that its glints have nothing to gain from looking for lights."""

from __future__ import annotations

from math import inf, pi

import numpy as np

from ..animation.places import places
from ..nodes.glint_bsdf import group_binding
from ..nodes.map_tables import MapTables
from ..seen.coordinates import largest_texel_area, uv_transforms
from ..seen.footprints import FOOTPRINT_EXPONENT, FOOTPRINT_SCALE, rigid_mesh
from ..seen.surface import pixels_filled
from .patches import patches_over

# Samples a pixel that footprints are judged by: with more they are smaller still, with fewer hardly anybody renders.
SAMPLES = 4
# Texels in a footprint, the mean over a picture: with fewer Blender's nodes reach the lobe's error in less time,
# because Open Shading Language makes each sample slower: decision 42.
FEWEST_TEXELS = 1.0
CLOSE_UP = "its glints are so close, about a texel a sample, that Blender's own nodes are as fast"


def is_close_up(scene, views, family) -> bool:
    """Whether footprints on all that shows a family's maps hold FEWEST_TEXELS or less, at any frame and to any camera.

    views: what `scene_views` found; family: `material_lights.Family`. False where it cannot be told, and for Linear
    maps, whose slopes differ within a texel. Matrices must be current.
    """
    if views is None or views.has_mirrors or not family.nodes:
        return False
    groups = {node.node_tree for node in family.nodes}
    if any(group_binding(group).interpolation != "CLOSEST" or MapTables.of(group).size is None for group in groups):
        return False
    seen = [_texels_a_footprint(scene, views, thing, family.materials, groups) for thing in family.objects]
    return 0.0 < max(seen, default=0.0) <= FEWEST_TEXELS


def _texels_a_footprint(scene, views, thing, materials, groups) -> float:
    """Mean over the pixels that show an object, the largest of all frames and cameras; 0: not seen, inf: who knows."""
    mesh, surface = rigid_mesh(scene, thing), patches_over(scene, thing, views)
    placed = [(group, uv_transforms(material, group)) for material in materials for group in groups]
    if mesh is None or surface is None or any(transforms is None for _, transforms in placed):
        return inf
    matrix = places(thing, views.frames)[0, :3, :3]
    densities = [
        largest_texel_area(mesh, matrix, uv_map, np.diag(np.asarray(MapTables.of(group).size, float)) @ transform)
        for group, transforms in placed for uv_map, transform in transforms
    ]
    if None in densities:
        return inf
    pixels_a_footprint = pi * (FOOTPRINT_SCALE * SAMPLES**-FOOTPRINT_EXPONENT) ** 2
    largest = 0.0
    for camera in views.cameras:
        for view, (patches, _) in zip(camera, surface, strict=True):
            pixels, is_in_picture = pixels_filled(view, patches)
            texels = max(densities) * patches.areas[is_in_picture].sum()
            if texels > 0.0:
                largest = max(largest, texels / max(pixels[is_in_picture].sum(), 1e-30) * pixels_a_footprint)
    return largest
