"""Whether an image changed: a string that is the same as long as the pixels are."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

import bpy

from .files import image_files, image_path, is_several
from .pixels import read_pixels


def image_stamp(image: bpy.types.Image) -> str:
    """A string that changes with the file of `image`; "" if it has no clean file (generated, packed or painted)."""
    if image.source != "FILE" or image.packed_file or image.is_dirty:
        return ""
    return _stamp(image_path(image))


def image_state(image: bpy.types.Image) -> str:
    """A string that changes with the values that `image` holds as data; "" for a missing file.

    It is `image_stamp` for a clean file whose colour space changes no values, else a digest, which reads all packed or
    painted pixels. Of a UDIM set or a sequence, which Blender alone reads, it follows the files for a copy's sake; as
    data they are what they are.
    """
    if is_several(image):
        return _state_of_several(image)
    if is_unsaved(image):
        return _pixels_digest(image)
    if image.packed_file is not None:
        return f"packed|{_digest(image.packed_file.data)}"
    return image_stamp(image)


class ImageStates(dict):
    """{image: its `image_state`}, told at the first question: painted and packed images are slow to tell."""

    def __missing__(self, image: bpy.types.Image) -> str:
        state = self[image] = image_state(image)
        return state


def file_digest(image: bpy.types.Image) -> str:
    """A digest of the file of `image`, which is the same for copies of the file; "" if the image has no clean file."""
    stamp = image_stamp(image)
    return _file_digest(image_path(image), stamp) if stamp else ""


@lru_cache(maxsize=256)
def _file_digest(path: Path, _stamp: str) -> str:
    try:
        return _digest(path.read_bytes())
    except OSError:  # gone since its stamp was taken
        return ""


def is_unsaved(image: bpy.types.Image) -> bool:
    """Whether only Blender's memory holds the pixels: neither a file nor packed data does."""
    return image.source == "GENERATED" or image.is_dirty


def is_in_memory(image: bpy.types.Image) -> bool:
    """Whether files do not hold all of a UDIM set or an image sequence: it is painted, packed or generated."""
    return image.is_dirty or len(image.packed_files) > 0 or not image.filepath


def _state_of_several(image) -> str:
    if is_in_memory(image):
        return image.source
    files = image_files(image)
    if image.colorspace_settings.is_data or not files:
        return image.source if files else ""
    return f"{image.source}|{_digest(' '.join(map(_stamp, files)).encode())}"


def _stamp(path) -> str:
    """A string that changes with a file; "" if it is not to be had."""
    try:
        state = path.stat()
    except OSError:
        return ""
    return f"{path.name}|{state.st_mtime_ns}|{state.st_size}"


def _pixels_digest(image) -> str:
    # Blender keeps floats of a file decoded: the values in the file depend on the colour space they were decoded from.
    space = image.colorspace_settings
    reading = "" if space.is_data or not image.is_float else f"{space.name}|{image.alpha_mode}"
    return f"pixels|{image.size[0]}x{image.size[1]}|{reading}|{_digest(read_pixels(image).data)}"


def _digest(data) -> str:
    return hashlib.sha256(data).hexdigest()[:32]
