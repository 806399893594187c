"""`python -m benchmarks.merge_cells`: the error of merging elements into cells by moments, behind osl/selection.h.

Elements whose normals lie at random in the region around a half vector (its radius is REGION alpha) are merged: those
of a cell become one lobe of their mean and covariance. The sum of the lobes is compared with the exact one, for a light
a fifth of alpha off the middle. Slopes are in units of alpha. RMSE and bias are over many sets of elements.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

REGION = 2.5  # alpha, of osl/light_hint.h
LIGHT_DEVIATION = 0.2  # alpha, along each axis: points of a sun of 0.5 degrees are so far off at alpha 0.01
TRIALS = 1500  # the RMSE is then known to 3 %, a bias to a fortieth of the RMSE
ELEMENTS = (30, 400)
SQUARES = (6, 3, 2)
SEED = 1
# Outer radius of each ring of cells, in radii of the region, and its sectors; by number of cells of a hint,
# as osl/selection.h has them.
RINGS = {
    37: ((0.18, 1), (0.45, 6), (0.72, 12), (np.inf, 18)),
    19: ((0.25, 1), (0.6, 6), (np.inf, 12)),
    14: ((0.25, 1), (0.6, 5), (np.inf, 8)),
    7: ((0.37, 1), (np.inf, 6)),
}


@dataclass(frozen=True)
class MergeError:
    """Relative to the mean of the exact answer."""

    rmse: float
    bias: float


def beckmann(x, y, a11=1.0, a12=0.0, a22=1.0):
    """Slope distribution at (x, y) of the alpha-squared matrix ((a11, a12), (a12, a22))."""
    determinant = a11 * a22 - a12**2
    square = (a22 * x * x - 2 * a12 * x * y + a11 * y * y) / determinant
    return np.exp(-square) / (np.pi * np.sqrt(determinant))


def ggx(x, y, a11=1.0, a12=0.0, a22=1.0):
    """As `beckmann`, with the long tail of Trowbridge and Reitz."""
    determinant = a11 * a22 - a12**2
    square = (a22 * x * x - 2 * a12 * x * y + a11 * y * y) / determinant
    return 1.0 / (np.pi * np.sqrt(determinant) * (1.0 + square) ** 2)


def ring_cells(rings, p):
    """Cell of each slope p (n, 2) in rings ((outer radius in regions, sectors), ...), as osl/selection.h cuts them."""
    r = np.hypot(*p.T) / REGION
    turn = np.arctan2(p[:, 1], p[:, 0]) / (2 * np.pi) + 0.5
    outer, sectors = np.array(rings).T
    ring = np.searchsorted(outer, r, side="right")
    first = np.concatenate([[0], np.cumsum(sectors)])[ring]
    return (first + np.minimum(np.floor(turn * sectors[ring]), sectors[ring] - 1)).astype(int)


def square_cells(side, p):
    """Cell of each slope p (n, 2) in a grid of `side` x `side` squares around the region."""
    column, row = np.clip(np.floor((p / REGION + 1) / 2 * side), 0, side - 1).astype(int).T
    return row * side + column


def merged_answer(distribution, p, cell, light):
    """Sum of the merged lobes at the slope `light` (2,): twice a cell's covariance is added to alpha squared."""
    cells = np.unique(cell, return_inverse=True)[1]
    weight = np.bincount(cells).astype(float)

    def mean(values):
        return np.bincount(cells, values) / weight

    x, y = mean(p[:, 0]), mean(p[:, 1])
    c11, c22 = mean(p[:, 0] ** 2) - x * x, mean(p[:, 1] ** 2) - y * y
    c12 = mean(p[:, 0] * p[:, 1]) - x * y
    return (weight * distribution(light[0] - x, light[1] - y, 1 + 2 * c11, 2 * c12, 1 + 2 * c22)).sum()


def merge_error(distribution, cell_of, elements, trials=TRIALS, seed=SEED) -> MergeError:
    """Error of merging `elements` random ones; cell_of(p) gives their cells."""
    rng = np.random.default_rng(seed)
    answers = np.empty((trials, 2))
    for answer in answers:
        r, angle = REGION * np.sqrt(rng.random(elements)), 2 * np.pi * rng.random(elements)
        p = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)
        light = rng.normal(0.0, LIGHT_DEVIATION, 2)
        answer[:] = merged_answer(distribution, p, cell_of(p), light), distribution(*(light - p).T).sum()
    merged, exact = answers.T
    return MergeError(float(np.sqrt(np.mean((merged - exact) ** 2)) / exact.mean()),
                      float(merged.mean() / exact.mean() - 1.0))


def table(trials=TRIALS) -> str:
    """Markdown: relative RMSE and bias for few and for many elements, Beckmann and GGX."""
    heads = [f"{name}, {count} elements" for name in ("Beckmann", "GGX") for count in ELEMENTS]
    lines = ["| cells | " + " | ".join(heads) + " |", "| --- |" + " ---: |" * len(heads)]
    layouts = {" + ".join(str(sectors) for _, sectors in rings): lambda p, rings=rings: ring_cells(rings, p)
               for rings in RINGS.values()}
    layouts |= {f"{side} x {side} squares": lambda p, side=side: square_cells(side, p) for side in SQUARES}
    for name, cell_of in layouts.items():
        found = [merge_error(distribution, cell_of, count, trials)
                 for distribution in (beckmann, ggx) for count in ELEMENTS]
        lines.append(f"| {name} | " + " | ".join(f"{error.rmse:.1%}, {error.bias:+.1%}" for error in found) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
