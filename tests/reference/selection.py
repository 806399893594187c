"""Numpy twin of osl/selection.h: the cells into which elements are merged, and their moments."""

from __future__ import annotations

import numpy as np

from benchmarks.merge_cells import RINGS

CLOSURE_BUDGET = 60


def hint_cells(hints):
    """Cells of each of `hints` hints: the most that fit the budget of all."""
    return next(cells for cells in sorted(RINGS, reverse=True) if cells * hints <= CLOSURE_BUDGET)


def cell_index(cells, hint, radius, p):
    """Cell of slopes p (n, 2) in the rings of `cells` cells around each hint's half vector; region's `radius` (n,)."""
    index = np.empty(len(p), int)
    for row, slope in enumerate(p):
        r = np.hypot(*slope) / radius[row]
        turn = np.arctan2(slope[1], slope[0]) / (2 * np.pi) + 0.5
        first = 0
        for outer, sectors in RINGS[int(cells[row])]:
            if r < outer:
                index[row] = hint[row] * cells[row] + first + min(int(turn * sectors), sectors - 1)
                break
            first += sectors
    return index


def cell_margin(cells, radius, p):
    """Distance (n,) of slopes from the nearest border between cells: in radii of the region, or in turns."""
    margin = np.empty(len(p))
    for row, slope in enumerate(p):
        r = np.hypot(*slope) / radius[row]
        turn = np.arctan2(slope[1], slope[0]) / (2 * np.pi) + 0.5
        rings = RINGS[int(cells[row])]
        sectors = next(sectors for outer, sectors in rings if r < outer)
        border = abs(turn * sectors - round(turn * sectors)) / sectors if sectors > 1 else np.inf
        margin[row] = min(border, *(abs(r - outer) for outer, _ in rings))
    return margin


def moments(weight, p, covariance):
    """Weight, mean (2,) and covariance (c11, c12, c22) of a mixture of elements: weight (n,), p (n, 2), cov (n, 3)."""
    total = weight.sum()
    mean = (weight[:, None] * p).sum(axis=0) / total
    second = np.stack([p[:, 0] ** 2, p[:, 0] * p[:, 1], p[:, 1] ** 2], axis=-1) + covariance
    second = (weight[:, None] * second).sum(axis=0) / total
    return total, mean, second - np.array([mean[0] ** 2, mean[0] * mean[1], mean[1] ** 2])
