"""Tables stay with their .blend file: saved elsewhere, or its materials linked or appended to another, it finds them.

Files keep the paths of tables relative to themselves (`paths.stored_path`), and Blender neither knows these files nor
changes such paths. So whatever changes what the paths are relative to brings the tables along. Tables are never changed
once they are written, so that a second name for one file (a hard link) is as good as a copy, and costs nothing.

A path in a group that is linked from another file is relative to the open file too, when Cycles reads it: Blender
first copies all groups into one tree of the open file. So tables of linked groups must be beside both files. While a
file is open, linked groups too name them where they are; Blender does not save what is changed there.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from uuid import uuid4

import bpy

from .. import paths
from ..nodes import map_tables, mip_levels
from ..nodes.glint_bsdf import is_glint_group


def keep_tables() -> None:
    """Let all groups find their tables, and have these beside the open file if it is saved."""
    find_tables()
    if bpy.data.filepath:
        bring_tables(groups_with_tables(), paths.table_folder(bpy.data.filepath))


def bring_tables(groups: Iterable[bpy.types.NodeTree], folder: Path) -> list[Path]:
    """Have the tables of the node groups in `folder`, "glint_tables" beside a .blend file, and let the groups name them
    there.

    A table that cannot be brought is named where it is. Returns what was made on disk, for `take_back`.
    """
    made: list[Path] = []
    for group in groups:
        change_paths(group, lambda stored: _brought(stored, folder, made))
    if made == [folder]:
        take_back(made)
        return []
    return made


def take_back(made: list[Path]) -> None:
    """Remove what `bring_tables` made; a folder only if nothing else is in it."""
    for path in reversed(made):
        if not path.is_dir():
            path.unlink(missing_ok=True)
        elif not any(path.iterdir()):
            path.rmdir()


def find_tables(elsewhere: Iterable[Path] = ()) -> None:
    """Let node groups whose tables are gone name them beside the open file, or where else they are.

    Looked at are the file that the open one is a link to, those that groups are linked from, or were before they were
    made local, and the folders `elsewhere`. A table's name tells its contents: any of that name will do.
    """
    folders = dict.fromkeys([*_neighbours(), *elsewhere])
    for group in groups_with_tables():
        change_paths(group, lambda stored: _found(stored, folders))


def groups_with_tables() -> list[bpy.types.NodeTree]:
    """Node groups that name tables, linked ones too."""
    return [group for group in bpy.data.node_groups if table_paths(group)]


def table_paths(group: bpy.types.NodeTree) -> list[str]:
    """The paths that a node group names, in the order in which `change_paths` meets them."""
    found = []

    def note(stored: str) -> str:
        found.append(stored)
        return stored

    change_paths(group, note)
    return found


def change_paths(group: bpy.types.NodeTree, change: Callable[[str], str]) -> None:
    """Let change(path) say what stands for each path that a node group names."""
    if is_glint_group(group):
        map_tables.change_paths(group, change)
    mip_levels.change_paths(group, change)


def _neighbours() -> list[Path]:
    """Folders where tables of the open file may be: its own first."""
    files = [bpy.data.filepath, os.path.realpath(bpy.data.filepath)] if bpy.data.filepath else []
    files += [bpy.path.abspath(library.filepath) for library in bpy.data.libraries]
    return [paths.table_folder(file) for file in files]


def _brought(stored: str, folder: Path, made: list[Path]) -> str:
    """The path to name for a table that is to be in `folder`."""
    source, target = paths.disk_path(stored), folder / _name(stored)
    beside = f"//{folder.name}/{target.name}"
    if source == target or not _is_file(source):
        return beside if _is_file(target) else stored
    if _is_file(target) and target.stat().st_size == source.stat().st_size:
        return beside
    try:
        if not folder.exists():
            folder.mkdir()
            made.append(folder)
        is_new = not target.exists()
        _duplicate(source, target)
    except OSError:  # a full disk, a folder that may not be written to: there it is still found on this machine
        return str(source)
    made += [target] * is_new
    return beside


def _found(stored: str, folders: Iterable[Path]) -> str:
    """The path to name for a table that may be gone from where it was."""
    if _is_file(paths.disk_path(stored)):
        return stored
    there = [folder / _name(stored) for folder in folders if _is_file(folder / _name(stored))]
    return paths.stored_path(there[0]) if there else stored


def _name(stored: str) -> str:
    """Name of a table's file; its path may be of another system."""
    return stored.replace("\\", "/").rpartition("/")[2]


def _is_file(path: Path) -> bool:
    """Whether a file is there and may be seen."""
    return os.path.isfile(path)  # noqa: PTH113  (pathlib raises PermissionError for a folder that is shut)


def _duplicate(source: Path, target: Path) -> None:
    """Make `target` the same file as `source`, or a copy that appears whole or not at all."""
    temporary = target.with_name(f".{target.stem}_{uuid4().hex}{target.suffix}")
    try:
        try:
            os.link(source.resolve(), temporary)
        except OSError:  # another disk, or one that has no links
            shutil.copyfile(source, temporary)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
