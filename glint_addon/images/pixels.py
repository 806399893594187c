"""Pixels of Blender's images, also of layered files, whose pixels Blender gives to its Image Editor alone."""

from __future__ import annotations

import bpy
import numpy as np

from ..errors import MapError
from .files import image_files, image_path, is_several, is_still


def image_pixels(image: bpy.types.Image) -> np.ndarray:
    """Pixels of a still image as Blender's Image Texture reads them, float32 (height, width, channels), row 0 at the
    bottom.

    Raises MapError if they cannot be read.
    """
    check_pixels(image)
    if is_layered(image):
        return layer_pixels(image)
    return read_pixels(image)


def read_pixels(image: bpy.types.Image) -> np.ndarray:
    """`image_pixels` of any image whose pixels Blender has, whatever it shows."""
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, image.channels)


def layer_pixels(image: bpy.types.Image) -> np.ndarray:
    """The layer that Cycles shows of a layered image, as it is stored: float32 (height, width, up to 4 channels).

    Raises MapError if the file is damaged.
    """
    from ..bake.layers import first_layer

    pixels = first_layer(image_path(image), _packed(image))
    # Cycles associates alpha of a packed file even if it is data, and not of other data.
    is_straight = image.alpha_mode == "STRAIGHT" and image.colorspace_settings.is_data
    if is_straight and image.packed_file is not None and pixels.shape[2] == 4:
        pixels[..., :3] *= pixels[..., 3:]
    return pixels


def image_shape(image: bpy.types.Image) -> tuple[int, int, int]:
    """(height, width, channels) of an image, of the largest tile or the first frame; (0, 0, 0) if it cannot be read."""
    if is_several(image):
        return _shape_of_several(image)
    if is_layered(image):
        from ..bake.layers import layer_shape  # OpenImageIO, which no other image needs

        return layer_shape(image_path(image), _packed(image))
    width, height = image.size
    return (height, width, image.channels) if width * height else (0, 0, 0)


def is_layered(image: bpy.types.Image) -> bool:
    """Whether `image` is an OpenEXR file of layers, whose size and pixels Blender gives only to its Image Editor."""
    # Ask for the type, which Blender knows after an attempt to read the file: only the type tells a damaged file.
    return 0 in image.size[:] and image.type == "MULTILAYER"


def check_pixels(image: bpy.types.Image):
    """Raise MapError for an image that cannot be a normal map: a movie, without colours, without or of one pixel.

    Reads no more of a layered file or a sequence than a header.
    """
    if not (is_still(image) or is_several(image)):
        raise MapError(f'Normal map "{image.name}" is a {image.source.lower()}: choose an image, a UDIM set or an '
                       "image sequence.")
    height, width, channels = image_shape(image)
    if 0 in (height, width):
        raise MapError(f'Normal map "{image.name}" has no pixels (missing or not an image): choose an image file.')
    if (height, width) == (1, 1):
        raise MapError(f'Normal map "{image.name}" is a single pixel and holds no glints: choose a larger image.')
    if channels >= 3:
        return
    if is_layered(image):
        raise MapError(f'Normal map "{image.name}" has no colours in its first layer: save the map as its own file.')
    raise MapError(f'Normal map "{image.name}" has no colour channels: choose an RGB normal map, not a height map.')


def _shape_of_several(image) -> tuple[int, int, int]:
    if image.source == "TILED":
        sizes = [tile.size for tile in image.tiles] or [(0, 0)]
        width, height = (max(size[axis] for size in sizes) for axis in (0, 1))
        return (height, width, image.channels) if width * height else (0, 0, 0)
    from ..bake.layers import layer_shape  # Blender itself knows only the size of a frame that an editor shows

    files = image_files(image)
    return layer_shape(files[0]) if files else (0, 0, 0)


def _packed(image) -> bytes | None:
    return image.packed_file.data if image.packed_file is not None else None
