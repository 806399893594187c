"""Pixels of a Blender image as Cycles stores them before it interpolates."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..bake.pyramid import srgb_encoded
from ..errors import MapError
from . import is_layered, layer_pixels, read_pixels
from .color_spaces import decoded_values, scene_linear

# Cycles keeps sRGB images encoded in memory if its working space has the same primaries.
SRGB = "sRGB"
SRGB_LINEAR = "Linear Rec.709"
# Sources whose pixels change during a render, or that consist of several images.
REFUSED_SOURCES = {
    "TILED": "is a UDIM image, which has no single mip pyramid",
    "MOVIE": "is a movie, whose pixels change with the frame",
    "SEQUENCE": "is an image sequence, whose pixels change with the frame",
    "VIEWER": "is a render result, which has no lasting pixels",
}


@dataclass(frozen=True)
class StoredImage:
    """pixels: (height, width, 4) float32, row 0 at the bottom; the flags are those of `bake.pyramid.bake_pyramid`."""

    pixels: np.ndarray
    encoded: bool
    associated: bool
    half: bool


def stored_image(image: bpy.types.Image) -> StoredImage:
    """`image` as Cycles holds it: alpha associated unless it is data, sRGB still encoded, other spaces scene-linear.

    Raises MapError for images without pixels, UDIM tiles, movies and sequences, and colour spaces that OpenColorIO
    cannot convert. Source: Cycles, scene/image_oiio.cpp, util/image_metadata.cpp, util/colorspace.cpp.
    """
    pixels = raw_pixels(image)
    is_data, is_float = image.colorspace_settings.is_data, _is_float(image)
    associated = not is_data and image.alpha_mode in ("STRAIGHT", "PREMUL")
    space = image.colorspace_settings.name
    is_linear = space in (bpy.data.colorspace.working_space, "scene_linear")
    encoded = space == SRGB and bpy.data.colorspace.working_space == SRGB_LINEAR and cycles_keeps_encoding(image)

    # Blender gives bytes as they are, with straight alpha, and floats in scene-linear light, with associated alpha.
    if not is_float:
        if not (is_data or encoded or is_linear):
            pixels[..., :3] = scene_linear(pixels[..., :3], space, image.name)
        if associated:
            pixels[..., :3] *= pixels[..., 3:]
            if encoded or is_linear:
                # Cycles multiplies bytes and drops the fraction; a hundredth of a step absorbs float32 rounding.
                pixels[..., :3] = np.floor(pixels[..., :3] * 255 + np.float32(0.01)) / np.float32(255)
    elif encoded:
        alpha = np.where(associated & (pixels[..., 3:] != 0), pixels[..., 3:], np.float32(1))
        pixels[..., :3] = srgb_encoded(pixels[..., :3] / alpha) * alpha
    half = not is_float and (is_data or encoded)
    return StoredImage(pixels, encoded, associated, half)


def raw_pixels(image: bpy.types.Image) -> np.ndarray:
    """`image.pixels` as (height, width, 4) float32, row 0 at the bottom. Raises MapError (see `stored_image`)."""
    if image.source in REFUSED_SOURCES:
        raise MapError(f'Image "{image.name}" {REFUSED_SOURCES[image.source]}: use the Bilinear filter.')
    # Of a layered file Blender gives no pixels, and Cycles shows the first layer.
    if is_layered(image):
        pixels = _four_channels(layer_pixels(image))
        return pixels if image.colorspace_settings.is_data else decoded_values(pixels, image)
    width, height = image.size
    if width * height == 0 or len(image.pixels) != width * height * image.channels:
        raise MapError(f'Image "{image.name}" has no pixels: check its path and reload it.')
    return _four_channels(read_pixels(image))


def _four_channels(values):
    height, width, channels = values.shape
    if channels == 4:
        return values
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = values[..., :3] if channels == 3 else values[..., :1]
    if channels == 2:
        pixels[..., 3] = values[..., 1]
    return pixels


def cycles_keeps_encoding(image: bpy.types.Image) -> bool:
    """Whether Cycles interpolates an sRGB `image` before decoding: bytes, and any file it reads by itself."""
    from_file = image.source == "FILE" and image.packed_file is None and not image.is_dirty
    return not _is_float(image) or from_file


def _is_float(image) -> bool:
    """Whether an image holds floats: layered files do, though Blender does not load them and does not say so."""
    return image.is_float or is_layered(image)
