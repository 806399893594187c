"""Frames as the command line names them, "1-10,20" or "1-100x10", as ranges that Blender renders in one go."""

from __future__ import annotations

import re

from ..errors import SceneError

FIRST, LAST = -1048574, 1048574  # Blender's own limits, MINAFRAME and MAXFRAME
MOST = 100_000  # frames in one list; an hour of film has 86,400, and what asks for more is a slip of the keyboard
_PART = re.compile(r"(-?\d+)(?:(?:-|\.\.)(-?\d+)(?:x(\d+))?)?")


def frame_ranges(words: str) -> list[range]:
    """The frames of `words`, each once and in order, in as few ranges as their steps allow.

    Parts are separated by commas: 7, 1-10, 1..10 (as Blender's -f has it), 1-10x3 (every third), -5--1 (below 0).
    Raises SceneError for what cannot be read, is empty, too long, or outside Blender's range of frames.
    """
    frames = set()
    for part in words.split(","):
        frames |= set(_part(part.strip(), words))
        if len(frames) > MOST:
            raise _too_many(words)
    return _joined(sorted(frames))


def checked_frame(frame: int) -> int:
    """`frame` itself.

    Raises SceneError if Blender has no such frame.
    """
    if not FIRST <= frame <= LAST:
        raise SceneError(f"Frame {frame} is outside Blender's range: give a frame from {FIRST} to {LAST}.")
    return frame


def _part(part: str, words: str) -> range:
    match = _PART.fullmatch(part)
    if match is None:
        raise SceneError(f'"{part}" in the frames "{words}" is not a frame: write them like 1-10,20 or 1-100x10.')
    first, last, step = match.groups()
    first = checked_frame(int(first))
    last = first if last is None else checked_frame(int(last))
    step = 1 if step is None else int(step)
    if last < first or step < 1:
        raise SceneError(f'"{part}" in the frames "{words}" holds no frame: write the first one first, and a step of 1 '
                         "or more.")
    result = range(first, last + 1, step)
    if len(result) > MOST:
        raise _too_many(words)
    return result


def _too_many(words: str) -> SceneError:
    return SceneError(f'The frames "{words}" are more than {MOST}: render them in several parts.')


def _joined(frames: list[int]) -> list[range]:
    """Sorted `frames` as ranges: from each first frame as far as the step to the next one stays the same."""
    result = []
    start = 0
    while start < len(frames):
        end = start
        step = frames[start + 1] - frames[start] if start + 1 < len(frames) else 1
        if step > LAST:  # more than Blender's Frame Step can be
            step = 1
        while end + 1 < len(frames) and frames[end + 1] - frames[end] == step:
            end += 1
        result.append(range(frames[start], frames[end] + 1, step))
        start = end + 1
    return result
