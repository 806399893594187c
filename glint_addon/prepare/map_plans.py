"""What each normal map of a scene needs: which tables, by what the cameras see, and which of them are stored."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ..bake.counts import file_size
from ..bake.flakes import table_texels
from ..bake.float_image import list_shape
from ..bake.slope_index import index_shape
from ..bake.table import padded_size
from ..images import ImageStates, image_pixels, image_shape, image_stamp
from ..nodes import glint_bsdf
from ..nodes.glint_bsdf import group_binding
from ..nodes.map_tables import NO_COUNTS, CountsTable, MapTables
from ..seen.footprints import counts_levels_reached, footprint_range, index_is_reached
from .flake_images import map_state
from .stored_tables import is_missing, stored_tables
from .uses import Uses, image_of_pixels

TEXEL_BYTES = 16  # four 32-bit floats, in memory and in the file
HALF_TEXEL_BYTES = 8


@dataclass
class MapPlan:
    """A map and one way to read it, for all groups that do.

    binding: that way; size: (width, height) in texels; state: `map_state` of the map; stored: its tables that are
    stored, or None; footprints: smallest and largest that cameras see, see `footprint_range`; levels: block sides
    (first, last) of the counts it needs, or None; has_index: whether it needs the index; has_table: whether it gets
    tables at all.
    """

    groups: list[bpy.types.ShaderNodeTree]
    binding: glint_bsdf.MapBinding
    size: tuple[int, int]
    state: str
    stored: MapTables | None
    footprints: tuple[float, float]
    levels: tuple[int, int] | None = None
    has_index: bool = False
    has_table: bool = True

    @property
    def image(self) -> bpy.types.Image:
        """The map, the user's own image."""
        return self.binding.image

    @property
    def image_read(self) -> bpy.types.Image:
        """The image whose pixels are the map's values: the map, or a copy of it."""
        return image_of_pixels(self.groups[0])

    @property
    def interpolation(self) -> str:
        """'CLOSEST' or 'LINEAR'."""
        return self.binding.interpolation

    @property
    def table_bytes(self) -> int:
        """Memory of the table of normals, and of that of flakes if there are any."""
        normals = padded_size(self.size[0]) * padded_size(self.size[1]) * TEXEL_BYTES
        if not self.binding.has_flakes:
            return normals
        columns, rows = list_shape(table_texels(*self.size, self.binding.flake_color is not None))
        return normals + columns * rows * HALF_TEXEL_BYTES

    @property
    def counts_bytes(self) -> int:
        """Memory of the counts of the plan's levels."""
        if self.levels is None:
            return 0
        columns, rows = file_size(*self.size, self.interpolation, self.levels)
        return columns * rows * TEXEL_BYTES

    @property
    def index_bytes(self) -> int:
        """Memory of the index, if the plan has one."""
        columns, rows = index_shape(*self.size)
        return columns * rows * TEXEL_BYTES * self.has_index

    def tables_ready(self) -> MapTables | None:
        """The tables of the map where none is to be baked, else None.

        A map that is missing has what tables are stored, be they too few: a warning says that it is missing.
        """
        if self.stored is None or self.binding.has_flakes and not self.stored.flakes:
            return None
        has_counts = self.levels is not None and self.stored.counts.levels == self.levels
        flakes = self.stored.flakes if self.binding.has_flakes else ""
        ready = replace(self.stored, flakes=flakes, counts=self.stored.counts if has_counts else NO_COUNTS,
                        index=self.stored.index if self.has_index else "")
        is_complete = has_counts == (self.levels is not None) and (ready.index != "") == self.has_index
        return ready if is_complete or is_missing(self.groups[0]) else None


def map_plans(
    scene: bpy.types.Scene, uses: Uses, folder: Path, states: ImageStates, *, mirrored: bool, keep_levels: bool
) -> list[MapPlan]:
    """One plan for each map and way to read it. uses: {group: [(object, material), ...]} of the groups to prepare.

    folder: where tables are kept; states: of the images, which are filled in; mirrored: see `footprint_range`;
    keep_levels: add those that are in use already, for other scenes. Plans of one map follow each other. Reloads images
    whose file has changed, and makes copies follow images that were painted. Raises MapError for an image without
    pixels, or a way of reading it that glints cannot follow, SceneError for a group that lost a node.
    """
    sharing: dict[tuple[Any, ...], dict[tuple[Any, ...], list[bpy.types.ShaderNodeTree]]] = {}
    for group in uses:
        glint_bsdf.follow_map(group, states)
        binding = group_binding(group)
        ways = sharing.setdefault((binding.image, binding.convention, binding.presence), {})
        ways.setdefault((binding.interpolation, binding.flake_color), []).append(group)
    plans = []
    for groups in (groups for ways in sharing.values() for groups in ways.values()):
        stored, size = _stored(groups, folder, states)
        footprints = footprints_seen(scene, {group: uses[group] for group in groups}, size, mirrored=mirrored)
        plan = MapPlan(groups, group_binding(groups[0]), size, map_state(groups[0], states), stored, footprints)
        known = stored or MapTables()
        levels = counts_levels_reached(footprints, *size, plan.interpolation)
        plan.levels = _with_stored(levels, known.counts, keep_levels)
        is_indexed = index_is_reached(footprints) or keep_levels and known.index != ""
        plan.has_index = is_indexed and plan.interpolation == "CLOSEST"
        plans.append(plan)
    return plans


def footprints_seen(
    scene: bpy.types.Scene, uses: Uses, size: tuple[int, int], *, mirrored: bool
) -> tuple[float, float]:
    """Smallest and largest footprint, in texels, of a map of `size` that all the groups of `uses` read."""
    ranges = [footprint_range(scene, group, pairs, size, mirrored=mirrored) for group, pairs in uses.items()]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def named_levels(plans: list[MapPlan]) -> dict[str, list[int] | None]:
    """Block sides [first, last] of the counts of each map, by its image's name; by how it is read too, if need be."""
    names = [plan.image.name for plan in plans]
    return {
        plan.image.name if names.count(plan.image.name) == 1 else plan.groups[0].name:
        list(plan.levels) if plan.levels else None
        for plan in plans
    }


def _stored(
    groups: list[bpy.types.ShaderNodeTree], folder: Path, states: ImageStates
) -> tuple[MapTables | None, tuple[int, int]]:
    """The stored tables of the map of `groups`, if there are any, and its size (width, height) in texels."""
    image = image_of_pixels(groups[0])
    state = map_state(groups[0], states)
    found = (stored_tables(group, state, folder) for group in groups)
    stored = next((tables for tables in found if tables is not None), None)
    if stored is not None and stored.size is not None:
        return stored, stored.size
    if image_stamp(image) and not any(state == MapTables.of(group).source for group in groups):
        image.reload()  # Blender may still hold the pixels of an older file
    height, width, _ = image_shape(image)
    if 0 in (height, width):
        image_pixels(image)  # raises the sentence
    return None, (width, height)


def _with_stored(levels: tuple[int, int] | None, counts: CountsTable, keep_levels: bool) -> tuple[int, int] | None:
    """The levels to use where `levels` are needed and `counts` are stored: a file with more levels is as good."""
    if not counts.path or counts.levels is None or levels is None and not keep_levels:
        return levels
    first, last = counts.levels
    if levels is None:
        return first, last
    both = min(levels[0], first), max(levels[1], last)
    return both if keep_levels or both == (first, last) else levels
