"""The tables of the normal maps that a scene shows: what each map needs, what is stored already, and the bake."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from .. import paths
from ..bake.counts import bake_counts, file_size
from ..bake.float_image import is_whole
from ..bake.normal_map import decoded_normals, slope_bounds
from ..bake.slope_index import bake_index, index_shape
from ..bake.table import bake_table, padded_size
from ..images import image_pixels, image_shape, image_stamp, image_state
from ..nodes import glint_bsdf
from ..nodes.builder import STAMP
from ..nodes.glint_bsdf import group_binding, image_read, stored_text
from ..seen.footprints import counts_levels_reached, footprint_range, index_is_reached
from .jobs import Job

TEXEL_BYTES = 16  # four 32-bit floats, in memory and in the file
# Parts of a map's work: table of normals, index, counts.
TABLE_SHARE, INDEX_SHARE, COUNTS_SHARE = 0.2, 0.3, 0.5
# What a group remembers, each with "glint_" before it, in the order of `glint_bsdf.set_table`; tables as
# `paths.stored_path` has them.
REMEMBERED = ("table", "size", "slope_low", "slope_high")
COUNTS_REMEMBERED = ("counts", "counts_levels", "bin_low", "bin_high")


@dataclass
class MapPlan:
    """A map and one way to read it, for all groups that do. binding: that way; size: (width, height) in texels; levels:
    block sides (first, last) of the counts it needs, or None; has_index: whether it needs the index; has_table: whether
    it gets tables at all; known: a group that remembers the tables of the map as it is now, or None."""

    groups: list
    binding: glint_bsdf.MapBinding
    size: tuple[int, int]
    stamp: str
    known: object | None
    levels: tuple[int, int] | None = None
    has_index: bool = False
    has_table: bool = True

    @property
    def image(self):
        """The map, the user's own image."""
        return self.binding.image

    @property
    def interpolation(self) -> str:
        """'CLOSEST' or 'LINEAR'."""
        return self.binding.interpolation

    @property
    def table_bytes(self) -> int:
        """Memory of the table of normals."""
        return padded_size(self.size[0]) * padded_size(self.size[1]) * TEXEL_BYTES

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


def map_plans(scene, uses, folder: Path, *, mirrored: bool, keep_levels: bool) -> list[MapPlan]:
    """One plan for each map and way to read it. uses: {group: [(object, material), ...]} of the groups to prepare.

    folder: where tables are kept; mirrored: see `footprint_range`; keep_levels: add those that are in use already, for
    other scenes. Reloads images whose file has changed, and makes copies follow images that were painted. Raises
    MapError for an image without pixels, or a way of reading it that glints cannot follow, SceneError for a group that
    lost a node.
    """
    sharing = {}
    for group in uses:
        glint_bsdf.follow_map(group)
        binding = group_binding(group)
        sharing.setdefault((binding.image, binding.interpolation, binding.convention), []).append(group)
    plans = [_plan(groups, folder) for groups in sharing.values()]
    for plan in plans:
        ranges = [footprint_range(scene, group, uses[group], plan.size, mirrored=mirrored) for group in plan.groups]
        footprints = min(low for low, _ in ranges), max(high for _, high in ranges)
        plan.levels = counts_levels_reached(footprints, *plan.size, plan.interpolation)
        plan.levels = _with_stored(plan.levels, _stored_counts(plan.known, folder), keep_levels)
        plan.has_index = index_is_reached(footprints) or keep_levels and _stored_index(plan.known, folder) != ""
    return plans


def _with_stored(levels, counts, keep_levels):
    """The levels to use where `levels` are needed and `counts` are stored: a wider file that is there is as good."""
    if counts is None or levels is None and not keep_levels:
        return levels
    first, last = counts[1]
    if levels is None:
        return first, last
    both = min(levels[0], first), max(levels[1], last)
    return both if keep_levels or both == (first, last) else levels


def bake_plan(plan: MapPlan, folder: Path, report: dict, start: float, end: float):
    """Bake what is missing of a map: a generator of jobs, to be sent what each returns; it returns the tables' values.

    The values are the arguments of `glint_bsdf.set_table` after the group. start, end: part of the whole work, 0..1.
    Adds to "baked" and "reused" of `report`, once for each group, and to its count of images read. Raises MapError.
    """
    if not plan.has_table:
        return "", list(plan.size), [0.0, 0.0], [0.0, 0.0], None, ""
    counts = _stored_counts(plan.known, folder) if plan.levels is not None else None
    if counts is not None and counts[1] != list(plan.levels):
        counts = None
    index = _stored_index(plan.known, folder) if plan.has_index else ""
    # Nothing to bake: do not even read the pixels. Missing file: a warning says so, its table is still here.
    is_complete = (counts is not None or plan.levels is None) and (index or not plan.has_index)
    if plan.known is not None and (is_complete or is_missing(plan.groups[0])):
        path, *others = (plan.known[f"glint_{name}"] for name in REMEMBERED)
        values = path, *map(list, others), counts, index
        report["reused"] += [str(paths.disk_path(path)) for path in _paths(values)] * len(plan.groups)
        return values

    report["counts"]["images_read"] += 1
    name = plan.image.name
    report["notes"] += _damage(plan)
    pixels = image_pixels(image_read(plan.groups[0]))
    normals = decoded_normals(pixels, convention=plan.binding.convention, name=name)
    shares = TABLE_SHARE, INDEX_SHARE * plan.has_index, COUNTS_SHARE * (plan.levels is not None)
    ends = [start + (end - start) * sum(shares[: part + 1]) / sum(shares) for part in range(len(shares))]

    def note(path, written):
        report["baked"] += [str(path)] * written
        report["reused"] += [str(path)] * (len(plan.groups) - written)
        return paths.stored_path(path)

    job = partial(bake_table, normals, folder, interpolation=plan.interpolation)
    path = note(*(yield Job(f'Baking "{name}"', start, ends[0], job)))
    if plan.has_index:
        job = partial(bake_index, normals, folder, interpolation=plan.interpolation)
        index = note(*(yield Job(f'Sorting "{name}"', ends[0], ends[1], job)))
    if plan.levels is not None:
        job = partial(bake_counts, normals, folder, interpolation=plan.interpolation, levels=plan.levels)
        counts_path, written, low, high = yield Job(f'Counting "{name}"', ends[1], ends[2], job)
        counts = note(counts_path, written), list(plan.levels), _floats(low), _floats(high)
    low, high = slope_bounds(normals)
    return path, [normals.shape[1], normals.shape[0]], _floats(low), _floats(high), counts, index


def named_levels(plans) -> dict[str, list[int] | None]:
    """Block sides [first, last] of the counts of each map, by its image's name; by how it is read too, if need be."""
    names = [plan.image.name for plan in plans]
    return {
        plan.image.name if names.count(plan.image.name) == 1 else plan.groups[0].name:
        list(plan.levels) if plan.levels else None
        for plan in plans
    }


def remember(group, stamp: str, path: str, size, slope_low, slope_high, counts, index: str):
    """Store on a group what the next call needs to find its tables again without reading the image."""
    group["glint_source"] = stamp if path else ""
    group["glint_size"] = size
    group["glint_slope_low"] = slope_low
    group["glint_slope_high"] = slope_high
    for name, value in zip(COUNTS_REMEMBERED, counts or ("", [0, 0], [0.0, 0.0], [0.0, 0.0]), strict=True):
        group[f"glint_{name}"] = value
    group["glint_index"] = index


def is_missing(group) -> bool:
    """Whether neither the file nor the pixels of the group's map are to be had."""
    image = image_read(group)
    return image.source == "FILE" and image_state(image) == "" and 0 in image_shape(image)


def remembered_tables(group) -> list[Path]:
    """The table files that a group reads, wherever they should be; there or not."""
    stored = (stored_text(group, name) for name in glint_bsdf.PATHS)
    return [paths.disk_path(path) for path in stored if path]


def _plan(groups, folder) -> MapPlan:
    image, binding = image_read(groups[0]), group_binding(groups[0])
    stamp = image_state(image)
    known = next((group for group in groups if _is_known(group, stamp, folder)), None)
    if known is None and image_stamp(image) and not any(
            stamp == stored_text(group, "glint_source") for group in groups):
        image.reload()  # Blender may still hold the pixels of an older file
    height, width, _ = image_shape(image) if known is None else (0, 0, 0)
    if known is None and 0 in (height, width):
        image_pixels(image)  # raises the sentence
    return MapPlan(groups, binding, tuple(known["glint_size"] if known else (width, height)), stamp, known)


def _is_known(group, stamp, folder) -> bool:
    """Whether the group's table of normals is there, whole, and that of the image as it is now."""
    same_file = stamp != "" and stamp == stored_text(group, "glint_source")
    if group[STAMP] != glint_bsdf.VERSION or not (same_file or is_missing(group)):
        return False
    path, *others = (group.get(f"glint_{name}") for name in REMEMBERED)
    return bool(stored_text(group, "glint_table")) and all(map(_is_pair, others)) and _is_stored(group, path, folder)


def _stored_counts(group, folder):
    """Path, levels, low and high bins of the counts that a group remembers, or None if they are not there."""
    if group is None or not stored_text(group, "glint_counts"):
        return None
    if not all(_is_pair(group.get(f"glint_{name}")) for name in COUNTS_REMEMBERED[1:]):
        return None
    if not _is_stored(group, group["glint_counts"], folder):
        return None
    return group["glint_counts"], *(list(group[f"glint_{name}"]) for name in COUNTS_REMEMBERED[1:])


def _stored_index(group, folder) -> str:
    """Path of the index that a group remembers, or "" if it is not there."""
    path = stored_text(group, "glint_index") if group is not None else ""
    return path if path and _is_stored(group, path, folder) else ""


def _is_stored(group, path: str, folder) -> bool:
    """Whether the table is whole, and in the folder of this .blend file; that of a missing map may be anywhere."""
    file = paths.disk_path(path)
    return (file.parent == folder or is_missing(group)) and is_whole(file)


def _is_pair(value) -> bool:
    """Whether a property holds two numbers."""
    return hasattr(value, "typecode") and len(value) == 2


def _damage(plan) -> list[str]:
    """Sentences on tables that are there but not as they were written; they are baked again."""
    files = dict.fromkeys(file for group in plan.groups for file in remembered_tables(group))
    return [f"Table {file.name} is damaged, or of an older version: it is baked again." for file in files
            if file.exists() and not is_whole(file)]


def _paths(values) -> list[str]:
    path, *_, counts, index = values
    return [name for name in (path, index, counts and counts[0]) if name]


def _floats(bound) -> list[float]:
    return [float(value) for value in bound]
