"""Whether cameras see a map of texels so near that its glints have nothing to gain from looking for lights."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, pi

import bpy
import numpy as np

from ..animation.places import places
from ..nodes.glint_bsdf import group_binding
from ..nodes.map_tables import MapTables
from ..nodes.places import FOOTPRINT_EXPONENT, FOOTPRINT_SCALE
from ..seen.coordinates import largest_texel_area, uv_transforms
from ..seen.footprints import rigid_mesh
from ..seen.scene_views import SceneViews
from ..seen.surface import pixels_filled
from ..seen.uv_size import metres_rendered
from .families import Family
from .patches import patches_over

# Samples a pixel for which footprints are judged: with more samples they are smaller, and hardly anybody takes fewer.
SAMPLES = 4
# Texels in a footprint, the mean over a picture: with fewer Blender's nodes reach the lobe's error in less time,
# because Open Shading Language makes each sample slower: decision 42.
FEWEST_TEXELS = 1.0
CLOSE_UP = "its glints are so close, about a texel a sample, that Blender's own nodes are as fast"


def is_close_up(scene: bpy.types.Scene, views: SceneViews | None, family: Family) -> bool:
    """Whether footprints on all that shows a family's maps hold FEWEST_TEXELS or less, at any frame and to any camera.

    views: what `scene_views` found; family: `material_lights.Family`. False where that is not known, and for Linear
    maps, whose slopes differ within a texel. Matrices must be current.
    """
    if views is None or views.has_mirrors or not family.held:
        return False
    groups = {held.group for held in family.held}
    if any(group_binding(group).interpolation != "CLOSEST" or MapTables.of(group).size is None for group in groups):
        return False
    seen = [_texels_a_footprint(scene, views, thing, family.materials, groups) for thing in family.objects]
    return 0.0 < max(seen, default=0.0) <= FEWEST_TEXELS


def _texels_a_footprint(
    scene: bpy.types.Scene,
    views: SceneViews,
    thing: bpy.types.Object,
    materials: Iterable[bpy.types.Material],
    groups: set[bpy.types.ShaderNodeTree],
) -> float:
    """Mean over the pixels that show an object, the largest of all frames and cameras; 0: not seen, inf: not known."""
    mesh, surface = rigid_mesh(scene, thing), patches_over(scene, thing, views)
    matrices = places(thing, views.frames)
    if mesh is None or surface is None or matrices is None:
        return inf
    density = max((_texel_density(thing, mesh, matrices[0, :3, :3], material, group)
                   for material in materials for group in groups), default=inf)
    if density == inf:
        return inf
    pixels_a_footprint = pi * (FOOTPRINT_SCALE * SAMPLES**-FOOTPRINT_EXPONENT) ** 2
    largest = 0.0
    for camera in views.cameras:
        for view, (patches, _) in zip(camera, surface, strict=True):
            pixels, is_in_picture = pixels_filled(view, patches)
            texels = density * patches.areas[is_in_picture].sum()
            if texels > 0.0:
                largest = max(largest, texels / max(pixels[is_in_picture].sum(), 1e-30) * pixels_a_footprint)
    return largest


def _texel_density(
    thing: bpy.types.Object,
    mesh: bpy.types.Mesh,
    matrix: np.ndarray,
    material: bpy.types.Material,
    group: bpy.types.ShaderNodeTree,
) -> float:
    """Most texels per square metre of a material's map on an object's mesh; inf: who knows. matrix (3, 3): to world."""
    largest, transforms = 0.0, uv_transforms(material, group, metres_rendered(thing, mesh, matrix))
    if transforms is None:
        return inf
    scale = np.diag(np.asarray(MapTables.of(group).size, float))
    for uv_map, transform in transforms:
        density = largest_texel_area(mesh, matrix, uv_map, scale @ transform)
        if density is None:
            return inf
        largest = max(largest, density)
    return largest
