"""The image data-block of a normal map, used as it is."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ..errors import MapError
from .data_copies import is_data_copy
from .files import UDIM, image_path, udim_files
from .pixels import check_pixels


def normal_map_image(normal_map: str | Path | bpy.types.Image) -> bpy.types.Image:
    """The image data-block of a normal map given as path or image; "<UDIM>" in a path's name stands for all tiles.

    An image that is open already is never changed, whatever its colour space; `data_image` reads it as data. A file
    that is not open yet is opened as data.
    Raises MapError if it is missing, unreadable, a movie or a single pixel.
    """
    if not isinstance(normal_map, bpy.types.Image):
        return _opened(Path(bpy.path.abspath(str(normal_map))))
    check_pixels(normal_map)
    return normal_map


def _opened(path):
    is_set = UDIM in path.name
    files = udim_files(path) if is_set else [path] * path.is_file()
    if not files:
        raise MapError(f"Normal map {path} does not exist: choose an image file.")
    source = "TILED" if is_set else "FILE"
    for image in bpy.data.images:
        if image.source == source and _normal(image_path(image)) == _normal(path) and not is_data_copy(image):
            check_pixels(image)
            return image
    try:
        image = bpy.data.images.load(str(files[0]))
    except RuntimeError as error:
        raise MapError(f"Normal map {path} cannot be read ({error}): choose an image file.") from error
    try:
        if is_set:
            image.source = "TILED"  # Blender then looks for the other tiles
        check_pixels(image)
    except MapError:
        bpy.data.images.remove(image)
        raise
    # Let Blender find the colour space: configurations name it "Non-Color", "Raw" or otherwise.
    image.colorspace_settings.is_data = True
    return image


def _normal(path) -> str:
    return os.path.normcase(os.path.normpath(path))
