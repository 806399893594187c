"""The texels of a triangle that a picture sees, in boxes that are computed at once, divided where they are large.

Texel coordinates (s, t) are UV times the map's size, over all its repeats; (s, t, 1) are their homogeneous ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .exact_lobe import FILTER_REACH, gauss_legendre
from .exact_scene import Triangle

# Points along each axis, at least: in larger texels view and filter vary. With 8, 16, 32 the error of flakes_close,
# whose texels are the largest, is 0.2, 0.1, 0.04 %.
CELLS_A_PIXEL = 16
MOST_PARTS = 128  # points along each axis of a texel: of 8 pixels
CELLS = 1 << 14  # that are computed at once: their arrays stay in the processor's cache


@dataclass(frozen=True)
class Patch:
    """A triangle in texel coordinates (s, t): each matrix takes (s, t, 1) to what it is named after."""

    triangle: Triangle
    corners: np.ndarray  # (3, 2), texels
    raster: np.ndarray  # (3, 3), homogeneous pixels
    places: np.ndarray  # (3, 3)
    normals: np.ndarray
    tangents: np.ndarray


def patch_of(triangle, camera, map_size) -> Patch:
    """The triangle in texels of a map of `map_size` = (width, height)."""
    corners = triangle.uv * map_size
    inverse = np.linalg.inv(np.column_stack([corners, np.ones(3)]).T)
    places = triangle.places.T @ inverse
    raster = camera.raster @ np.concatenate([places, np.ones(3)[None] @ inverse])
    return Patch(triangle, corners, raster, places, triangle.normals.T @ inverse, triangle.tangents.T @ inverse)


def boxes(patch, size):
    """Yield ((s0, t0, s1, t1), (parts along s, along t)): the texels that the picture sees, in boxes of about CELLS
    cells. size: (width, height) of the picture in pixels."""
    low, high = np.floor(patch.corners.min(axis=0)), np.ceil(patch.corners.max(axis=0))
    waiting = [(*low.astype(int), *high.astype(int))]
    while waiting:
        s0, t0, s1, t1 = box = waiting.pop()
        corners = np.array([(s0, t0, 1), (s1, t0, 1), (s1, t1, 1), (s0, t1, 1)], np.float64)
        seen = corners @ patch.raster.T
        before = seen[:, 2] > 0.0
        if not before.any() or (_edges(patch.corners, corners[:, :2]) < 0.0).all(axis=1).any():
            continue
        parts = (1, 1)
        if before.all():
            raster = seen[:, :2] / seen[:, 2:]
            reach = FILTER_REACH + 1
            if (raster.max(axis=0) < -reach).any() or (raster.min(axis=0) > np.add(size, reach)).any():
                continue
            parts = _parts(patch, seen, raster)
        count = (s1 - s0) * (t1 - t0) * parts[0] * parts[1]
        if count > CELLS and (s1 - s0 > 1 or t1 - t0 > 1) or not before.all():
            waiting += _halves(box)
        else:
            yield box, parts


def cells_of(patch, box, parts, size):
    """Points (n, 3) as (s, t, 1) of the box's texels that are inside the triangle and seen, and their shares (n,) of
    a texel: those of Gauss-Legendre, `parts` along each axis."""
    (s, share_s), (t, share_t) = (_points(box[axis], box[axis + 2], parts[axis]) for axis in (0, 1))
    cells = np.stack([*np.meshgrid(s, t), np.ones((len(t), len(s)))], axis=-1).reshape(-1, 3)
    shares = np.outer(share_t, share_s).ravel()
    seen = cells @ patch.raster.T
    raster = seen[:, :2] / seen[:, 2:]
    kept = ((raster > -FILTER_REACH) & (raster < np.add(size, FILTER_REACH))).all(axis=1)
    kept[kept] = _inside(patch.corners, cells[kept, :2])
    return cells[kept], shares[kept]


def _parts(patch, seen, raster):
    """Into how many parts a texel of the box is divided along s and t; seen: its corners, homogeneous."""
    along = [
        np.linalg.norm((patch.raster[:2, axis] - raster * patch.raster[2, axis]) / seen[:, 2:], axis=1).max()
        for axis in (0, 1)
    ]
    return tuple(int(np.clip(np.ceil(CELLS_A_PIXEL * length), 1, MOST_PARTS)) for length in along)


def _halves(box):
    s0, t0, s1, t1 = box
    if s1 - s0 >= t1 - t0:
        middle = (s0 + s1) // 2
        return [(s0, t0, middle, t1), (middle, t0, s1, t1)] if s1 - s0 > 1 else []
    middle = (t0 + t1) // 2
    return [(s0, t0, s1, middle), (s0, middle, s1, t1)]


def _points(first, last, parts):
    """Points in the texels from `first` to before `last` along one axis, and their shares of a texel."""
    nodes, weights = gauss_legendre(parts)
    points = np.arange(first, last)[:, None] + (nodes + 1.0) / 2.0
    return points.ravel(), np.tile(weights / 2.0, last - first)


def _edges(corners, points):
    """How far `points` (n, 2) lie inside each edge, (3, n), times the edge's length.

    An edge is computed from its smaller corner, so that the triangle on its other side finds exactly the negative: a
    point on the edge belongs to one of them (see `_inside`).
    """
    turn = np.sign(np.linalg.det(np.column_stack([corners, np.ones(3)])))
    found = []
    for first, second in ((0, 1), (1, 2), (2, 0)):
        a, b = corners[first], corners[second]
        ahead = 1.0 if tuple(a) < tuple(b) else -1.0
        if ahead < 0.0:
            a, b = b, a
        found.append(turn * ahead * ((b - a)[0] * (points[:, 1] - a[1]) - (b - a)[1] * (points[:, 0] - a[0])))
    return np.array(found)


def _inside(corners, points):
    turn = np.sign(np.linalg.det(np.column_stack([corners, np.ones(3)])))
    ahead = [tuple(corners[first]) < tuple(corners[second]) for first, second in ((0, 1), (1, 2), (2, 0))]
    owned = np.array([(turn > 0.0) == each for each in ahead])[:, None]
    distance = _edges(corners, points)
    return ((distance > 0.0) | (owned & (distance == 0.0))).all(axis=0)
