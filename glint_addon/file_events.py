"""What Glint does when a file is saved, opened or appended from: tables follow it, and old groups lose no map."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from . import paths
from .nodes.glint_bsdf import drop_pointers
from .table_files import bring_tables, change_paths, find_tables, groups_with_tables, place, table_paths

_before = {}  # {group: its paths} while a file is being saved, to be put back if that fails
_left = []  # tables of an unsaved file, which go once the file is saved


def register():
    """Look after tables whenever a file is saved, opened or appended from."""
    for handlers, function in _handlers():
        handlers.append(function)


def unregister():
    """Look after them no more."""
    for handlers, function in _handlers():
        handlers.remove(function)


@persistent
def before_saving(file: str, *_):
    """Have the tables beside the file that is to be written; no name of a file: Blender's startup file."""
    _before.clear()
    _left.clear()
    if not file:
        return
    folder = paths.table_folder(file)
    for group in groups_with_tables():
        _before[group] = table_paths(group)
        if not bpy.data.filepath:
            _left.extend(map(paths.disk_path, _before[group]))
    bring_tables(_before, folder)


@persistent
def after_saving(file: str, *_):
    """Remove what an unsaved file had in the user's folder; the copy of a file leaves the open one as it was."""
    if not _before:
        return
    if bpy.data.filepath and Path(bpy.data.filepath) == Path(file):
        folder = paths.table_folder(file)
        for table in dict.fromkeys(_left):
            if table.parent != folder and (folder / table.name).is_file():
                table.unlink(missing_ok=True)
    else:
        _put_back()
    _before.clear()


@persistent
def after_saving_failed(*_):
    """Put back the paths that were for the file which could not be written."""
    _put_back()


@persistent
def after_opening(*_):
    """Save the maps of an older version, and find tables beside the file: it kept absolute paths, as files that were
    never saved do."""
    drop_pointers()
    find_tables()


@persistent
def after_importing(context, *_):
    """Bring the tables of what was appended; what is linked finds them beside its own file."""
    for item in context.import_items:
        group = item.id
        if isinstance(group, bpy.types.ShaderNodeTree) and group.library is None and table_paths(group):
            library = item.source_library.filepath if item.source_library is not None else ""
            if bpy.data.filepath:
                bring_tables([group], paths.table_folder(bpy.data.filepath), library)
            else:
                change_paths(group, lambda stored, library=library: str(place(stored, library)))


def _handlers():
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


def _put_back():
    for group, stored in _before.items():
        names = iter(stored)
        change_paths(group, lambda _, names=names: next(names))
    _before.clear()


