"""Numpy twin of osl/table.h. Arrays of any equal shape; normals (..., 3)."""

from __future__ import annotations

import numpy as np


def padded_size(size):
    """Smallest power of two that is at least `size` texels."""
    return 2.0 ** np.ceil(np.log2(np.maximum(size, 1.0)))


def wrapped(i, size):
    """`i` modulo `size`, in 0..size-1 for negative i too."""
    return np.mod(i, size)


def strengthened(n, strength):
    """The Normal Map node's Strength on decoded tangent-space normals (..., 3). Source: Cycles, node_normal_map.osl."""
    n = np.asarray(n, float)
    share = np.clip(strength, 0.0, 1.0)
    return np.stack([n[..., 0] * strength, n[..., 1] * strength, 1.0 + (n[..., 2] - 1.0) * share], axis=-1)


def strengthened_bounds(low, high, strength):
    """Slope bounds (..., 2) of a map whose slopes lie in low..high, at a strength."""
    if strength < 1.0:
        low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
    return np.minimum(strength * low, strength * high), np.maximum(strength * low, strength * high)


def table_texel(table, i, j):
    """RGB of texel (i, j) of a table's padded pixels (height, width, 4), row 0 at the bottom."""
    return table[j, i, :3]


def table_between(table, x, y):
    """RGB at (x, y) in texels, (i + 0.5, j + 0.5) the centre of texel (i, j), bilinear; all corners lie in the map."""
    i, j = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)
    a, b = (x - 0.5 - i)[..., None], (y - 0.5 - j)[..., None]
    n00, n10, n01, n11 = (table[j + dv, i + du, :3].astype(float) for dv in (0, 1) for du in (0, 1))
    return (1 - b) * ((1 - a) * n00 + a * n10) + b * ((1 - a) * n01 + a * n11)


def patch_has_bounds(width, height, i, j):
    """Whether `patch_bounds` holds for the bilinear patch at texel (i, j): inside the map, and not at texel (0, 0)."""
    return (i + 1 < width) & (j + 1 < height) & (i + j > 0)


def patch_bounds(table, i, j):
    """Centre (..., 3) and radius of the bilinear patch at texel (i, j), as interpolated in its middle."""
    corners = [table[j + dv, i + du].astype(float) for dv in (0, 1) for du in (0, 1)]
    middle = np.mean(corners, axis=0)
    return middle[..., :3], middle[..., 3]
