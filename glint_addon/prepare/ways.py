"""Which way each group's glints are rendered: by the OSL lobe, which needs tables, or by nodes, which need none."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..images import ImageStates, image_shape
from ..nodes import glint_bsdf
from ..nodes.map_binding import MapBinding
from ..nodes.map_tables import MapTables
from ..nodes.places import NARROWEST
from .map_plans import footprints_seen
from .shading_system import runs_lobe
from .uses import Uses, image_of_pixels

# Of groups the size (width, height) of their map in texels, and the smallest and largest footprint that cameras see.
Footprints = dict[bpy.types.ShaderNodeTree, tuple[tuple[int, int], tuple[float, float]]]


def maps_by_nodes(
    scene: bpy.types.Scene, uses: Uses, states: ImageStates, *, mirrored: bool
) -> tuple[Uses, Footprints]:
    """Those of the `uses` to prepare whose glints are rendered by nodes alone, and the footprints of their maps.

    states: of the images, which are filled in; mirrored: see `footprint_range`. Makes copies follow images that were
    painted. Raises MapError for a way of reading a map that glints cannot follow, SceneError for a group that lost a
    node.
    """
    by_nodes = {group: pairs for group, pairs in uses.items()
                if not (runs_lobe(scene) and glint_bsdf.takes_lobe(group))}
    sharing: dict[MapBinding, Uses] = {}
    for group, pairs in by_nodes.items():
        glint_bsdf.follow_map(group, states)
        sharing.setdefault(glint_bsdf.group_binding(group), {})[group] = pairs
    footprints: Footprints = {}
    for same in sharing.values():
        height, width, _ = image_shape(image_of_pixels(next(iter(same))))
        if 0 not in (height, width):  # a missing map has a warning of its own
            size = width, height
            footprints |= dict.fromkeys(same, (size, footprints_seen(scene, same, size, mirrored=mirrored)))
    return by_nodes, footprints


def choose_ways(scene: bpy.types.Scene, groups: Iterable[bpy.types.ShaderNodeTree], footprints: Footprints) -> None:
    """Let each group render the way that fits `scene`, with no more than its maps' footprints need.

    footprints: of the groups where they are known. Other scenes may see larger ones.
    """
    is_alone = len(bpy.data.scenes) == 1
    for group in groups:
        if not (runs_lobe(scene) and glint_bsdf.takes_lobe(group)):
            glint_bsdf.refresh(group)  # nothing was baked for it, which brings groups up to date elsewhere
        if not glint_bsdf.takes_lobe(group) and MapTables.of(group).path:
            MapTables.none_for((1, 1)).write_to(group)  # of the image that it had before
        glint_bsdf.choose_way(group, by_nodes=not runs_lobe(scene))
        if group in footprints:
            size, (_, widest) = footprints[group]
            glint_bsdf.follow_footprints(group, size, are_wide=not is_alone or widest >= NARROWEST)
