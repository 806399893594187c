"""Numpy twin of osl/slope_cells.h, one row for each sample. Bounds are found by trying many normals of a region."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from glint_addon.bake import slope_index as bake

from .constants import constants

NUMBERS = constants("slope_cells.h")
SIDE = int(NUMBERS["INDEX_SIDE"])
COLUMNS = int(NUMBERS["INDEX_COLUMNS"])
ROWS = int(NUMBERS["INDEX_ROWS"])
RECORD = int(NUMBERS["INDEX_RECORD"])
FIRST_PREFIX = int(NUMBERS["INDEX_FIRST_PREFIX"])
FIRST_ELEMENT = int(NUMBERS["INDEX_FIRST_ELEMENT"])
ANGLES = 2048  # around a region's rim: an extreme is found but for 2e-6 of the region


def index_texel(texels, texel):
    """Texels (n, 4) of the list (texels, 4)."""
    return texels[texel]


def map_index(width, height):
    """Blocks along u and v, and the shape of the file."""
    shape = np.array([bake.index_shape(int(w), int(h)) for w, h in zip(width, height, strict=True)])
    return SimpleNamespace(
        columns=np.array([bake.blocks(int(w)) for w in width]), rows=np.array([bake.blocks(int(h)) for h in height]),
        log_width=np.log2(shape[:, 0]), inverse_width=1.0 / shape[:, 0], inverse_height=1.0 / shape[:, 1],
    )


def block_start(i, size):
    """First texel of the block around texel i in the plane in which the map repeats, and the block's number."""
    repeat = np.floor_divide(i, size) * size
    place = (i - repeat) // SIDE
    return repeat + SIDE * place, place


def slope_basis(forms):
    """Vectors (n, 3, 3), g1, g2, g3 as rows, by which slopes p around a half vector are normals p1 g1 + p2 g2 + g3."""
    return np.linalg.inv(forms).transpose(0, 2, 1)


def rim(basis, c1, c2, radius):
    """Normals (n, angles, 3) on the rim of a region."""
    angle = np.arange(ANGLES) * (2 * np.pi / ANGLES)
    p1, p2 = (np.asarray(c)[:, None] + np.asarray(radius)[:, None] * f(angle) for c, f in ((c1, np.cos), (c2, np.sin)))
    return p1[..., None] * basis[:, None, 0] + p2[..., None] * basis[:, None, 1] + basis[:, None, 2]


def region_is_upright(basis, c1, c2, radius):
    """Whether all normals of a region lie above INDEX_HEIGHT, and by how much."""
    margin = rim(basis, c1, c2, radius)[..., 2].min(axis=1) - NUMBERS["INDEX_HEIGHT"]
    return margin > 0, margin


def region_bounds(middle, g1, g2, radius, axis):
    """Lowest and highest n[axis] / n.z in a region."""
    zero = np.zeros(len(middle))
    normals = rim(np.stack([g1, g2, middle], axis=1), zero, zero, radius)
    slopes = np.take_along_axis(normals, axis[:, None, None], axis=2)[..., 0] / normals[..., 2]
    return slopes.min(axis=1), slopes.max(axis=1)


def unscaled_bounds(strength, least_z, low, high):
    """Bounds of slopes x / z without Strength whose slopes with it lie between low and high, for z of least_z to 1."""
    share = np.clip(strength, 0.0, 1.0)
    slopes = []
    for part in np.linspace(0.0, 1.0, 9):
        # In 1 / z the ends of a range are extremes.
        z = 1.0 / (1.0 + part * (1.0 / least_z - 1.0))
        slopes += [with_strength * (1.0 + (z - 1.0) * share) / (strength * z) for with_strength in (low, high)]
    return np.min(slopes, axis=0), np.max(slopes, axis=0)


def record_of(texels, record):
    """Fields of the records (n,) that begin at texels `record` of the list (texels, 4)."""
    cells, extent = texels[record].astype(float), texels[record + 1].astype(float)
    return SimpleNamespace(
        low=cells[:, :2], scale=cells[:, 2:], least_z=extent[:, 1], listed=extent[:, 2], absent=extent[:, 0] - 1,
        is_intact=(extent[:, 3] == bake.MAGIC) & (extent[:, 0] > 0) & (extent[:, 1] > 0) & (cells[:, 2] > 0)
        & (extent[:, 2] == np.floor(extent[:, 2])),
    )


def block_cells(texels, strength, record, basis, c1, c2, radius):
    """The cells of a block that can contain slopes of a region, and whether rounding decides none of them. Where the
    record is not intact, no cell is meant."""
    own = record_of(texels, record)
    middle = c1[:, None] * basis[:, 0] + c2[:, None] * basis[:, 1] + basis[:, 2]
    found, is_clear = {}, np.ones(len(record), bool)
    for axis, count in ((0, COLUMNS), (1, ROWS)):
        low, high = region_bounds(middle, basis[:, 0], basis[:, 1], radius, np.full(len(record), axis))
        if not (strength == 1.0).all():
            bounds = unscaled_bounds(strength, np.maximum(own.least_z, 1e-30), low, high)
            low, high = np.where(strength == 1.0, (low, high), bounds)
        rounding = NUMBERS["INDEX_ROUNDING"]
        ends = ((low - own.low[:, axis]) * own.scale[:, axis] - rounding,
                (high - own.low[:, axis]) * own.scale[:, axis] + rounding)
        for name, place in zip(("from", "to"), ends, strict=True):
            found[f"{name}{axis + 1}"] = np.clip(place, 0, count - 1).astype(int)
            size = 1e-4 * (1 + own.scale[:, axis] * (np.abs(low) + np.abs(high)))
            is_clear &= (np.abs(place - np.round(place)) > size) | (place < -size) | (place > count - 1 + size)
    listed, absent = (np.where(own.is_intact, number, 0) for number in (own.listed, own.absent))
    return SimpleNamespace(**found, listed=listed, absent=absent, is_intact=own.is_intact), is_clear


def row_elements(texels, record, cells, row):
    """First element of the range's cells in one row of cells, and the element after them."""
    prefix = texels.reshape(-1)[4 * (record + FIRST_PREFIX)[:, None] + np.arange(COLUMNS * ROWS)].astype(int)
    prefix = np.concatenate([prefix, np.asarray(cells.listed, int)[:, None]], axis=1)
    start = np.take_along_axis(prefix, (row * COLUMNS + cells.from1)[:, None], axis=1)[:, 0]
    end = np.take_along_axis(prefix, (row * COLUMNS + cells.to1 + 1)[:, None], axis=1)[:, 0]
    return start, end
