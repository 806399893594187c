"""Places of individuals (flakes, grains, dents, sequins): a periodic lattice of hexagons, disturbed at random.

A point's cell in a power diagram (F. Aurenhammer, "Power Diagrams: Properties, Algorithms and Applications", SIAM
Journal on Computing 16(1), 1987) is where its squared distance minus its weight is least: a convex polygon, larger with
the weight. All lengths here are in units of the lattice's width, the distance between two neighbours in a row.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

BLOCK = 16  # rows of texels that are looked at together, so that their distances stay in the processor's cache
# Relative standard deviation of the cells' widths: what points moved by up to half a width make, and what weights of a
# standard deviation add to it (by squares); both by counting the texels of cells. Weights swallow small cells, at the
# largest spread one in ten.
SPREAD_BY_PLACES = 0.13
_SPREADS = (0.0, 0.087, 0.171, 0.235, 0.307, 0.346, 0.389)
_WEIGHTS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
LARGEST_SPREAD = 0.4


@dataclass(frozen=True)
class Lattice:
    """Points in rows, every other row shifted by half a width; rows is even, so that the lattice is periodic.

    x, y: float32 (rows, columns), each point's place in its cell, 0..1 along u and v. weight: float32 (rows, columns).
    """

    x: np.ndarray
    y: np.ndarray
    weight: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)"""
        return self.x.shape[0], self.x.shape[1]

    @property
    def count(self) -> int:
        """How many points there are."""
        return self.x.size

    @property
    def height(self) -> float:
        """Distance between two rows, about .87 as in a lattice of regular hexagons."""
        rows, columns = self.shape
        return columns / rows


def rows_of(columns: int) -> int:
    """The even number of rows that makes the cells of so many columns most nearly regular hexagons."""
    return max(2, 2 * round(columns / np.sqrt(3.0)))


def random_lattice(columns: int, spread: float, rng: np.random.Generator) -> Lattice:
    """A lattice whose cells' widths have the relative standard deviation `spread`, 0 (hexagons) to LARGEST_SPREAD."""
    shape = rows_of(columns), columns
    moved = min(1.0, spread / SPREAD_BY_PLACES)
    x, y = (np.float32(0.5 * (1 - moved)) + np.float32(moved) * rng.random(shape, np.float32) for _ in range(2))
    rest = np.sqrt(max(0.0, spread**2 - SPREAD_BY_PLACES**2))
    weight = rng.standard_normal(shape, np.float32) * np.float32(np.interp(rest, _SPREADS, _WEIGHTS))
    return Lattice(x, y, weight)


def nearest(lattice: Lattice, resolution: int) -> np.ndarray:
    """Number of the point in whose cell each texel's centre lies, int32 (resolution, resolution).

    Only the nine places around are searched: a farther point wins at 6 of 10,000 texels of the largest spread, at 9 of
    100,000 of a spread of 0.3, and moves an edge by little.
    """
    result = np.empty((resolution, resolution), np.int32)
    for band, row in _bands(lattice, resolution):
        least: np.ndarray | None = None
        for number, along, across in candidates(lattice, resolution, band, row, 1):
            power = across * across
            power += along * along - lattice.weight.ravel()[number]
            if least is None:
                least, found = power, np.broadcast_to(number, power.shape).copy()
                continue
            nearer = power < least
            np.copyto(least, power, where=nearer)
            np.copyto(found, number, where=nearer)
        result[band] = found
    return result


def topmost(lattice: Lattice, resolution: int, radius: float) -> np.ndarray:
    """Number of the disc of `radius` (up to 1) that is seen at each texel, int32 (resolution, resolution); -1: none.

    A disc lies over those of higher rows and, in its row, over those to its left, as sequins are sewn.
    """
    result = np.empty((resolution, resolution), np.int32)
    for band, row in _bands(lattice, resolution):
        seen = np.full((band.stop - band.start, resolution), -1, np.int32)
        # From high rows to low ones, from left to right: later discs cover those before.
        for number, along, across in candidates(lattice, resolution, band, row, 2):
            np.copyto(seen, number, where=along * along + across * across < radius * radius)
        result[band] = seen
    return result


def offsets(lattice: Lattice, number: np.ndarray) -> np.ndarray:
    """From each texel's point to its centre along u and v, float32 (r, r, 2); number: (r, r), as `nearest` has it."""
    rows, columns = lattice.shape
    resolution = len(number)
    row, column = np.divmod(np.arange(lattice.count, dtype=np.int32), columns)
    u = (column + 0.5 * (row % 2) + lattice.x.ravel()).astype(np.float32)
    v = (row + lattice.y.ravel()).astype(np.float32)
    centre = (np.arange(resolution) + 0.5) / resolution
    result = np.empty((resolution, resolution, 2), np.float32)
    result[..., 0] = _wrapped((centre * columns).astype(np.float32)[None, :] - u[number], columns)
    result[..., 1] = _wrapped((centre * rows).astype(np.float32)[:, None] - v[number], rows) * lattice.height
    return result


def _wrapped(difference, period):
    """Differences brought into half a period around 0."""
    return difference - period * np.round(difference / np.float32(period))


def candidates(
    lattice: Lattice, resolution: int, band: slice, row: int, reach: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The points around the texels of a band, one for each texel column at a time: (numbers (r,), along (r,), across).

    along, across: from the point to the texel along u (r,) and along v (band, r). Points come from the highest of the
    rows within `reach` to the lowest, from left to right.
    """
    rows, columns = lattice.shape
    u = (np.arange(resolution) + 0.5) * (columns / resolution)
    v = (np.arange(band.start, band.stop) + 0.5) * (rows / resolution)
    for up in range(reach, -reach - 1, -1):
        at = (row + up) % rows
        shift = 0.5 * (at % 2)
        cell = np.floor(u - shift).astype(np.int64)
        inside = u - shift - cell
        height = ((v - (row + up)) * lattice.height).astype(np.float32)[:, None]
        for right in range(-reach, reach + 1):
            number = (at * columns + (cell + right) % columns).astype(np.int32)
            along = (inside - right).astype(np.float32) - lattice.x.ravel()[number]
            yield number, along, height - lattice.y.ravel()[number] * np.float32(lattice.height)


def _bands(lattice, resolution) -> Iterator[tuple[slice, int]]:
    """Rows of texels, at most BLOCK of them, whose centres lie in one row of the lattice, and that row."""
    row_of = ((np.arange(resolution) + 0.5) * (lattice.shape[0] / resolution)).astype(int)
    starts = np.flatnonzero(np.diff(row_of, prepend=-1)).tolist()
    for start, stop in zip(starts, [*starts[1:], resolution], strict=True):
        for first in range(start, stop, BLOCK):
            yield slice(first, min(first + BLOCK, stop)), int(row_of[start])
