"""Pictures and movies without a window: where they go, in Blender's own notation, and which files then exist."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

import bpy

from ..errors import SceneError
from .blend_file import blender

PICTURES = {
    ".exr": "OPEN_EXR",
    ".jpeg": "JPEG",
    ".jpg": "JPEG",
    ".png": "PNG",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".webp": "WEBP",
}
MOVIES = {".avi": "AVI", ".mkv": "MKV", ".mov": "QUICKTIME", ".mp4": "MPEG4"}  # those that hold Blender's default codec
# Stands for the frame while Blender is asked for the name of a picture without one. No user writes ten.
_MARK, _MARKED = "#" * 10, "0" * 10
_DIGITS = "####"  # as many as Blender gives a name without any
_NAMED = 3  # frames in a sentence

type Stamp = tuple[int, int, int]  # inode, time of the last change in ns, bytes


def set_output(scene, output: str, *, numbered: bool):
    """Let `scene` render to `output`, in the format its ending says; without one the scene's own format stays.

    `//` is the folder of the .blend file, `#` a digit of the frame; a `numbered` name without any gets four of them.
    Raises SceneError for an ending that is no picture's and no movie's.
    """
    path = _absolute(output)
    stem, ending = _split(path)
    if ending:
        _set_format(scene, output, ending.lower())
        scene.render.use_file_extension = True
    # Blender itself would put the digits behind the ending, and another ending behind these.
    is_bare = numbered and bool(ending) and not is_numbered(path) and not scene.render.is_movie_format
    scene.render.filepath = f"{stem}{_DIGITS}{ending}" if is_bare else path


def is_numbered(output: str) -> bool:
    """Whether Blender names each picture of `output` by its frame: it has a `#`, or is a folder."""
    return "#" in _name(output) or not _name(output)


def check_output(scene, ranges: list[range] | None):
    """See that the scene's output can be rendered to, before anything is baked for it; ranges: None for a still.

    Raises SceneError for a name that Blender cannot read, for no frames, and for a movie of other than one range.
    """
    if ranges is not None and not ranges[0]:
        raise SceneError(f'Scene "{scene.name}" has no frames, its last comes before its first: set its frame range.')
    if scene.render.is_movie_format and (ranges is None or len(ranges) > 1):
        raise SceneError(f'Scene "{scene.name}" writes a movie, which holds one range of frames: give --animation or '
                         "--frames FIRST-LAST, or an --output that ends like a picture.")
    _names(scene, 0)


def render_still(scene, *, numbered: bool) -> list[str]:
    """Render the current frame, in place of what is there; a line for each file.

    Unless `numbered` it goes to the scene's output as that stands. Raises SceneError if Blender writes none.
    """
    if numbered:
        scene.render.use_overwrite = True
        return render_frames(scene, [range(scene.frame_current, scene.frame_current + 1)])
    names = _still_names(scene)
    before = _stamps(names)
    blender(f"write {names[0]}", bpy.ops.render.render, write_still=True, scene=scene.name)
    after = _stamps(names)
    lines = [line for name in names if (line := _line(name, before[name], after[name], is_kept=False))]
    if not lines:
        raise SceneError(f"Blender wrote no {names[0]}: see above what it says, and try again.")
    return lines


def render_frames(scene, ranges: list[range]) -> list[str]:
    """Render frames to files named by them; a line for each file. Those there already stay if the scene says so.

    Raises SceneError if Blender fails or leaves out a frame.
    """
    return [line for frames in ranges for line in _render_range(scene, frames)]


def _render_range(scene, frames: range) -> list[str]:
    _set_range(scene, frames)
    is_movie = scene.render.is_movie_format
    names = {frame: _names(scene, frame) for frame in (frames[:1] if is_movie else frames)}
    before = _stamps([name for some in names.values() for name in some])
    blender(f"write {names[frames[0]][0]}", bpy.ops.render.render, animation=True, scene=scene.name,
            frame_start=frames[0], frame_end=frames[-1])
    after = _stamps(before)
    is_kept = not scene.render.use_overwrite and not is_movie
    lines: list[str] = []
    missing: list[int] = []
    for frame, some in names.items():
        there = [_line(name, before[name], after[name], is_kept) for name in some]
        lines += filter(None, there)
        missing += [] if any(there) else [frame]
    if missing:
        more = f" and {len(missing) - _NAMED} more" * (len(missing) > _NAMED)
        raise SceneError(f"Blender wrote nothing for frame {', '.join(map(str, missing[:_NAMED]))}{more}: "
                         "see above what it says, and try again.")
    return lines


def _line(name: Path, before: Stamp | None, after: Stamp | None, is_kept: bool) -> str:
    """What became of one file, "" if it is not there or only left from an earlier render."""
    if after is None:
        return ""
    if after != before:
        return f"Rendered {name}"
    return f"Kept {name}, because the scene does not overwrite" if is_kept else ""


def _set_range(scene, frames: range):
    """Let `scene` animate over `frames`: a movie's name tells the scene's range, which begins at 0 at the earliest."""
    scene.frame_step = frames.step
    scene.frame_start = max(frames[0], 0)
    scene.frame_end = max(frames[-1], 0)


def _names(scene, frame: int) -> list[Path]:
    """Files that Blender may write for `frame`: the plain name, and that of each view where there are several.

    Which of them it writes is a matter of the format: two for stereo in single files, one for side by side.
    """
    render = scene.render
    views = ["", *(view.name for view in render.views if view.use)] if render.use_multiview else [""]
    try:
        return [Path(bpy.path.abspath(render.frame_path(frame=frame, view=view))) for view in views]
    except RuntimeError as error:  # a {variable} that is none
        words = str(error).strip().splitlines()[-1].lstrip("- ").rstrip(".")
        raise SceneError(f"{render.filepath} is no name for a picture ({words}): repair it and try again.") from error


def _still_names(scene) -> list[Path]:
    """Files that Blender may write for a still, whose name it does not number."""
    wanted = scene.render.filepath
    stem, ending = _split(wanted)
    try:
        scene.render.filepath = f"{stem}{_MARK}{ending}"
        names = _names(scene, 0)
    finally:
        scene.render.filepath = wanted
    return [name.with_name("".join(name.name.rsplit(_MARKED, 1))) for name in names]


def _stamps(names: Iterable[Path]) -> dict[Path, Stamp | None]:
    """What tells each file from one that was there before; None where there is none."""
    return {name: _stamp(name) for name in names}


def _stamp(name: Path) -> Stamp | None:
    if not name.is_file():
        return None
    status = name.stat()
    return status.st_ino, status.st_mtime_ns, status.st_size


def _set_format(scene, output: str, ending: str):
    """Let `scene` write what `ending` means; of its own format, such as layers in an .exr, nothing changes."""
    render = scene.render
    if ending in MOVIES:
        render.image_settings.media_type = "VIDEO"
        render.ffmpeg.format = MOVIES[ending]
    elif not render.is_movie_format and ending == render.file_extension:
        return
    elif ending in PICTURES:
        render.image_settings.media_type = "IMAGE"
        render.image_settings.file_format = PICTURES[ending]
    else:
        known = ", ".join(sorted([*PICTURES, *MOVIES]))
        raise SceneError(f"{output} does not end like a picture or movie: use one of {known}.")


def _absolute(output: str) -> str:
    """`output` from the root of the file system, `//` resolved; a slash at its end stays."""
    if not output:
        raise SceneError("The output has no name: give a file, or a folder that ends in a slash.")
    path = str(Path(bpy.path.abspath(output)).resolve())
    return path if _name(output) else f"{path.rstrip('/')}/"


def _name(path: str) -> str:
    """What follows the last slash."""
    return re.split(r"[\\/]" if os.name == "nt" else "/", path)[-1]


def _split(path: str) -> tuple[str, str]:
    """`path` without its ending, and that; digits of the frame (shot.####) and words such as .v2_ are no ending."""
    match = re.search(r"(?<=.)\.[A-Za-z]\w{0,4}$", _name(path))
    if match is None or match[0].endswith("_"):
        return path, ""
    return path.removesuffix(match[0]), match[0]
