"""`python -m benchmarks.footprint_law`: footprint radius of least error by sample count, behind osl/footprint.h.

A glint anywhere in the picture should be seen by a pixel with the weight of the pixel's filter. The lobe sees it with
the mean of the footprint kernels around the pixel's samples: a kernel density estimate of the filter. Its error is the
L2 distance of the two over the filter's own norm: the relative RMSE of a single glint's brightness. Samples are
two-dimensional Sobol points, Owen-scrambled, sent through the inverse CDF of the Blackman-Harris filter, as in Cycles;
of a single sample Cycles takes the pixel's centre.

Footprints that know the pixel grid (osl/pixel_grid.h) are judged in the same way.
"""

from __future__ import annotations

import re
import sys

import numpy as np

from glint_addon import paths

FILTER_WIDTH = 1.5  # pixels, Blender's default: the half-width of a Blackman-Harris filter is as much
BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)  # Cycles, filter_func_blackman_harris
SPP = (1, 4, 16, 64, 256, 1024)
RADII = (0.1, 0.14, 0.18, 0.25, 0.35, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.4, 1.8)  # pixels
SCALE, EXPONENT = 1.1, 0.21  # FOOTPRINT_SCALE and FOOTPRINT_EXPONENT of osl/footprint.h; a test compares
REACH = 2.5  # pixels from the pixel's centre, where the estimate is compared; beyond lies a millionth of it
STEP = 0.05  # pixels between the points that are compared
SAMPLES = 1024  # of all scrambles together, but four scrambles at least: the error is then known to 2 %
FEWEST_SCRAMBLES = 4
# GRID_... of osl/pixel_grid.h; a test compares.
GRID_FIRST, GRID_ROUND, GRID_MEAN_2, GRID_MEAN_4 = 2.0, 1.05, 0.081692, 0.012179
BITS = 16  # of the points that are scrambled: more than enough for a thousand of them


def filter_weights(x):
    """Blackman-Harris filter at distances x in pixels, its greatest value 1."""
    angle = 2 * np.pi * (x / (2 * FILTER_WIDTH) + 0.5)
    weights = sum(factor * np.cos(k * angle) for k, factor in enumerate(BLACKMAN_HARRIS))
    return np.where(np.abs(x) < FILTER_WIDTH, weights, 0.0)


def sobol_points(count):
    """The first `count` points of the two-dimensional Sobol sequence, as integers of BITS bits (count, 2)."""
    index = np.arange(count)
    points = np.zeros((count, 2), np.int64)
    first = second = 1 << (BITS - 1)
    for bit in range(BITS):
        chosen = (index >> bit & 1).astype(bool)
        points[chosen, 0] ^= first
        points[chosen, 1] ^= second
        first, second = first >> 1, second ^ second >> 1
    return points


def scrambled(values, rng):
    """Owen-scrambled numbers in 0..1 of integers of BITS bits: each bit flips at random, by the bits above it."""
    result = np.zeros_like(values)
    for bit in range(BITS):
        prefixes = values >> (BITS - bit)
        flips = rng.integers(0, 2, 1 << bit)[prefixes]
        result = result << 1 | (values >> (BITS - 1 - bit) & 1) ^ flips
    return (result + rng.random(len(values))) / (1 << BITS)


def pixel_samples(count, rng):
    """Where `count` samples of a pixel lie, in pixels from its centre: (count, 2)."""
    if count == 1:
        return np.zeros((1, 2))
    x = np.linspace(-FILTER_WIDTH, FILTER_WIDTH, 3001)
    cdf = np.cumsum(filter_weights(x))
    points = sobol_points(count)
    return np.stack([np.interp(scrambled(points[:, axis], rng), cdf / cdf[-1], x) for axis in (0, 1)], axis=-1)


def glint_error(samples, radius):
    """Relative RMSE of a glint seen through kernels (1 - t)^2 of `radius` pixels around `samples` (n, 2)."""
    grid = np.arange(-REACH, REACH, STEP) + STEP / 2
    along = filter_weights(grid) / (filter_weights(grid).sum() * STEP)
    wanted = along[:, None] * along
    seen = np.zeros_like(wanted)
    for x, y in samples:
        # Only the points of the grid within the kernel's reach.
        columns, rows = (np.flatnonzero(np.abs(grid - place) < radius) for place in (x, y))
        t = ((grid[columns, None] - x) ** 2 + (grid[rows] - y) ** 2) / radius**2
        kernel = np.maximum(1.0 - t, 0.0) ** 2
        if kernel.any():
            seen[np.ix_(columns, rows)] += kernel / (kernel.sum() * STEP**2 * len(samples))
    return np.sqrt(np.sum((seen - wanted) ** 2) / np.sum(wanted**2))


def grid_numbers():
    """The fitted numbers of osl/pixel_grid.h: r0, r2, t2, t4, r1 at 4, 8, 16, ... samples, (5, counts)."""
    text = paths.shader_file("pixel_grid.h").read_text(encoding="utf-8")
    rows = re.findall(r"^  float (?:r0|r2|t2|t4|r1)s\[GRID_COUNTS\] = \{ (.+) \};$", text, re.MULTILINE)
    return np.array([[float(number) for number in row.split(",")] for row in rows])


def glint_error_on_grid(samples):
    """As `glint_error`, through kernels whose radii and totals follow the places of `samples` in the pixel grid, of
    which the first lies in its pixel's middle."""
    power = np.log2(len(samples)) - GRID_FIRST
    r0, r2, t2, t4, r1 = (np.interp(power, np.arange(row.size), row) for row in grid_numbers())
    place = samples - np.floor(samples + 0.5)
    radii = GRID_ROUND * r0 * (1.0 + r2 * place**2)
    totals = (1.0 + t2 * place**2 + t4 * place**4).prod(axis=1) / (1.0 + t2 * GRID_MEAN_2 + t4 * GRID_MEAN_4) ** 2
    radii[0], totals[0] = GRID_ROUND * r1, 1.0
    grid = np.arange(-REACH, REACH, STEP) + STEP / 2
    along = filter_weights(grid) / (filter_weights(grid).sum() * STEP)
    wanted = along[:, None] * along
    seen = np.zeros_like(wanted)
    for (x, y), (radius_x, radius_y), total in zip(samples, radii, totals, strict=True):
        t = ((grid[:, None] - x) / radius_x) ** 2 + ((grid - y) / radius_y) ** 2
        kernel = np.maximum(1.0 - t, 0.0) ** 2
        seen += total * kernel / (kernel.sum() * STEP**2 * len(samples))
    return np.sqrt(np.sum((seen - wanted) ** 2) / np.sum(wanted**2))


def grid_errors(count, scrambles=None):
    """Relative RMSE of a single glint at `count` samples a pixel, 4 or more, on the pixel grid."""
    scrambles = scrambles or max(SAMPLES // count, FEWEST_SCRAMBLES)
    squares = []
    for seed in range(scrambles):
        samples = pixel_samples(count, np.random.default_rng((seed, count)))
        samples[0] = 0.0  # as in Cycles
        squares.append(glint_error_on_grid(samples) ** 2)
    return np.sqrt(np.mean(squares))


def errors(count, radii=RADII, scrambles=None):
    """Relative RMSE (len(radii),) of a single glint at `count` samples a pixel, for footprints of `radii` pixels."""
    scrambles = scrambles or max(SAMPLES // count if count > 1 else 1, FEWEST_SCRAMBLES)
    squares = np.zeros(len(radii))
    for seed in range(scrambles):
        samples = pixel_samples(count, np.random.default_rng((seed, count)))
        squares += [glint_error(samples, radius) ** 2 for radius in radii]
    return np.sqrt(squares / scrambles)


def table(spp=SPP) -> str:
    """Markdown: the radius of least error, and that of the law, with their errors, and the error on the pixel grid."""
    lines = ["| spp | best radius, pixels | its error | radius of the law | its error | on the pixel grid |",
             "| ---: | ---: | ---: | ---: | ---: | ---: |"]
    for count in spp:
        law = SCALE * count**-EXPONENT
        found = errors(count, (*RADII, law))
        best = int(np.argmin(found[:-1]))
        grid = f"{grid_errors(count):.1%}" if count >= 2**GRID_FIRST else "-"
        lines.append(f"| {count} | {RADII[best]:g} | {found[best]:.1%} | {law:.2f} | {found[-1]:.1%} | {grid} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
