"""The image data-blocks of a normal map and of its flakes, used as they are."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import bpy

from ..errors import MapError
from .data_copies import is_data_copy
from .files import UDIM, image_path, is_still, udim_files
from .pixels import check_pixels, image_shape


def normal_map_image(normal_map: str | Path | bpy.types.Image) -> bpy.types.Image:
    """The image data-block of a normal map given as path or image; "<UDIM>" in a path's name stands for all tiles.

    An image that is open already is never changed, whatever its colour space; `data_image` reads it as data. A file
    that is not open yet is opened as data.
    Raises MapError if it is missing, unreadable, a movie or a single pixel.
    """
    return _image(normal_map, "Normal map", check_pixels, is_data=True)


def presence_image(presence: str | Path | bpy.types.Image) -> bpy.types.Image:
    """The image data-block that says which texels are flakes, given and opened as a normal map.

    Raises MapError if it is missing, unreadable or no single picture.
    """
    return _image(presence, "Presence image", _check_still, is_data=True)


def flake_color_image(color: str | Path | bpy.types.Image) -> bpy.types.Image:
    """The image data-block with the colours of flakes; a file that is not open yet is opened in its own colour space.

    Raises MapError as `presence_image`.
    """
    return _image(color, "Flake color image", _check_still, is_data=False)


def _image(given, what: str, check: Callable[[bpy.types.Image], None], *, is_data: bool) -> bpy.types.Image:
    if not isinstance(given, bpy.types.Image):
        return _opened(Path(bpy.path.abspath(str(given))), what, check, is_data=is_data)
    check(given)
    return given


def _check_still(image: bpy.types.Image):
    """Raise MapError for an image of flakes that is no single picture, or without pixels."""
    if not is_still(image):
        raise MapError(f'Image "{image.name}" is a {image.source.lower()}: choose a single picture for flakes.')
    if 0 in image_shape(image)[:2]:
        raise MapError(f'Image "{image.name}" has no pixels (missing or not an image): choose an image file.')


def _opened(path, what, check, *, is_data):
    is_set = UDIM in path.name
    files = udim_files(path) if is_set else [path] * path.is_file()
    if not files:
        raise MapError(f"{what} {path} does not exist: choose an image file.")
    source = "TILED" if is_set else "FILE"
    for image in bpy.data.images:
        if image.source == source and _normal(image_path(image)) == _normal(path) and not is_data_copy(image):
            check(image)
            return image
    try:
        image = bpy.data.images.load(str(files[0]))
    except RuntimeError as error:
        raise MapError(f"{what} {path} cannot be read ({error}): choose an image file.") from error
    try:
        if is_set:
            image.source = "TILED"  # Blender then looks for the other tiles
        check(image)
    except MapError:
        bpy.data.images.remove(image)
        raise
    if is_data:
        # Let Blender find the colour space: configurations name it "Non-Color", "Raw" or otherwise.
        image.colorspace_settings.is_data = True
    return image


def _normal(path) -> str:
    return os.path.normcase(os.path.normpath(path))
