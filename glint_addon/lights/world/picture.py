"""Pictures of worlds as linear light, without leaving them in memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...bake.openimageio import oiio, opened
from ...images import read_pixels

ROWS = 64  # of a file read at a time: to read all at once would take a picture's memory twice
RGB = ("R", "G", "B")


def linear_pixels(image: bpy.types.Image) -> np.ndarray | None:
    """Scene-linear pixels (height, width, 3 or more) of a still image, row 0 at the bottom; None if it has none.

    A file of linear floats that Blender has not loaded is read without Blender, which is faster: decision 54.
    """
    is_loaded = image.has_data
    pixels = None if is_loaded or image.packed_file else _pixels_of_file(image)
    if pixels is not None:
        return pixels
    if 0 in image.size[:]:  # loads it
        return None
    pixels, is_float = read_pixels(image), image.is_float
    if not is_loaded:
        image.buffers_free()
    if pixels.shape[2] < len(RGB):
        pixels = pixels[..., :1].repeat(len(RGB), axis=2)
    if not is_float and not image.colorspace_settings.is_data:
        # Blender gives bytes as they are stored: decode them as sRGB, whose curve is close to that of other displays.
        pixels = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
    return pixels


def _pixels_of_file(image: bpy.types.Image) -> np.ndarray | None:
    """The same pixels, float32, from a file of linear floats; None if the file is missing or holds other values."""
    path = Path(image.filepath_from_user())
    space = image.colorspace_settings
    if image.source != "FILE" or not (space.is_data or space.name.startswith("Linear")) or not path.is_file():
        return None
    with opened(path) as source:
        return _rows_of(source) if source is not None else None


def _rows_of(source: Any) -> np.ndarray | None:
    spec = source.spec()
    if spec.format not in (oiio.TypeFloat, oiio.TypeHalf) or tuple(spec.channelnames[:3]) != RGB or spec.tile_width:
        return None
    pixels = np.empty((spec.height, spec.width, len(RGB)), np.float32)
    for low in range(0, spec.height, ROWS):
        high = min(low + ROWS, spec.height)
        rows = source.read_scanlines(spec.y + low, spec.y + high, 0, 0, len(RGB), oiio.FLOAT)
        if rows is None:
            return None
        # Files begin at the top.
        pixels[spec.height - high:spec.height - low] = rows[::-1]
    return pixels
