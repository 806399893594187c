"""Numpy twin of osl/counts_cells.h, one row for each sample. Structs are namespaces of arrays; of the bins along both
slopes are arrays (n, 2), and of the maps between bins and slopes (n, 2, 2)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from . import counts_table
from .constants import constants

NUMBERS = constants("counts_cells.h") | constants("counts.h")
TABLE = constants("counts_table.h")
REGION = constants("light_hint.h")["REGION"]
STEP = 1e-30  # of a derivative along the imaginary axis, which loses no digits


def away(values, size=1.0, margin=2e-4):
    """Whether numbers (n, ...) are so far from whole ones that float32 rounds none of a row across."""
    clear = np.abs(values - np.round(values)) > margin * np.maximum(size, 1.0)
    return clear.reshape(len(clear), -1).all(axis=1)


def normal_of(forms, p):
    """Normals (n, 3) of the slopes p (n, 2) around half vectors with these forms."""
    return np.linalg.solve(forms, np.append(p, np.ones((len(p), 1)), axis=1)[..., None])[..., 0]


def bins_of(forms, gain, bins, low, p):
    """Bin coordinates (n, 2) of the slopes p around half vectors."""
    n = normal_of(forms, p)
    return (n[:, :2] / n[:, 2:] / gain[:, None] - low) * bins


def bins_around(forms, low, high, corners, strength):
    """Validity, the cosine by which it is decided, and `centre` (n, 2), `a` and `p` (n, 2, 2), `tilt` (n, 2)."""
    upright = normal_of(forms, np.zeros((len(forms), 2)))
    z = upright[:, 2] / np.linalg.norm(upright, axis=1)
    valid = (z > NUMBERS["LEAST_HEIGHT"]) & (strength != 0)
    share = np.clip(strength, 0, 1)
    z = np.where(valid, z, 1.0)
    gain = np.where(valid, strength, 1.0) * z / (1 + (z - 1) * share)
    bins = (corners[:, None] - 1) / (high - low)[:, :2]
    low = low[:, :2]
    zero = np.zeros((len(forms), 2))
    columns = [bins_of(forms, gain, bins, low, zero + 1j * STEP * axis).imag / STEP for axis in np.eye(2)]
    a = np.stack(columns, axis=2)
    basis = np.linalg.inv(forms)  # columns g1, g2, g3
    return valid, z, SimpleNamespace(
        centre=bins_of(forms, gain, bins, low, zero), a=a, p=np.linalg.inv(a), tilt=basis[:, 2, :2] / basis[:, 2, 2:],
    )


def cover_region(a, h, t1, t2, view, radius, alpha):
    """Half (n, 2) of the bounding boxes in bins of the ellipses of slopes that are selected."""
    region = REGION * alpha
    inward = region + (radius - region) * np.einsum("nk,nk->n", h, view)
    plane = np.stack([np.einsum("nk,nk->n", t, view) for t in (t1, t2)], axis=1)
    length = np.linalg.norm(plane, axis=1, keepdims=True)
    plane = np.where(length > 1e-6, plane / np.maximum(length, 1e-6), [1.0, 0.0])
    across = np.stack([-plane[:, 1], plane[:, 0]], axis=1)
    return np.linalg.norm(a @ np.stack([inward[:, None] * plane, radius[:, None] * across], axis=2), axis=2)


def region_span(centre, reach, turn, corners):
    """Lowest and highest bin, the length between in bins, and whether rounding decides none."""
    ends = np.stack([np.maximum(centre - reach, -turn), np.minimum(centre + reach, corners - 1 + turn)], axis=1)
    size = 0.01 * (np.abs(centre) + reach)
    whole = np.floor(ends)
    return whole[:, 0], whole[:, 1], np.maximum(ends[:, 1] - ends[:, 0], 0), away(ends, size[:, None])


def lay_row(lowest, highest, stride, random):
    """Number of cells, first bin and the bin after the last, and whether rounding decides none."""
    before = random * stride
    start = lowest - np.floor(before)
    count = np.floor((highest - start) / stride) + 1
    return count, start, start + count * stride, away(before)


def lay_grid(cells, turn, alpha, corners, random):
    """The grid of cells over a region, and whether rounding decides nothing of it. columns is 0 where there is none."""
    bins = np.maximum(NUMBERS["CELL_FINE"] * np.maximum(alpha, 1e-6)[:, None] / np.linalg.norm(cells.p, axis=1), 1.0)
    turns = turn[:, None] * np.linalg.norm(cells.a, axis=2) + 1.0
    spans = [region_span(cells.centre[:, k], cells.reach[:, k], turns[:, k], corners) for k in range(2)]
    span = np.stack([s[2] for s in spans], axis=1)
    across = np.minimum(NUMBERS["FAR_ACROSS"], span / bins)
    most = (NUMBERS["FAR_ACROSS"] + 1) ** 2 / (across[:, ::-1] + 1) - 1
    exact = np.maximum(span / np.minimum(most, NUMBERS["MOST_ACROSS"]), bins)
    stride = np.ceil(exact)
    known = (span > 0).all(axis=1)
    is_clear = ((exact == 1) | (np.abs(exact - np.round(exact)) > 2e-4 * exact)).all(axis=1)
    is_clear &= ((span > 1e-3) | (span == 0)).all(axis=1)
    grid = {"known": known}
    for k, (name, number) in enumerate((("columns", "1"), ("rows", "2"))):
        count, start, end, row_is_clear = lay_row(*spans[k][:2], stride[:, k], random[:, k])
        grid[name] = np.where(known, count, 0)
        grid["start" + number], grid["end" + number] = np.where(known, start, 0), np.where(known, end, 0)
        grid["stride" + number] = stride[:, k]
        is_clear &= ~known | (row_is_clear & spans[k][3])
    return SimpleNamespace(**grid), is_clear


def hint_cells(hint, view, low, high, corners, strength, alpha, random):
    """The cells around one hint each, and whether rounding decides nothing of them."""
    valid, z, cells = bins_around(hint.forms, low, high, corners, strength)
    cells.reach = cover_region(cells.a, hint.h, hint.t1, hint.t2, view, hint.radius, alpha)
    cells.grid, is_clear = lay_grid(cells, hint.turn, alpha, corners, random)
    for name in ("columns", "rows", "start1", "start2", "end1", "end2"):
        setattr(cells.grid, name, np.where(valid, getattr(cells.grid, name), 0))
    cells.reach = np.where(valid[:, None], cells.reach, 0)
    # The basis of forms that are nearly in one plane, and slopes near the horizon, have lost digits.
    flat = np.linalg.cond(cells.a) * np.linalg.cond(hint.forms) < 50
    return cells, (is_clear & flat) | ~valid, valid


def cell_is_within(grid, centre, reach, i, j):
    """Whether the middle of cell (i, j) lies within half a cell of the region, and by how much."""
    start = np.stack([grid.start1, grid.start2], axis=1)
    stride = np.stack([grid.stride1, grid.stride2], axis=1)
    middle = start + (np.stack([i, j], axis=1) + 0.5) * stride
    distance = np.linalg.norm((middle - centre) / (reach + 0.5 * stride), axis=1)
    return distance < 1, distance - 1


def cell_bins(grid, row, i, j):
    """All bins of cell (i, j) of one row's grid."""
    first = [getattr(grid, f"start{k}")[row] + at * getattr(grid, f"stride{k}")[row] for k, at in ((1, i), (2, j))]
    ranges = [range(int(f), int(f + getattr(grid, f"stride{k}")[row])) for k, f in zip((1, 2), first, strict=True)]
    return {(a, b) for a in ranges[0] for b in ranges[1]}


def grid_bins(grid, row):
    """All bins of one row's grid."""
    return {bin for i in range(int(grid.columns[row])) for j in range(int(grid.rows[row]))
            for bin in cell_bins(grid, row, i, j)}


def cell_is_selected(grids, row, k, i, j, is_within):
    """Whether cell (i, j) of hint k of one row is within its region and shares no bin with an earlier hint's grid."""
    own = cell_bins(grids[k], row, i, j)
    return bool(is_within) and not any(own & grid_bins(grid, row) for grid in grids[:k])


def cell_move(a, turns, offset):
    """By how many bins (n, 2) cells move at a texel offset (n, 2), and whether rounding decides none. turns: (n, slope,
    texel)."""
    exact = 0.5 - np.einsum("nij,njk,nk->ni", a, turns, offset)
    return np.floor(exact), away(exact, 0.01 * np.abs(exact))


def group_middle(size, groups, i):
    """Middle in texels of the group that texel i (n,) belongs to; groups are cut as by the baker's block_edges."""
    firsts = [np.arange(int(g)) * int(s) // int(g) for s, g in zip(size, groups, strict=True)]
    group = np.array([np.searchsorted(first, texel, side="right") - 1 for first, texel in zip(firsts, i, strict=True)])
    return (group + 0.5) * size / groups


def hit_is_counted(hints, cells, low, high, corners, sizes, groups, texel, place, unscaled):
    """Whether the counts select the normal at each hit, and whether rounding does not decide it.

    hints: namespaces with turns; cells: one for each hint; sizes, groups, texel, place: (n, 2); unscaled: (n, 3).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = (unscaled[:, :2] / unscaled[:, 2:] - low[:, :2]) / (high - low)[:, :2] * (corners - 1)[:, None]
    bins = np.floor(exact)
    is_clear = away(exact, 0.01 * np.abs(exact))
    in_box = (unscaled[:, 2] > 0) & (bins >= 0).all(axis=1) & (bins < (corners - 1)[:, None]).all(axis=1)
    whole = np.floor(place)
    middle = np.stack([group_middle(sizes[:, k], groups[:, k], texel[:, k]) for k in range(2)], axis=1)
    offset = middle - texel - (place - whole)
    counted = np.zeros(len(unscaled), bool)
    for k, (hint, own) in enumerate(zip(hints, cells, strict=True)):
        move, move_is_clear = cell_move(own.a, hint.turns, offset)
        grid = own.grid
        start = np.stack([grid.start1, grid.start2], axis=1)
        stride = np.stack([grid.stride1, grid.stride2], axis=1)
        cell = np.floor((bins - move - start) / stride).astype(int)
        inside = (cell >= 0).all(axis=1) & (cell < np.stack([grid.columns, grid.rows], axis=1)).all(axis=1)
        within, margin = cell_is_within(grid, own.centre, own.reach, *cell.T)
        for row in np.flatnonzero(inside & in_box):
            counted[row] |= cell_is_selected([c.grid for c in cells], row, k, *cell[row], within[row])
        is_clear &= move_is_clear & (np.abs(margin) > 1e-4)
    return counted & in_box, is_clear


def counts_serve(map_, hints, query, view, widest):
    """Whether the counts serve, the side of the blocks that they are read from (0: none), and whether rounding does not
    decide it. map_: size, counts (first, levels, low, high), is_linear, strength of all rows; hints: a list of
    namespaces (n, ...); query: axes, short_axis, alpha, random; widest: (n,)."""
    counts = map_.counts
    block = counts_table.far_block(counts, query.axes, query.short_axis, widest)
    grown = [counts_table.far_block(counts, query.axes * s, query.short_axis * s, widest) for s in (1 - 1e-5, 1 + 1e-5)]
    is_clear = grown[0] == grown[1]
    is_first = np.isclose(widest, TABLE["FAR_SIDE_FIRST"])
    limit = np.where(is_first, TABLE["FAR_SIDE_LONG"], 2 * widest) * query.short_axis
    least_reach = np.where(map_.is_linear, NUMBERS["FAR_REACH_LINEAR"], NUMBERS["FAR_REACH_CLOSEST"])
    serves, found = np.zeros(len(block), bool), np.zeros(len(block), int)
    largest = counts.first << (counts.levels - 1)
    for power in range(int(counts.levels.max())):
        side = block << power
        tried = (block > 0) & ~serves & (side <= largest) & ((power == 0) | (side <= limit))
        is_clear &= (block == 0) | serves | (power == 0) | (np.abs(side / limit - 1) > 1e-5)
        corners = counts_table.level_corners(np.maximum(side, 16), map_.is_linear)
        least = np.full(len(block), np.inf)
        for hint in hints:
            cells, *_ = hint_cells(hint, view, counts.low, counts.high, corners, map_.strength, query.alpha,
                                   query.random)
            reach = np.where(hint.turn > NUMBERS["FAR_TURN"] * hint.radius, 0.0, cells.reach.min(axis=1))
            least = np.where(cells.grid.columns > 0, np.minimum(least, reach), least)
        is_clear &= ~tried | (np.abs(least / least_reach - 1) > 2e-3)
        found = np.where(tried & (least > least_reach), side, found)
        serves |= found > 0
    return serves, found, is_clear
