"""The image data-block of a normal map, used as it is."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ..errors import MapError
from .data_copies import is_data_copy
from .pixels import check_pixels, image_path


def normal_map_image(normal_map: str | Path | bpy.types.Image) -> bpy.types.Image:
    """The image data-block of a normal map given as path or image.

    An image that is open already is never changed, whatever its colour space; `data_image` reads it as data. A file
    that is not open yet is opened as data.
    Raises MapError if it is missing, unreadable, tiled, moving or a single pixel.
    """
    if not isinstance(normal_map, bpy.types.Image):
        return _opened(Path(bpy.path.abspath(str(normal_map))))
    check_pixels(normal_map)
    return normal_map


def _opened(path):
    if not path.is_file():
        raise MapError(f"Normal map {path} does not exist: choose an image file.")
    for image in bpy.data.images:
        if image.source == "FILE" and _normal(image_path(image)) == _normal(path) and not is_data_copy(image):
            check_pixels(image)
            return image
    try:
        image = bpy.data.images.load(str(path))
    except RuntimeError as error:
        raise MapError(f"Normal map {path} cannot be read ({error}): choose an image file.") from error
    try:
        check_pixels(image)
    except MapError:
        bpy.data.images.remove(image)
        raise
    # Let Blender find the colour space: configurations name it "Non-Color", "Raw" or otherwise.
    image.colorspace_settings.is_data = True
    return image


def _normal(path) -> str:
    return os.path.normcase(os.path.normpath(path))
