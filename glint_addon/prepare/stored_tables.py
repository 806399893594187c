"""The tables of maps that are stored already: which a group remembers, and whether they are there and whole."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import bpy

from .. import paths
from ..bake.float_image import is_whole
from ..images import image_shape, image_stamp, image_state, is_several, is_unsaved
from ..nodes.builder import version_of
from ..nodes.glint_bsdf import VERSION
from ..nodes.map_tables import NO_COUNTS, MapTables
from .uses import image_of_pixels


def stored_tables(group: bpy.types.ShaderNodeTree, state: str, folder: Path) -> MapTables | None:
    """What a group remembers of its map's tables, as far as these are whole and in `folder`, that of this .blend file.

    state: `map_state` of the map now. None if the table of normals is not there, or that of another state; tables of
    a map that is missing may be of any state, and anywhere.
    """
    known, has_no_map = MapTables.of(group), is_missing(group)
    if version_of(group) != VERSION or not (has_no_map or known.source == state != ""):
        return None

    def is_stored(path: str) -> bool:
        file = paths.disk_path(path)
        return path != "" and (file.parent == folder or has_no_map) and is_whole(file)

    if not known.is_known or not is_stored(known.path):
        return None
    has_counts = known.counts.is_known and is_stored(known.counts.path)
    return replace(known, counts=known.counts if has_counts else NO_COUNTS,
                   index=known.index if is_stored(known.index) else "",
                   flakes=known.flakes if is_stored(known.flakes) else "")


def is_missing(group: bpy.types.ShaderNodeTree) -> bool:
    """Whether neither the file nor the pixels of the group's map are to be had."""
    image = image_of_pixels(group)
    if is_several(image):
        return image_state(image) == ""
    if is_unsaved(image) or image.packed_file is not None or image.source != "FILE":
        return False
    return image_stamp(image) == "" and 0 in image_shape(image)


def remembered_tables(group: bpy.types.ShaderNodeTree) -> list[Path]:
    """The table files that a group reads, wherever they should be; there or not."""
    return [paths.disk_path(path) for path in MapTables.of(group).paths]


def damaged_tables(groups: Iterable[bpy.types.ShaderNodeTree]) -> list[Path]:
    """The table files of groups that are there, but not as they were written."""
    files = dict.fromkeys(file for group in groups for file in remembered_tables(group))
    return [file for file in files if file.exists() and not is_whole(file)]
