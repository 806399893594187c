"""Numpy twin of osl/tiles.h and glint_addon/nodes/tiles.py: which cut of the map each tile shows."""

from __future__ import annotations

import numpy as np

PRIME = 4093


def stirred(t):
    """t^5 modulo PRIME, of whole numbers 0..PRIME - 1."""
    return np.asarray(t, np.int64) ** 5 % PRIME


def tile_cut(tile, size):
    """Texels (n, 2) by which tiles (n, 2) move a map of `size` (width, height)."""
    u, v = np.moveaxis(np.asarray(tile, np.int64) % PRIME, -1, 0)
    column = stirred((u + 1013) % PRIME)
    inner = stirred((column + v) % PRIME)
    first = stirred((inner + 3 * u + 499) % PRIME)
    second = stirred((first + column + 1) % PRIME)
    # In the shader's own arithmetic, or the last texel would differ here and there.
    share = np.asarray(size, np.float32) / np.float32(PRIME)
    return np.floor(np.stack([first, second], axis=-1).astype(np.float32) * share).astype(np.int64)


def shuffled(texels, tiles, first=(0, 0)):
    """What (columns, rows) tiles from `first` on show of an image (height, width, channels), written out as one image;
    row 0 is v = 0."""
    height, width = texels.shape[:2]
    columns, rows = tiles
    number = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1) + first
    cuts = tile_cut(number.reshape(-1, 2), (width, height)).reshape(rows, columns, 2)
    return np.block([[[np.roll(texels, (-cuts[row, column, 1], -cuts[row, column, 0]), axis=(0, 1))]
                      for column in range(columns)] for row in range(rows)])
