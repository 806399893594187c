"""Tables stay with their .blend file: saved elsewhere, or its materials appended to another, it still finds them.

Files keep the paths of tables relative to themselves (`paths.stored_path`), and Blender neither knows these files nor
changes such paths. So whatever changes what the paths are relative to brings the tables along. Tables are never changed
once they are written, so that a second name for one file (a hard link) is as good as a copy, and costs nothing.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from uuid import uuid4

import bpy

from . import paths
from .nodes import glint_bsdf, image_texture


def bring_tables(groups, folder: Path, library: str = ""):
    """Have the tables of the node groups in `folder`, "glint_tables" beside a .blend file, and let the groups name them
    there.

    library: the .blend file that their paths are relative to; "" for the open file. A table that cannot be brought is
    named where it is.
    """
    for group in groups:
        change_paths(group, lambda stored: _brought(stored, folder, library))


def find_tables(groups=None):
    """Let node groups whose tables are gone, but lie beside the open file, name these; all local groups by default."""
    if bpy.data.filepath:
        folder = paths.table_folder(bpy.data.filepath)
        for group in groups_with_tables() if groups is None else groups:
            change_paths(group, lambda stored: _found(stored, folder))


def groups_with_tables() -> list:
    """Local node groups that name tables."""
    return [group for group in bpy.data.node_groups if group.library is None and table_paths(group)]


def table_paths(group) -> list[str]:
    """The paths that a node group names, in the order in which `change_paths` meets them."""
    found = []
    change_paths(group, lambda stored: found.append(stored) or stored)
    return found


def change_paths(group, change):
    """Let change(path) say what stands for each path that a node group names."""
    for kind in (glint_bsdf, image_texture):
        kind.change_paths(group, change)


def place(stored: str, library: str) -> Path:
    """Where a path leads that is relative to the file `library`, "" for the open one."""
    if library and stored.startswith("//"):
        return Path(bpy.path.abspath(stored, start=str(Path(bpy.path.abspath(library)).parent)))
    return paths.disk_path(stored)


def _brought(stored, folder, library) -> str:
    """The path to name for a table that is to be in `folder`."""
    source, target = place(stored, library), folder / Path(stored).name
    beside = f"//{folder.name}/{target.name}"
    if source == target or target.is_file() or not source.is_file():
        return beside if target.is_file() or stored.startswith("//") and not library else stored
    try:
        folder.mkdir(exist_ok=True)
        _duplicate(source, target)
    except OSError:  # a full disk, a folder that may not be written to: there it is still found on this machine
        return str(source)
    return beside


def _found(stored, folder) -> str:
    beside = folder / Path(stored.replace("\\", "/")).name
    if paths.disk_path(stored).is_file() or not beside.is_file():
        return stored
    return paths.stored_path(beside)


def _duplicate(source: Path, target: Path):
    """Make `target` the same file as `source`, or a copy that appears whole or not at all."""
    temporary = target.with_name(f".{target.stem}_{uuid4().hex}{target.suffix}")
    try:
        try:
            os.link(source, temporary)
        except OSError:  # another disk, or one that has no links
            shutil.copyfile(source, temporary)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
