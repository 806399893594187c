"""The glint table: a normal map as the OSL shader reads it, in one float image.

Layout (read by osl/table.h; a test compares the constants): an RGBA float32 OpenEXR file of one layer (Closest) or two
(Linear), one above the other; both sides are padded to powers of two, because Cycles fetches exactly only at
(i + 0.5) / 2^n.

* Layer 0, RGB of texel (i, j), row 0 at the bottom: the decoded tangent-space normal. Alpha is 0 except in texel
  (0, 0), where it is MAGIC: Blender's Simplify setting shrinks data textures without a word; the shader must notice.
* Layer 1: the bilinear patch between texel (i, j) and its right and upper neighbours (the map repeats). RGB is the mean
  of its four corners, alpha the distance to the farthest corner: one fetch tells whether a patch can matter.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .float_image import PixelRows, write_whole
from .progress import Steps

MAGIC = 7919.0  # any number that no filtered alpha can reach by accident
VERSION = 2  # part of the content address: raise it when the layout changes
SUFFIX = ".exr"


def padded_size(size: int) -> int:
    """Smallest power of two that is at least `size` (texels)."""
    return 1 << max(size - 1, 0).bit_length()


def patch_bounds(normals: np.ndarray) -> np.ndarray:
    """Centre (RGB) and radius (A) of a ball that holds each bilinear patch's normals: (height, width, 4) float32."""
    return _bounds(normals, 0, len(normals))


def _bounds(normals, low, high):
    """`patch_bounds` of the rows low..high - 1."""
    width = normals.shape[1]
    strip = np.empty((3, high - low + 1, width + 1), np.float32)  # a plane a component: numpy is fast along rows
    strip[:, :-1, :-1] = np.moveaxis(normals[low:high], -1, 0)
    strip[:, -1, :-1] = normals[high % len(normals)].T
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
    bounds = np.empty((high - low, width, 4), np.float32)
    bounds[..., :3] = np.moveaxis(centre, 0, -1)
    np.sqrt(square, out=bounds[..., 3])
    return bounds


def table_size(normals: np.ndarray, interpolation: str) -> tuple[int, int]:
    """(width, height) of the table in texels; normals: (height, width, 3)."""
    height, width = normals.shape[:2]
    return padded_size(width), (2 if interpolation == "LINEAR" else 1) * padded_size(height)


def table_rows(normals: np.ndarray, interpolation: str, low: int, high: int) -> np.ndarray:
    """Rows low..high - 1 of `table_pixels`."""
    height, width = normals.shape[:2]
    columns, rows = table_size(normals, interpolation)
    pixels = np.zeros((high - low, columns, 4), np.float32)
    for layer in range(rows // padded_size(height)):
        # Row of the table where this layer begins, and the layer's rows among those asked for.
        base = layer * padded_size(height)
        first, last = max(low - base, 0), min(high - base, height)
        if first < last:
            part = pixels[first + base - low : last + base - low, :width]
            if layer == 0:
                part[..., :3] = normals[first:last]
            else:
                part[:] = _bounds(normals, first, last)
    if low == 0:
        pixels[0, 0, 3] = MAGIC
    return pixels


def table_pixels(normals: np.ndarray, interpolation: str) -> np.ndarray:
    """Padded RGBA float32 pixels of the table, row 0 at the bottom; normals: (height, width, 3)."""
    return table_rows(normals, interpolation, 0, table_size(normals, interpolation)[1])


def table_name(normals: np.ndarray, interpolation: str) -> str:
    """File name by content: the same normals give the same name on every machine."""
    digest = hashlib.sha256(f"glint table {VERSION} {interpolation} {normals.shape}".encode())
    digest.update(np.ascontiguousarray(normals, dtype=np.float32).data)
    return f"glint_{digest.hexdigest()[:24]}{SUFFIX}"


def bake_table(
    normals: np.ndarray, folder: Path, *, interpolation: str = "LINEAR", progress: Callable[[float], None] | None = None
) -> tuple[Path, bool]:
    """Write the table of `normals`, (height, width, 3) of `decoded_normals`, into `folder`, unless it is there already.

    progress: called with the part that is done, 0..1, often; what it raises ends the bake.
    Returns its path and whether it was written now. The file appears whole or not at all.
    Raises TableError if the folder cannot be written to.
    """
    path = Path(folder) / table_name(normals, interpolation)
    if path.is_file() and path.stat().st_size > 0:
        return path, False
    width, height = table_size(normals, interpolation)
    pixels = PixelRows((height, width, 4), lambda low, high: table_rows(normals, interpolation, low, high))
    write_whole(path, pixels, steps=Steps(progress, height))
    return path, True
