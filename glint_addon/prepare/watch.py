"""Finds out from time to time, while Blender's window is open, whether the scenes shown there must be prepared again.

Panels read the results and compute nothing. This module changes no data.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

INTERVAL = 1.0  # seconds between two looks at what was changed in Blender
SOON = 0.1  # seconds from opening a file to the first look
FILES_INTERVAL = 2.0  # seconds between two looks at files: Blender does not report their changes
# Largest part of all time that looks may take: a look reads painted maps, which is slow: decision 56.
LARGEST_SHARE = 0.02


@dataclass
class _Found:
    """The results for a scene. changes: sentences; tables: {file: "", "gone" or "damaged"}."""

    changes: list[str]
    tables: dict[Path, str]


_found: dict[int, _Found] = {}  # by the scene's session_uid
_is_marked = True
_last_look = 0.0


def register() -> None:
    """Begin to look, if Blender has a window."""
    if bpy.app.background:
        return
    for handlers in _handlers():
        handlers.append(mark)
    bpy.app.handlers.load_post.append(look_soon)
    bpy.app.timers.register(look, first_interval=INTERVAL, persistent=True)


def unregister() -> None:
    """Look no more."""
    _found.clear()
    if bpy.app.timers.is_registered(look):
        bpy.app.timers.unregister(look)
    for handlers in _handlers():
        if mark in handlers:
            handlers.remove(mark)
    if look_soon in bpy.app.handlers.load_post:
        bpy.app.handlers.load_post.remove(look_soon)


def changes(scene: bpy.types.Scene) -> list[str]:
    """What changed since the scene was prepared, as of the last look."""
    found = _found.get(scene.session_uid)
    return found.changes if found is not None else []


def tables(scene: bpy.types.Scene) -> dict[Path, str] | None:
    """The files of the scene's tables and what is wrong with each, "", "gone" or "damaged", as of the last look; None
    before the first."""
    found = _found.get(scene.session_uid)
    return found.tables if found is not None else None


def lost_tables(scene: bpy.types.Scene) -> dict[str, str]:
    """Names of the files of the scene's tables that are "gone" or "damaged", as of the last look."""
    return {table.name: state for table, state in (tables(scene) or {}).items() if state}


@persistent
def mark(*_: object) -> None:
    """Note that something changed, so that the next look comes soon."""
    global _is_marked
    _is_marked = True


@persistent
def look_soon(*_: object) -> None:
    """Look soon at a file that was just opened, however long the look at the file before it took."""
    mark()
    _found.clear()
    if bpy.app.timers.is_registered(look):
        bpy.app.timers.unregister(look)
    bpy.app.timers.register(look, first_interval=SOON, persistent=True)


def look() -> float:
    """Look if a change was marked or FILES_INTERVAL has passed; returns the seconds until the next call."""
    global _is_marked, _last_look
    now = time.monotonic()
    if bpy.app.is_job_running("RENDER") or not (_is_marked or now - _last_look > FILES_INTERVAL):
        return INTERVAL
    _is_marked, _last_look = False, now
    for window in bpy.context.window_manager.windows:
        look_at(window.scene)
    return max(INTERVAL, (time.monotonic() - now) / LARGEST_SHARE)


def look_at(scene: bpy.types.Scene) -> None:
    """Look at a scene now, and let panels show the results."""
    from .changes import changes_since_prepared, table_states

    before = _found.get(scene.session_uid)
    found = _Found(changes_since_prepared(scene), table_states(scene))
    _found[scene.session_uid] = found
    if found != before:
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()


def _handlers() -> list[list[Callable[..., None]]]:
    all_handlers = bpy.app.handlers
    names = ("depsgraph_update_post", "undo_post", "redo_post", "save_post")
    return [getattr(all_handlers, name) for name in names]
