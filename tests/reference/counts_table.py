"""Numpy twin of osl/counts_table.h, one row for each sample. What the baker knows is asked of the baker."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from glint_addon.bake import counts as bake
from glint_addon.bake.float_image import list_shape

from .constants import constants

NUMBERS = constants("counts_table.h")


def interpolation(is_linear) -> str:
    """The baker's word."""
    return "LINEAR" if is_linear else "CLOSEST"


def level_corners(block, is_linear):
    """Corners along one side of a level's table."""
    return np.array([bake.corners(int(b), interpolation(f)) for b, f in zip(block, is_linear, strict=True)])


def level_groups(size, block):
    """Groups of blocks of side `block` along `size` texels."""
    return np.array([bake.groups(int(s), int(b)) for s, b in zip(size, block, strict=True)])


def sides_before(first, block):
    """Sides of the blocks of all levels from `first` on that are smaller than `block`."""
    return [int(first) << k for k in range(30) if int(first) << k < block]


def texels_before(counts, block, width, height, is_linear):
    """Texels of all levels before the level with blocks of side `block`."""
    rows = zip(counts.first, block, width, height, is_linear, strict=True)
    return np.array([
        sum(bake.level_texels(int(w), int(h), side, interpolation(linear)) for side in sides_before(first, b))
        for first, b, w, h, linear in rows
    ])


def counts_level(counts, block, width, height, is_linear):
    """The level with blocks of side `block`."""
    rows = list(zip(width.tolist(), height.tolist(), block.tolist(), strict=True))
    # The header is one texel more.
    texels = texels_before(counts, counts.first << counts.levels, width, height, is_linear) + 1
    shape = np.array([list_shape(int(number)) for number in texels])
    columns, group_rows = level_groups(width, block), level_groups(height, block)
    return SimpleNamespace(
        block=block, corners=level_corners(block, is_linear), columns=columns, rows=group_rows,
        first=texels_before(counts, block, width, height, is_linear),
        group_u=width / columns, group_v=height / group_rows,
        unit=np.array([bake.packed_unit(*row) for row in rows]), log_width=np.log2(shape[:, 0]),
        inverse_width=1.0 / shape[:, 0], inverse_height=1.0 / shape[:, 1],
    )


def counts_texel(texels, texel):
    """Texels (n, 4) of the list (texels, 4)."""
    return texels[texel]


def counts_are_intact(counts, texels):
    """Whether a list of texels, or None of a file that is missing, ends with the header of `counts`."""
    header = np.zeros(3) if texels is None else texels[-1, :3]
    return (header[0] == bake.MAGIC) & (header[1] == counts.first) & (header[2] == counts.levels)


def far_block(counts, axes, short_axis, widest):
    """Side of the blocks to read for footprints with half axes (n, 2, 2); 0: the smallest is too wide."""
    block = counts.first.copy()
    largest = counts.first << (counts.levels - 1)
    sides = 2 * np.linalg.norm(axes, axis=2)  # along u and v
    known = (block > 0) & (block <= widest * short_axis)
    for _ in range(int(counts.levels.max())):
        wider = 2 * block
        groups = (sides / np.maximum(wider, 1)[:, None] + 1).prod(axis=1)
        is_small = wider <= NUMBERS["FAR_SIDE"] * short_axis
        is_crowded = (wider <= NUMBERS["FAR_SIDE_LONG"] * short_axis) & (groups > NUMBERS["FAR_GROUPS"])
        block = np.where((block < largest) & (is_small | is_crowded), wider, block)
    return np.where(known, block, 0)
