"""Numpy twin of osl/selection.h: the cells into which elements are merged, and their moments."""

from __future__ import annotations

import numpy as np

CLOSURE_BUDGET = 60
LARGEST_GRID = 6


def merge_grid(hints):
    """Cells a side so that the cells of all `hints` fit the budget."""
    grid = 1
    while grid < LARGEST_GRID and (grid + 1) ** 2 * max(hints, 1) <= CLOSURE_BUDGET:
        grid += 1
    return grid


def cell_index(grid, hint, radius, p):
    """Cell of slopes p (n, 2) in the square of half-width `radius` (n,) around each hint's half vector."""
    cell = np.clip(np.floor((p / np.asarray(radius)[..., None] + 1.0) * 0.5 * np.asarray(grid)[..., None]).astype(int),
                   0, np.asarray(grid)[..., None] - 1)
    return (hint * grid + cell[..., 1]) * grid + cell[..., 0]


def moments(weight, p, covariance):
    """Weight, mean (2,) and covariance (c11, c12, c22) of a mixture of elements: weight (n,), p (n, 2), cov (n, 3)."""
    total = weight.sum()
    mean = (weight[:, None] * p).sum(axis=0) / total
    second = np.stack([p[:, 0] ** 2, p[:, 0] * p[:, 1], p[:, 1] ** 2], axis=-1) + covariance
    second = (weight[:, None] * second).sum(axis=0) / total
    return total, mean, second - np.array([mean[0] ** 2, mean[0] * mean[1], mean[1] ** 2])
