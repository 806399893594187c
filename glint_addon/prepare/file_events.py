"""What Glint does when a file is saved, opened or appended from: tables follow it, and old groups lose no map."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from .. import paths
from ..nodes.map_binding import drop_pointers
from .table_files import bring_tables, change_paths, find_tables, groups_with_tables, table_paths, take_back

# The paths of each group while a file is being saved, to be put back if that fails.
_before: dict[bpy.types.NodeTree, list[str]] = {}
_made: list[Path] = []  # what was made on disk for the file that is being saved
_left: list[Path] = []  # tables that an unsaved file has in the user's folder, which go once the file is saved
# Folders of tables beside all files of this session, in order: undoing may lead back to what is there.
_homes: dict[Path, None] = {}


def register() -> None:
    """Let tables follow whenever a file is saved, opened or appended from."""
    for handlers, function in _handlers():
        handlers.append(function)


def unregister() -> None:
    """Let tables follow no more."""
    for handlers, function in _handlers():
        handlers.remove(function)
    _homes.clear()


@persistent
def before_saving(file: str, *_: object) -> None:
    """Have the tables beside the file that is to be written; no name of a file: Blender's startup file."""
    for memory in (_before, _made, _left):
        memory.clear()
    if not file:
        return
    _remember_home()
    find_tables(_homes)
    _before.update((group, table_paths(group)) for group in groups_with_tables())
    if not bpy.data.filepath:
        named = {Path(stored) for stored_paths in _before.values() for stored in stored_paths}
        # Others that it names are those of a file which its materials were appended from.
        _left.extend(sorted(table for table in named if table.parent == paths.table_folder()))
    _made.extend(bring_tables(_before, paths.table_folder(file)))


@persistent
def after_saving(file: str, *_: object) -> None:
    """Remove what an unsaved file had in the user's folder; the copy of a file leaves the open one as it was."""
    if not bpy.data.filepath or Path(bpy.data.filepath) != Path(file):
        _put_back()
        return
    _remember_home()
    _before.clear()
    folder = paths.table_folder(file)
    for table in _left:
        if (folder / table.name).is_file():
            table.unlink(missing_ok=True)


@persistent
def after_saving_failed(*_: object) -> None:
    """Put back the paths that were for the file which could not be written, and take its tables away."""
    _put_back()
    take_back(_made)


@persistent
def after_opening(*_: object) -> None:
    """Save the maps of an older version, and find tables beside the file: it kept absolute paths, as files that were
    never saved do."""
    _remember_home()
    drop_pointers()
    find_tables(_homes)


@persistent
def after_importing(context: bpy.types.BlendImportContext, *_: object) -> None:
    """Find the tables of what was linked or appended; those of what was appended come along at once."""
    sources = [item.source_library for item in context.import_items if item.source_library is not None]
    find_tables([*_homes, *(paths.table_folder(bpy.path.abspath(source.filepath)) for source in sources)])
    if bpy.data.filepath:
        appended = [group for group in groups_with_tables() if group.library is None]
        bring_tables(appended, paths.table_folder(bpy.data.filepath))


def _handlers() -> tuple[tuple[list[Callable[..., None]], Callable[..., None]], ...]:
    handlers = bpy.app.handlers
    return (
        (handlers.save_pre, before_saving),
        (handlers.save_post, after_saving),
        (handlers.save_post_fail, after_saving_failed),
        (handlers.load_post, after_opening),
        (handlers.undo_post, after_opening),
        (handlers.redo_post, after_opening),
        (handlers.blend_import_post, after_importing),
    )


def _remember_home() -> None:
    if bpy.data.filepath:
        _homes[paths.table_folder(bpy.data.filepath)] = None


def _put_back() -> None:
    for group, stored in _before.items():
        _name_again(group, stored)
    _before.clear()


def _name_again(group: bpy.types.NodeTree, stored: list[str]) -> None:
    """Let a group name the paths that it named before, in the order of `table_paths`."""
    names = iter(stored)
    change_paths(group, lambda _: next(names))
