"""Texture coordinates, sRGB and bilinear interpolation in numpy, as the issue and Cycles define them."""

from __future__ import annotations

import numpy as np


def spherical_uv(points, origin=(0.0, 0.0, 0.0), *, up="Y") -> np.ndarray:
    """(u, v) of points (..., 3) on a sphere around `origin`: n = normalized hit - origin, y up as written.

    up 'Z' turns Blender's z axis to y without mirroring: (x, y, z) -> (x, z, -y).
    """
    n = np.asarray(points, dtype=float) - origin
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    if up == "Z":
        n = np.stack([n[..., 0], n[..., 2], -n[..., 1]], axis=-1)
    return np.stack([np.arctan2(n[..., 0], n[..., 2]) / (2 * np.pi) + 0.5, n[..., 1] * 0.5 + 0.5], axis=-1)


def nearest(pixels, uv) -> np.ndarray:
    """The texel (height, width, c), row 0 at the bottom, under each (u, v), repeated."""
    height, width = pixels.shape[:2]
    column = np.floor(uv[..., 0] * width).astype(int) % width
    row = np.floor(uv[..., 1] * height).astype(int) % height
    return pixels[row, column]


def bilinear(pixels, uv) -> np.ndarray:
    """Bilinear interpolation of (height, width, c) at (u, v), repeated; texel centres at (i + 0.5) / size."""
    height, width = pixels.shape[:2]
    x, y = uv[..., 0] * width - 0.5, uv[..., 1] * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    s, t = (x - column)[..., None], (y - row)[..., None]
    lower = pixels[row % height, column % width] * (1 - s) + pixels[row % height, (column + 1) % width] * s
    upper = pixels[(row + 1) % height, column % width] * (1 - s) + pixels[(row + 1) % height, (column + 1) % width] * s
    return lower * (1 - t) + upper * t


def srgb_decoded(values) -> np.ndarray:
    """Linear light of sRGB-encoded values 0..1 (IEC 61966-2-1)."""
    values = np.asarray(values, dtype=float)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
