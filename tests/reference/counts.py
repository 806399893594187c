"""Numpy twin of osl/counts.h: a function is of one sample, unless it says otherwise. Structs are namespaces of numbers;
maps between bins and slopes are arrays (2, 2), grids those of counts_cells."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from .constants import constants

NUMBERS = constants("counts.h") | constants("counts_masses.h")
PACKED_STEP = int(constants("counts_table.h")["PACKED_STEP"])
SELECTION = constants("selection.h")
REGION = constants("light_hint.h")["REGION"]
EVEN = 1.0 / 12.0  # variance of a uniform distribution, relative to its squared width


def row_of(arrays, row):
    """One row of a namespace of arrays and of namespaces."""
    return SimpleNamespace(**{name: row_of(value, row) if isinstance(value, SimpleNamespace) else value[row]
                              for name, value in vars(arrays).items()})


def cell_spread(is_ggx, width):
    """Variance of slopes (n,) that a cell's closure adds along one side, relative to its squared width."""
    narrow, wide = NUMBERS["CELL_NARROW"], NUMBERS["CELL_WIDE"]
    return np.where(is_ggx, EVEN, np.interp(width, [narrow, wide], [-EVEN, EVEN]))


def group_table(texels, level, number):
    """Summed-area tables (corners, corners, 4) of one group, in steps of the level's unit; texels: (texels, 4)."""
    corners = int(level.corners)
    size = corners**2
    pair = number // 2 if level.unit > 0 else number
    table = texels[int(level.first) + pair * size :][:size].astype(np.int64 if level.unit > 0 else float)
    if level.unit > 0:
        table = table // PACKED_STEP if number % 2 else table % PACKED_STEP
    return table.reshape(corners, corners, 4).astype(float)


def weighted_corner(texels, level, number, weights, corner):
    """Elements below corner number `corner` of a group, over its four blocks by their weights (4,)."""
    return group_table(texels, level, number).reshape(-1, 4)[corner] @ weights


def cell_edges(start, stride, end, count, move, corners):
    """First bin of each cell of a row and the bin after its last, (count,) each, where the bins have moved."""
    edges = np.clip(np.minimum(start + stride * np.arange(count + 1), end) + move, 0, corners - 1).astype(int)
    return edges[:-1], edges[1:]


def add_group(texels, level, reading, grid, spread):
    """What a group adds to each cell: arrays (rows, columns) of mass, first and square moments along both slopes.

    reading: number, weights (4,), move (2,), turned (2,); spread: (2,), of a cell along each slope.
    """
    histogram = np.diff(np.diff(group_table(texels, level, reading.number), axis=0), axis=1) @ reading.weights
    histogram = histogram * (level.unit if level.unit > 0 else 1.0)
    low1, high1 = cell_edges(grid.start1, grid.stride1, grid.end1, int(grid.columns), reading.move[0], level.corners)
    low2, high2 = cell_edges(grid.start2, grid.stride2, grid.end2, int(grid.rows), reading.move[1], level.corners)
    mass = np.array([[histogram[b:t, left:right].sum() for left, right in zip(low1, high1, strict=True)]
                     for b, t in zip(low2, high2, strict=True)])
    mass = np.maximum(mass, 0.0)  # the steps of packed counts are rounded, so a few in an empty cell may miss
    x = (low1 + high1) / 2 + reading.turned[0]
    y = ((low2 + high2) / 2 + reading.turned[1])[:, None]
    return SimpleNamespace(
        mass=mass, first1=mass * x, first2=mass * y, square1=mass * (x**2 + spread[0] * (high1 - low1) ** 2),
        square2=mass * (y**2 + spread[1] * ((high2 - low2) ** 2)[:, None]),
    )


def clear_masses(p, grid, alpha, is_ggx):
    """Widths of a grid's cells in alpha, and their spreads, (2,) each; p: (2, 2), slope per bin."""
    widths = np.array([grid.stride1, grid.stride2]) * np.linalg.norm(p, axis=0) / max(alpha, 1e-6)
    return widths, cell_spread(is_ggx, widths)


def group_readings(level, hint, cells, groups, middle):
    """How the groups are read for a hint: a list of readings with the variance (2,) of each group's positions.

    groups: places (m, 2) and weights (m, 4); middle: (2,), the hit in texels.
    """
    side = np.array([level.group_u, level.group_v])
    readings = []
    for place, weights in zip(*groups, strict=True):
        offset = (place + 0.5) * side - middle
        move = np.floor(0.5 - cells.a @ hint.turns @ offset)
        # The blocks' middles lie at a quarter and at three quarters of the group.
        blocks = np.array([(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]) * side
        mean = np.average(blocks, axis=0, weights=weights)
        variance = np.average((blocks - mean) ** 2, axis=0, weights=weights)
        turned = cells.a @ hint.turns @ (place * side + mean - middle) - cells.centre
        column, row = (int(at) % int(count) for at, count in zip(place, (level.columns, level.rows), strict=True))
        readings.append(SimpleNamespace(number=row * int(level.columns) + column, weights=weights, move=move,
                                        turned=turned, variance=variance))
    return readings


def grid_masses(texels, level, hint, cells, groups, grid, total, middle, spread):
    """Masses of a grid's cells over the groups; spread: (2,) of a cell."""
    sums = SimpleNamespace(**{name: 0.0 for name in ("mass", "first1", "first2", "square1", "square2")})
    # A block's texels lie evenly over it: half a group wide.
    blocks = EVEN * (0.5 * np.array([level.group_u, level.group_v])) ** 2
    variance = blocks.copy()
    for reading in group_readings(level, hint, cells, groups, middle):
        for name, values in vars(add_group(texels, level, reading, grid, spread)).items():
            setattr(sums, name, getattr(sums, name) + values)
        variance += reading.weights.sum() * reading.variance / total
    sums.spread_u, sums.spread_v = variance
    return sums


def sharpen_cells(mass, selected, spread):
    """Mass (rows, columns) after each pair of neighbours that are selected has moved some from the lighter to the
    heavier."""
    sharp = mass.copy()
    for axis in range(2):
        # Axis 0 of the arrays is the second slope.
        share = (EVEN + spread[1 - axis]) / 2
        one, other = (tuple(part if k == axis else slice(None) for k in range(2))
                      for part in (slice(None, -1), slice(1, None)))
        moved = share * (mass[one] - mass[other])
        most = NUMBERS["LARGEST_MOVE"]
        moved = np.maximum(np.minimum(moved, most * mass[other]), -most * mass[one])
        moved = np.where(selected[one] & selected[other], moved, 0.0)
        sharp[one] += moved
        sharp[other] -= moved
    return sharp


def peak_cell(mass, selected, grid):
    """The cell that holds more than its share of all elements, row by row; -1: none."""
    largest = int(np.argmax(mass))
    is_peak = mass.max() >= NUMBERS["PEAK_SHARE"] * mass.sum() and selected.reshape(-1)[largest]
    return largest if is_peak and grid.stride1 * grid.stride2 > 1 else -1


def cell_parts(grid, cell):
    """The parts of a cell of a grid."""
    parts = SimpleNamespace()
    for number, name, at in (("1", "columns", cell % grid.columns), ("2", "rows", cell // grid.columns)):
        stride = getattr(grid, "stride" + number)
        start = getattr(grid, "start" + number) + at * stride
        size = -(-stride // int(NUMBERS["PEAK_PARTS"]))
        setattr(parts, "start" + number, start)
        setattr(parts, "end" + number, start + stride)
        setattr(parts, "stride" + number, size)
        setattr(parts, name, -(-stride // size))
    return parts


def cell_lobe(masses, c, cells, grid, hint, widths, random):
    """Mean slope (2,) and covariance (c11, c12, c22) of the lobe of cell c, and its place (2,) in bins."""
    first, square = (np.array([getattr(masses, f"{name}{k}").reshape(-1)[c] for k in (1, 2)])
                     for name in ("first", "square"))
    mean = first / masses.mass.reshape(-1)[c]
    variance = square / masses.mass.reshape(-1)[c] - mean**2
    stride = np.array([grid.stride1, grid.stride2])
    mean = mean + np.where((stride == 1) & (widths > NUMBERS["CELL_NARROW"]), random[:2] - 0.5, 0.0)
    linear = cells.p @ mean
    slope = linear / max(1 - linear @ cells.tilt, 0.1)
    spread = np.diag([masses.spread_u, masses.spread_v])
    covariance = cells.p @ np.diag(variance) @ cells.p.T + hint.turns @ spread @ hint.turns.T
    return slope, covariance[[0, 0, 1], [0, 1, 1]], cells.centre + mean


def element_importance(is_ggx, alpha, radius, weight, p, covariance):
    """What an element shows of a hinted light; see selection.h."""
    width = max(alpha**2 + covariance[0] + covariance[2], SELECTION["LEAST_SHARE"] * alpha**2)
    q = (p @ p) / (width + 0.5 * (radius - REGION * alpha) ** 2)
    return weight * (SELECTION["LEAST_IMPORTANCE"] + (1 / (1 + q) ** 2 if is_ggx else np.exp(-q)))


def counts_query(texels, level, query, hints, cells, selected, groups, total):
    """Number of selected cells, the sum of their importances, and the number of peaks. selected: (rows, columns) of
    each hint; query: middle (2,), alpha, is_ggx, random (3,)."""
    count, importance, peaks = 0, 0.0, 0
    area = 0.25 * level.group_u * level.group_v
    for hint, own, is_selected in zip(hints, cells, selected, strict=True):
        grid = own.grid
        passes = [(grid, is_selected)] if grid.columns > 0 else []
        for number, (grid, is_taken) in enumerate(passes):
            widths, spread = clear_masses(own.p, grid, query.alpha, query.is_ggx)
            masses = grid_masses(texels, level, hint, own, groups, grid, total, query.middle, spread)
            peak = peak_cell(masses.mass, is_taken, grid) if number == 0 else -1
            mass = masses.mass
            if number == 0 and peak < 0:
                mass = sharpen_cells(mass, is_taken, spread)
            for c in np.flatnonzero(is_taken.reshape(-1) & (mass.reshape(-1) > 0)):
                if c != peak:
                    p, covariance, _ = cell_lobe(masses, c, own, grid, hint, widths, query.random)
                    weight = mass.reshape(-1)[c] / (total * area)
                    importance += element_importance(query.is_ggx, query.alpha, hint.radius, weight, p, covariance)
                    count += 1
            if peak >= 0:
                peaks += 1
                parts = cell_parts(grid, peak)
                passes.append((parts, np.ones((int(parts.rows), int(parts.columns)), bool)))
    return count, importance, peaks
