"""Whether an image changed: one string for what it holds now."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

import bpy

from .pixels import image_path, read_pixels


def image_stamp(image: bpy.types.Image) -> str:
    """Changes whenever the file of `image` does; "" where that cannot be told (generated, packed or painted images)."""
    if image.source != "FILE" or image.packed_file or image.is_dirty:
        return ""
    path = image_path(image)
    try:
        state = path.stat()
    except OSError:
        return ""
    return f"{path.name}|{state.st_mtime_ns}|{state.st_size}"


def image_state(image: bpy.types.Image) -> str:
    """Changes whenever the values do that `image` holds as data; "" for a file that is missing.

    `image_stamp` of a clean file, whose colour space changes none of its values; else a digest, which reads all that is
    packed or painted.
    """
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
    """A digest of the file of `image`, the same wherever and whenever it was copied to; "" if it is no clean file."""
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


def _pixels_digest(image) -> str:
    # Blender keeps floats of a file decoded: the values the file would hold depend on how.
    space = image.colorspace_settings
    reading = "" if space.is_data or not image.is_float else f"{space.name}|{image.alpha_mode}"
    return f"pixels|{image.size[0]}x{image.size[1]}|{reading}|{_digest(read_pixels(image).data)}"


def _digest(data) -> str:
    return hashlib.sha256(data).hexdigest()[:32]
