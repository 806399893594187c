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
from pathlib import Path

import numpy as np

from .float_image import write_whole

MAGIC = 7919.0  # any number that no filtered alpha can reach by accident
VERSION = 2  # part of the content address: raise it when the layout changes
SUFFIX = ".exr"


def padded_size(size: int) -> int:
    """Smallest power of two that is at least `size` (texels)."""
    return 1 << max(size - 1, 0).bit_length()


def patch_bounds(normals: np.ndarray) -> np.ndarray:
    """Centre (RGB) and radius (A) of a ball that holds each bilinear patch's normals: (height, width, 4) float32."""
    right = np.roll(normals, -1, axis=1)
    corners = (normals, right, np.roll(normals, -1, axis=0), np.roll(right, -1, axis=0))
    bounds = np.empty((*normals.shape[:2], 4), np.float32)
    centre = bounds[..., :3]
    centre[:] = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3])
    square = np.zeros(normals.shape[:2], np.float32)
    for corner in corners:
        offset = corner - centre
        np.maximum(square, np.einsum("hwc,hwc->hw", offset, offset), out=square)
    bounds[..., 3] = np.sqrt(square)
    return bounds


def table_pixels(normals: np.ndarray, interpolation: str) -> np.ndarray:
    """Padded RGBA float32 pixels of the table, row 0 at the bottom; normals: (height, width, 3)."""
    height, width = normals.shape[:2]
    layers = 2 if interpolation == "LINEAR" else 1
    rows = padded_size(height)
    pixels = np.zeros((layers * rows, padded_size(width), 4), np.float32)
    pixels[:height, :width, :3] = normals
    pixels[0, 0, 3] = MAGIC
    if layers == 2:
        pixels[rows : rows + height, :width] = patch_bounds(normals)
    return pixels


def table_name(normals: np.ndarray, interpolation: str) -> str:
    """File name by content: the same normals give the same name on every machine."""
    digest = hashlib.sha256(f"glint table {VERSION} {interpolation} {normals.shape}".encode())
    digest.update(np.ascontiguousarray(normals, dtype=np.float32).data)
    return f"glint_{digest.hexdigest()[:24]}{SUFFIX}"


def bake_table(normals: np.ndarray, folder: Path, *, interpolation: str = "LINEAR") -> tuple[Path, bool]:
    """Write the table of `normals`, (height, width, 3) of `decoded_normals`, into `folder`, unless it is there already.

    Returns its path and whether it was written now. The file appears whole or not at all.
    Raises TableError if the folder cannot be written to.
    """
    path = Path(folder) / table_name(normals, interpolation)
    if path.is_file() and path.stat().st_size > 0:
        return path, False
    write_whole(path, table_pixels(normals, interpolation))
    return path, True
