"""A generated map follows its settings: a small map at once, the full one in a thread when nothing changed for a while.

In background mode the full map is made at once. Data changes in the main thread alone, in a timer, never in a render.
"""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor

import bpy
from bpy.app.handlers import persistent

from ..errors import GlintError
from ..generate import Recipe
from ..images import Pictures, check_unchanged, is_generated_map, is_preview, pictures, show
from ..materials.replace_group import follow_generated
from .generated_settings import complete, listen, listen_no_more, recipe_from, set_problem

PREVIEW = 256  # texels a side of the small map: most kinds take less than a tenth of a second
DELAY = 0.4  # seconds without a change after which the full map is made: a drag with the mouse pauses for less
INTERVAL = 0.05  # seconds between two looks at the thread

_due: dict[int, float] = {}  # session_uid of images with a small map: when to begin the full one (monotonic seconds)
_thread: ThreadPoolExecutor | None = None
_making: tuple[int, Recipe, Future[Pictures]] | None = None  # the full map that is being made


def register():
    """Follow the settings from now on."""
    listen(follow)
    for handlers, function in _handlers():
        handlers.append(function)


def unregister():
    """Follow them no more."""
    global _thread, _making
    for handlers, function in _handlers():
        handlers.remove(function)
    listen_no_more(follow)
    forget()
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
    if _thread is not None:
        _thread.shutdown(cancel_futures=True)
    _thread = _making = None


def follow(image: bpy.types.Image):
    """Show the settings of a generated map, a small map if there is a window; what stands in the way is kept there."""
    if not is_generated_map(image):
        return
    complete(image.glint)
    recipe = recipe_from(image.glint)
    if bpy.app.background or recipe.resolution <= PREVIEW:
        _due.pop(image.session_uid, None)
        make(image, recipe)
    elif make(image, recipe, PREVIEW):
        begin_soon(image)


def make(image: bpy.types.Image, recipe: Recipe, resolution: int | None = None) -> bool:
    """Make a map now; whether that worked, else `problem` in the image's settings says why not."""
    try:
        check_unchanged(image)
        show(image, recipe, pictures(recipe, resolution, image.name))
        follow_generated(image)
    except GlintError as error:
        set_problem(image.glint, error)
        return False
    set_problem(image.glint, None)
    return True


def is_coming(image: bpy.types.Image) -> bool:
    """Whether the full map of an image is still to be made, so that a render would show the small one."""
    return image.session_uid in _due or (_making is not None and _making[0] == image.session_uid)


def begin_soon(image: bpy.types.Image):
    """Let the full map be made after DELAY, counted anew at each call."""
    _due[image.session_uid] = time.monotonic() + DELAY
    if not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, first_interval=DELAY)


def tick() -> float | None:
    """Begin or end the making of full maps; returns seconds until the next call, None when all are made."""
    if bpy.app.is_job_running("RENDER"):
        return DELAY
    if _making is not None:
        if not _making[2].done():
            return INTERVAL
        _end()
    if not _due:
        return None
    uid, due = min(_due.items(), key=lambda item: item[1])
    wait = due - time.monotonic()
    if wait > 0:
        return wait
    _begin(uid)
    return INTERVAL


def _begin(uid):
    """Make the full map of an image in the thread."""
    global _thread, _making
    del _due[uid]
    image = _image(uid)
    if image is None or not is_preview(image):
        return
    recipe = recipe_from(image.glint)
    _thread = _thread or ThreadPoolExecutor(1, thread_name_prefix="glint")
    _making = uid, recipe, _thread.submit(pictures, recipe, None, image.name)


def _end():
    """Show the full map that was made, unless its settings changed meanwhile or its image is gone."""
    global _making
    uid, recipe, made = _making
    _making = None
    image = _image(uid)
    if image is None or not is_preview(image) or recipe_from(image.glint) != recipe:
        return
    try:
        show(image, recipe, made.result())
    except GlintError as error:
        set_problem(image.glint, error)
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()


def _image(uid):
    return next((image for image in bpy.data.images if image.session_uid == uid and is_generated_map(image)), None)


@persistent
def finish(*_):
    """Make all full maps now: the file is about to be saved."""
    uids = {*_due, *([_making[0]] if _making is not None else [])}
    _due.clear()
    for image in filter(None, map(_image, uids)):
        if is_preview(image):
            make(image, recipe_from(image.glint))


@persistent
def forget(*_):
    """Make no full maps any more: another file is about to be opened."""
    _due.clear()


@persistent
def look(*_):
    """Find small maps that undoing, redoing or opening a file brought back, and let their full maps be made."""
    if bpy.app.background:
        return
    for image in bpy.data.images:
        if is_generated_map(image) and image.is_editable and is_preview(image):
            begin_soon(image)


def _handlers():
    handlers = bpy.app.handlers
    return (
        (handlers.save_pre, finish), (handlers.load_pre, forget), (handlers.load_post, look),
        (handlers.undo_post, look), (handlers.redo_post, look),
    )
