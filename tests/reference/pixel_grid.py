"""Numpy twin of osl/pixel_grid.h: float64, one row for each sample."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from glint_addon.paths import shader_file

GRID_FIRST = 2.0
GRID_MIDDLE = 0.501
GRID_FIRST_SAMPLE = 2e-3
GRID_MEAN_2 = 0.081692
GRID_MEAN_4 = 0.012179
GRID_ROUND = 1.05
GRID_TURN = 0.25
FOOTPRINT_EXPONENT = 0.21
# The fitted numbers are the shader's own: r0, r2, t2, t4, r1 at 4, 8, 16, ... samples, (5, 9).
NUMBERS = np.array([
    [float(number) for number in row.split(",")]
    for row in re.findall(r"= \{ (.+) \};", shader_file("pixel_grid.h").read_text(encoding="utf-8"))
    if "," in row and row.count(",") > 4
])


@dataclass
class PixelGrid:
    """Semi-axes (n, 2) in pixels of the footprints along the pixel axes; largest of all samples, and total, (n,)."""

    radius: np.ndarray
    widest: np.ndarray
    total: np.ndarray


def grid_place(x):
    """Distance -0.5..0.5 of raster coordinates from the nearest pixel's middle."""
    return (x - GRID_MIDDLE + 0.5) % 1.0 - 0.5


def pixel_grid(at, samples):
    """Validity (n,) bool and PixelGrid of camera samples at raster positions `at` (n, 2)."""
    power = np.log2(np.maximum(samples, 1.0)) - GRID_FIRST
    last = NUMBERS.shape[1] - 1
    beyond = 2.0 ** (-FOOTPRINT_EXPONENT * np.maximum(power - last, 0.0))
    r0, r2, t2, t4, r1 = (np.interp(power, np.arange(last + 1), row) for row in NUMBERS)
    square = grid_place(np.asarray(at, float)) ** 2
    is_first = (square < GRID_FIRST_SAMPLE**2).all(axis=1)
    radius = np.where(is_first[:, None], r1[:, None], r0[:, None] * (1.0 + r2[:, None] * square))
    total = 1.0 + t2[:, None] * square + t4[:, None] * square**2
    total = np.prod(total, axis=1) / (1.0 + t2 * GRID_MEAN_2 + t4 * GRID_MEAN_4) ** 2
    wide = GRID_ROUND * beyond
    widest = wide * np.maximum(r0 * np.maximum(1.0, 1.0 + 0.25 * r2), r1)
    return power >= 0.0, PixelGrid(wide[:, None] * radius, widest, np.where(is_first, 1.0, total))
