"""Counts over slope bins of the elements of a rectangle of a normal map: what one group of the counts table holds.

Elements are texels (Closest) or bilinear patches (Linear), see counts.py. A patch's slope is that of the interpolated
normal, as the Normal Map node has it, so it is sampled: at k x k points, each for 1 / k^2 of the patch.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# Part of the slopes outside the box on each side of each axis: the shader meets them at random, as fireflies:
# decision 32.
OUTERMOST = 0.0001
LEAST_RANGE = 1e-4  # of the box along an axis, in slope: far less than the width of any lobe
MARGIN = 1e-3  # of the box's range, on each side: many slopes of an 8-bit map lie exactly at the rim
LARGEST_SLOPE = 1000.0  # 0.06 degrees above the horizon: nobody sees steeper normals, which would stretch the box
PIECE = 1 << 16  # samples at a time: they stay in the processor's cache


def slope_box(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corner, float32 (2,) each, of the box of slopes that are counted.

    normals: (height, width, 3) of `decoded_normals`. Of the normals above the horizon the box holds all slopes but the
    part OUTERMOST on each side of each axis. Texels that are no flakes have no slope.
    """
    z = normals[..., 2]
    ends = np.empty((2, 2))
    for axis in range(2):
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            slopes = normals[..., axis] / z
        slopes = slopes[(z > 0) & (np.abs(slopes) <= LARGEST_SLOPE)]
        if not len(slopes):
            slopes = np.zeros(1, np.float32)
        rank = int(OUTERMOST * len(slopes))
        slopes.partition((rank, len(slopes) - 1 - rank))
        ends[:, axis] = slopes[rank], slopes[-1 - rank]
    margin = np.maximum(MARGIN * (ends[1] - ends[0]), LEAST_RANGE / 2)
    return (ends[0] - margin).astype(np.float32), (ends[1] + margin).astype(np.float32)


def group_counts(
    normals: np.ndarray,
    edges_u: np.ndarray,
    edges_v: np.ndarray,
    corners: int,
    k: int,
    box: tuple[np.ndarray, np.ndarray],
    done: Callable[[int], None],
) -> np.ndarray:
    """Summed-area tables of the four blocks of a group: float32 (corners, corners, 4), as [j, i, block].

    normals: float32 (height, width, 3); edges_u, edges_v: first, middle and end texel of the group along each side;
    k: points along each axis of a patch, 0 for texels; box: `slope_box`; done: called with counted samples.
    Blocks: low u low v, high u low v, low u high v, high u high v.
    """
    # Count bin b at b + 1: slopes below the box fall on row or column 0, slopes above it on the last one.
    found = np.zeros((corners + 1, corners + 1, 4), np.int64)
    scale = ((corners - 1) / (box[1] - box[0])).astype(np.float32)
    offset = np.float32(1) - box[0] * scale
    column_block = (np.arange(edges_u[0], edges_u[2]) >= edges_u[1]).astype(np.int32)
    row_block = 2 * (np.arange(edges_v[0], edges_v[2]) >= edges_v[1]).astype(np.int32)
    samples = len(column_block) * max(k * k, 1)
    step = max(1, PIECE // samples)
    for low in range(edges_v[0], edges_v[2], step):
        high = min(low + step, edges_v[2])
        x, y, z = sampled_normals(normals, range(low, high), range(edges_u[0], edges_u[2]), k)
        hidden = z <= 0
        index = _bins(y, z, hidden, scale[1], offset[1], corners)
        index *= corners + 1
        index += _bins(x, z, hidden, scale[0], offset[0], corners)
        index *= 4
        index += column_block + row_block[low - edges_v[0] : high - edges_v[0], None]
        np.add.at(found.reshape(-1), index.reshape(-1), 1)
        done(samples * (high - low))

    # Corner 0 is below all bins, so its counts are 0; sums of integers are exact.
    found[0] = 0
    found[:, 0] = 0
    below = found[:corners, :corners].cumsum(axis=0).cumsum(axis=1)
    return (below / max(k * k, 1)).astype(np.float32)


def sampled_normals(normals: np.ndarray, rows: range, columns: range, k: int) -> np.ndarray:
    """Normals of the elements at `rows` and `columns`, as float32 (3, ..., rows, columns).

    k = 0: the texels. Else the patches between them and their right and upper neighbours (the map repeats), at points
    (a + 0.5) / k along each axis: (3, k along v, k along u, rows, columns). Only the last row's and column's neighbours
    may lie beyond the map.
    """
    if k == 0:
        return np.ascontiguousarray(np.moveaxis(_texels(normals, rows, columns), -1, 0))
    height, width = normals.shape[:2]
    tile = np.empty((3, len(rows) + 1, len(columns) + 1), np.float32)  # a plane a component: numpy is fast along rows
    right, upper = columns.stop % width, rows.stop % height
    for part, j in ((slice(0, -1), rows), (slice(-1, None), range(upper, upper + 1))):
        tile[:, part, :-1] = np.moveaxis(_texels(normals, j, columns), -1, 0)
        tile[:, part, -1:] = np.moveaxis(_texels(normals, j, range(right, right + 1)), -1, 0)
    points = ((np.arange(k, dtype=np.float32) + np.float32(0.5)) / np.float32(k))[:, None, None]
    along = points * np.diff(tile, axis=2)[:, None]
    along += tile[:, None, :, :-1]
    between = points[:, None] * np.diff(along, axis=2)[:, None]
    between += along[:, None, :, :-1]
    return between


def _texels(normals: np.ndarray, rows: range, columns: range) -> np.ndarray:
    return normals[rows.start : rows.stop, columns.start : columns.stop]


def _bins(
    across: np.ndarray, z: np.ndarray, hidden: np.ndarray, scale: np.float32, offset: np.float32, corners: int
) -> np.ndarray:
    """Bin + 1 of the slope across / z along one axis, int32; 0 below the box and where hidden, `corners` above it."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        place = across / z
        place *= scale
        place += offset
    place[hidden] = 0
    np.clip(place, 0, corners, out=place)
    return place.astype(np.int32)
