"""Numpy twin of osl/flakes.h: parts and mean colours by the definition, from the map's own texels, one row a sample."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from glint_addon.bake import flakes as bake

from .constants import constants

NUMBERS = constants("flakes.h")
SIDE = NUMBERS["COVERAGE_SIDE"]
TAPS = int(NUMBERS["COVERAGE_TAPS"])
LEAST_PART = 1e-6  # weight of the colour of a block without flakes


def flakes_regions(size):
    """Regions along `size` texels (n,)."""
    return np.array([bake.regions(int(n)) for n in size])


def level_blocks(size, level):
    """Blocks of 2^level texels along `size` texels."""
    return np.ceil(size / 2.0**level).astype(int)


def texels_before_level(width, height, has_colors, level):
    """Texels of the list before each level (n,)."""
    regions = flakes_regions(width) * flakes_regions(height) * bake.BINS**2
    texels = np.where(has_colors, regions, 0)
    for finer in range(level.max()):
        is_stored = (finer < level) & ((finer > 0) | (has_colors != 0))
        texels += np.where(is_stored, level_blocks(width, finer) * level_blocks(height, finer), 0)
    return texels


def lay_flakes(width, height, has_colors):
    """The levels, and the shape of the file, of maps."""
    shape = np.array([
        bake.list_shape(bake.table_texels(int(w), int(h), bool(c))) for w, h, c in zip(width, height, has_colors,
                                                                                       strict=True)])
    levels = np.array([bake.level_count(int(w), int(h)) for w, h in zip(width, height, strict=True)])
    return SimpleNamespace(levels=levels, log_width=np.log2(shape[:, 0]), inverse_width=1.0 / shape[:, 0],
                           inverse_height=1.0 / shape[:, 1])


def flakes_texel(texels, texel):
    """Texels (n, 4) of the list (texels, 4)."""
    return texels[texel]


def flake_color(colors, i, j):
    """Colours (n, 3) of the flakes at texels (i, j) of an image (height, width, 3)."""
    return colors[j, i]


def coverage_level(long, short, levels):
    """Level and number of blocks for footprints of these semi-axes, and whether rounding decides neither."""
    along = SIDE * long
    exact = np.log2(np.maximum(np.maximum(SIDE * short, along / TAPS), 1.0))
    level = np.clip(np.floor(exact + 0.5), 0, levels).astype(int)
    wanted = along / 2.0**level
    is_clear = np.minimum(*(np.abs(value - np.floor(value) - 0.5) for value in (exact, wanted))) > 1e-4
    return level, np.clip(np.floor(wanted + 0.5), 1, TAPS).astype(int), is_clear


def long_axis(axes):
    """Long semi-axes (n, 2) in texels of footprints with the half axes (n, 2, 2); either direction."""
    turns, sizes, _ = np.linalg.svd(axes)
    return turns[:, :, 0] * sizes[:, :1]


def block_of(level, i, j, size):
    """Slices of the texels of the block around texel (i, j)."""
    side = 2**level
    low, first = j // side * side, i // side * side
    return np.s_[low : min(low + side, size[1]), first : min(first + side, size[0])]


def flakes_around(presence, colors, hit, axes, levels):
    """Coverage (n,) and mean colour (n, 3) around hit points (n, 2) in texels, and whether rounding decides no block.

    presence: bool (height, width); colors: (height, width, 3). Where no block has a flake, the colour is not meant.
    """
    size = presence.shape[::-1]
    long = long_axis(axes)
    lengths = np.linalg.svd(axes, compute_uv=False)
    level, taps, is_clear = coverage_level(lengths[:, 0], lengths[:, 1], levels)
    coverage, mean = np.zeros(len(hit)), np.full((len(hit), 3), np.nan)
    for row in range(len(hit)):
        places = SIDE * ((np.arange(taps[row]) + 0.5) / taps[row] - 0.5)
        points = hit[row] + places[:, None] * long[row]
        is_clear[row] &= (np.abs(points - np.round(points)) > 1e-3).all()
        parts, sums = [], np.zeros(3)
        for i, j in np.floor(points).astype(int) % size:
            block = block_of(level[row], i, j, size)
            parts.append(presence[block].mean())
            if presence[block].any():
                sums += parts[-1] * colors[block][presence[block]].mean(axis=0)
        coverage[row] = np.mean(parts)
        if coverage[row] > 0:
            mean[row] = sums / np.sum(parts) if level[row] > 0 else 1.0
    return coverage, mean, is_clear, level


def merged_color(normals, colors, box, mean, hit, slope):
    """Colours (n, 3) of the flakes of the slopes (n, 2) in 0..1 of the box, at hit points (n, 2) in texels.

    mean: (n, 3), around these.
    """
    height, width = normals.shape[:2]
    present = normals.any(axis=-1)
    rows, columns = np.indices(present.shape)
    regions = np.array([bake.regions(width), bake.regions(height)])
    own = np.floor(np.stack([columns * regions[0] / width, rows * regions[1] / height], axis=-1))
    with np.errstate(invalid="ignore", divide="ignore"):
        place = (normals[..., :2] / normals[..., 2:] - box[0]) / (box[1] - box[0]) * bake.BINS
    is_counted = present & (normals[..., 2] > 0) & ((place >= 0) & (place < bake.BINS)).all(axis=-1)
    bins = np.floor(np.where(is_counted[..., None], place, -1))
    shown = np.empty((len(hit), 3))
    for row in range(len(hit)):
        i, j = np.floor(hit[row]).astype(int) % (width, height)
        region = present & (own == own[j, i]).all(axis=-1)
        wanted = np.clip(np.floor(slope[row] * bake.BINS), 0, bake.BINS - 1)
        side, alike = 1, np.zeros_like(present)
        while not alike.any() and side <= bake.BINS:
            alike = region & is_counted & (bins // side == wanted // side).all(axis=-1)
            side *= 2
        ratio = colors[alike].mean(axis=0) / colors[region].mean(axis=0) if alike.any() else 1.0
        shown[row] = mean[row] * ratio
    return shown
