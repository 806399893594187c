"""The glint table: a normal map as the OSL shader reads it, in one float image.

Layout (read by osl/table.h; a test compares the constants): an RGBA float32 OpenEXR file, both sides padded to powers
of two, because Cycles fetches exactly only at (i + 0.5) / 2^n.

* RGB of texel (i, j), row 0 at the bottom: the decoded tangent-space normal; (0, 0, 0) where the texel is no flake.
* Alpha: for Linear, the largest radius of the four bilinear patches that touch the texel (a patch lies between a texel
  and its right and upper neighbours; the map repeats), a patch's radius being the distance of its farthest corner from
  their mean. So one fetch in the middle of a patch, where Cycles interpolates, gives bounds of the patch: RGB is the
  mean of its corners, and alpha the mean of four numbers none of which is below its radius. For Closest, 0.
* Alpha of texel (0, 0) is MAGIC, by which the shader notices that Blender's Simplify setting shrank the table: the
  setting does so without a word. The patches that touch this texel, and those across the map's last column or row,
  whose corners are no neighbours in the file, have no bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from .float_image import PixelRows, is_whole, table_file_name, write_whole
from .progress import Steps

MAGIC = 7919.0  # far above any alpha of a map, so filtered alphas cannot be equal to it
VERSION = 3  # part of the content address: raise it when the layout changes


def padded_size(size: int) -> int:
    """Smallest power of two that is at least `size` (texels)."""
    return 1 << max(size - 1, 0).bit_length()


def patch_radii(normals: np.ndarray) -> np.ndarray:
    """Distance of each bilinear patch's farthest corner from the mean of the four: float32 (height, width)."""
    return _patch_radii(normals, 0, len(normals))


def _patch_radii(normals: np.ndarray, low: int, high: int) -> np.ndarray:
    """`patch_radii` of the rows low..high - 1; low may be -1, the last row."""
    width = normals.shape[1]
    strip = np.empty((3, high - low + 1, width + 1), np.float32)  # a plane a component: numpy is fast along rows
    strip[:, :, :-1] = np.moveaxis(normals.take(range(low, high + 1), axis=0, mode="wrap"), -1, 0)
    strip[:, :, -1] = strip[:, :, 0]
    corners = (strip[:, :-1, :-1], strip[:, :-1, 1:], strip[:, 1:, :-1], strip[:, 1:, 1:])
    centre = corners[0] + corners[1]
    centre += corners[2]
    centre += corners[3]
    centre *= np.float32(0.25)
    square = np.zeros(centre.shape[1:], np.float32)
    for corner in corners:
        offset = corner - centre
        offset *= offset
        np.maximum(square, offset[0] + offset[1] + offset[2], out=square)
    return np.sqrt(square, out=square)


def _texel_radii(normals: np.ndarray, low: int, high: int) -> np.ndarray:
    """Largest radius of the four patches that touch each texel of the rows low..high - 1: (high - low, width)."""
    patches = _patch_radii(normals, low - 1, high)
    pairs = np.maximum(patches[:-1], patches[1:])
    return np.maximum(pairs, np.roll(pairs, 1, axis=1))


def table_size(normals: np.ndarray) -> tuple[int, int]:
    """(width, height) of the table in texels; normals: (height, width, 3)."""
    height, width = normals.shape[:2]
    return padded_size(width), padded_size(height)


def table_rows(normals: np.ndarray, interpolation: str, low: int, high: int) -> np.ndarray:
    """Rows low..high - 1 of `table_pixels`."""
    height, width = normals.shape[:2]
    pixels = np.zeros((high - low, padded_size(width), 4), np.float32)
    last = min(high, height)
    if low < last:
        pixels[: last - low, :width, :3] = normals[low:last]
        if interpolation == "LINEAR":
            pixels[: last - low, :width, 3] = _texel_radii(normals, low, last)
    if low == 0:
        pixels[0, 0, 3] = MAGIC
    return pixels


def table_pixels(normals: np.ndarray, interpolation: str) -> np.ndarray:
    """Padded RGBA float32 pixels of the table, row 0 at the bottom; normals: (height, width, 3)."""
    return table_rows(normals, interpolation, 0, table_size(normals)[1])


def table_name(normals: np.ndarray, interpolation: str) -> str:
    """File name by content: the same normals give the same name on every machine."""
    return table_file_name(f"glint table {VERSION} {interpolation}", normals)


def bake_table(
    normals: np.ndarray, folder: Path, *, interpolation: str = "LINEAR", progress: Callable[[float], None] | None = None
) -> tuple[Path, bool]:
    """Write the table of `normals`, (height, width, 3) of `decoded_normals`, into `folder`, unless there and whole.

    progress: called often with the part of the work done, 0..1; an exception that it raises ends the bake.
    Returns its path and whether it was written now. The file appears whole or not at all.
    Raises TableError if the folder cannot be written to.
    """
    path = Path(folder) / table_name(normals, interpolation)
    if is_whole(path):
        return path, False
    width, height = table_size(normals)
    pixels = PixelRows((height, width, 4), lambda low, high: table_rows(normals, interpolation, low, high))
    write_whole(path, pixels, steps=Steps(progress, height))
    return path, True
