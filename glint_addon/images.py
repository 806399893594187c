"""Image data-blocks as arrays and as normal map textures, with one clear sentence for what cannot be used."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from .errors import MapError

USABLE_SOURCES = ("FILE", "GENERATED")


def normal_map_image(normal_map: str | Path | bpy.types.Image) -> bpy.types.Image:
    """The image data-block of a normal map given as path or image, read as data (Non-Color).

    An image that is shown as colour elsewhere is not touched: a copy "<name> (Non-Color)" is used instead.
    Raises MapError if it is missing, unreadable, tiled, moving or a single pixel.
    """
    image = normal_map if isinstance(normal_map, bpy.types.Image) else _loaded(normal_map)
    _check(image)
    if image.colorspace_settings.is_data:
        return image
    return _as_data(image)


def image_pixels(image: bpy.types.Image) -> np.ndarray:
    """Pixels of an image as Blender's Image Texture reads them, float32 (height, width, channels), row 0 at the bottom.

    Raises MapError if they cannot be read.
    """
    _check(image)
    return read_pixels(image)


def read_pixels(image: bpy.types.Image) -> np.ndarray:
    """`image_pixels` of any image that has pixels, whatever it shows."""
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, image.channels)


def image_stamp(image: bpy.types.Image) -> str:
    """Changes whenever the file of `image` does; "" where that cannot be told (generated, packed or painted images)."""
    if image.source != "FILE" or image.packed_file or image.is_dirty:
        return ""
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    try:
        state = path.stat()
    except OSError:
        return ""
    return f"{path}|{state.st_mtime_ns}|{state.st_size}"


def _loaded(path) -> bpy.types.Image:
    path = Path(bpy.path.abspath(str(path)))
    if not path.is_file():
        raise MapError(f"Normal map {path} does not exist: choose an image file.")
    before = set(bpy.data.images)
    try:
        image = bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError as error:
        raise MapError(f"Normal map {path} cannot be read ({error}): choose an image file.") from error
    if image in before:
        return image
    try:
        _check(image)
    except MapError:
        bpy.data.images.remove(image)
        raise
    image.colorspace_settings.name = "Non-Color"
    return image


def _check(image):
    if image.source == "TILED":
        raise MapError(f'Normal map "{image.name}" is a UDIM set: use one material and one image for each tile.')
    if image.source not in USABLE_SOURCES:
        raise MapError(f'Normal map "{image.name}" is a {image.source.lower()}: choose a still image.')
    if 0 in image.size[:]:
        raise MapError(f'Normal map "{image.name}" has no pixels (missing or not an image): choose an image file.')
    if tuple(image.size) == (1, 1):
        raise MapError(f'Normal map "{image.name}" is a single pixel and holds no glints: choose a larger image.')
    if image.channels < 3:
        raise MapError(f'Normal map "{image.name}" has no colour channels: choose an RGB normal map, not a height map.')


def _as_data(image):
    """A copy of `image` read as data; the pixels of generated and painted images, which no file holds, are packed."""
    name = f"{image.name} (Non-Color)"
    is_unsaved = image.source == "GENERATED" or image.is_dirty
    copy = bpy.data.images.get((name, None))
    if is_unsaved or copy is None or copy.filepath != image.filepath or copy.is_dirty:
        pixels = image_pixels(image)
        copy = image.copy()
        copy.name = name
        copy.colorspace_settings.name = "Non-Color"
        if is_unsaved:
            copy.pixels.foreach_set(pixels.ravel())
            copy.pack()
    return copy
