"""Numpy twin of osl/visits.h by brute force: all elements around each footprint are listed, and tested in float64.

What is visited is one row for each visit of any of the queries, whose number is in `row`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .footprint import KERNEL_VARIANCE, ellipse_square, footprint_ellipse, footprint_kernel, footprint_sample
from .map import map_normal, map_patch, patch_columns, patch_normal, patch_rows
from .query import MODE_ALL, MODE_POINTS, above_margin, selecting_hint, spread_over_part

SURE_WEIGHT = 0.75
POINTS_PER_TEXEL = 4.0
FEWEST_POINTS = 8
LARGEST_VISIT = 4096
LARGEST_SPREAD = 1 / np.sqrt(48)  # texels
PLASTIC = 1.324717957244746  # the real root of x^3 = x + 1
CLOSE = 1e-3  # texels: rounding may take a point so near to a texel's edge to the next texel


@dataclass
class Visits:
    """Elements to visit: texels or patches (i, j), offsets of the texel's middle or the patch's corner from the hit.

    place: (m, 6), where only a part of each patch is visited: (a, b), and two offsets of one deviation.
    unclear: whether rounding may decide which element this is, or whether it is visited.
    """

    row: np.ndarray
    i: np.ndarray
    j: np.ndarray
    offset_u: np.ndarray
    offset_v: np.ndarray
    weight: np.ndarray
    unclear: np.ndarray
    place: np.ndarray | None = None

    def at(self, rows):
        values = (self.row, self.i, self.j, self.offset_u, self.offset_v, self.weight, self.unclear)
        return Visits(*(value[rows] for value in values), None if self.place is None else self.place[rows])


@dataclass
class Selected:
    """Selected elements: their hint, and their lobe (m, 6) as in OSL's SlopeLobe; unclear: (queries,) bool, whether
    rounding may decide about one of a query's elements."""

    row: np.ndarray
    hint: np.ndarray
    lobe: np.ndarray
    unclear: np.ndarray


def visit_rows(footprint, u, v, is_linear, *, sure=0.0, odds=0.0):
    """Sum (n,) of the kernel's weights, and Visits, of all elements in footprints around (u, v), by rows and columns.

    Elements lighter than `sure` are drawn where the sum of their odds passes a whole number.
    """
    form, reach = footprint_ellipse(footprint.axes(), np.zeros((len(u), 2)))
    side = int(np.ceil(reach.max())) + 1
    steps = np.arange(-side, side + 1)
    rows, down, right = (index.ravel() for index in np.meshgrid(np.arange(len(u)), steps, steps, indexing="ij"))
    i, j = np.floor(u).astype(int)[rows] + right, np.floor(v).astype(int)[rows] + down
    offset = np.stack([i + 0.5 - u[rows], j + 0.5 - v[rows]], axis=1)
    weight = footprint_kernel(ellipse_square(form[rows], offset))
    inside = weight > 0
    rows, i, j, offset, weight = rows[inside], i[inside], j[inside], offset[inside], weight[inside]
    total = np.bincount(rows, weight, len(u))
    corner = 0.5 if is_linear else 0.0
    visits = Visits(rows, i, j, *(offset - corner).T, weight, np.zeros(len(rows), bool))
    if sure == 0.0:
        return total, visits
    light = weight < sure
    sums = np.cumsum(np.where(light, weight / sure, 0.0))
    first = np.concatenate([[True], rows[1:] != rows[:-1]])
    before = np.concatenate([[0.0], sums[:-1]])
    start = before[first][np.cumsum(first) - 1] - np.broadcast_to(odds, len(u))[rows]
    drawn = ~light | (np.floor(sums - start) > np.floor(before - start))
    visits.unclear = light & (np.abs(sums - start - np.round(sums - start)) < 1e-4)
    visits.weight = np.where(light, sure, weight)
    return total, visits.at(drawn | visits.unclear)


def visit_points(footprint, u, v, random, points, is_linear, is_thin):
    """Visits of `points` (n,) elements of each footprint, at points drawn from the kernel. random: (n, 2)."""
    rows = np.repeat(np.arange(len(u)), points)
    k = np.arange(len(rows)) - np.repeat(np.cumsum(points) - points, points)
    a, b = (random[rows] + k[:, None] * [1 / PLASTIC, 1 / PLASTIC**2]).T % 1
    axes = footprint.axes()
    middle = np.stack([u, v], axis=1)[rows]
    point = middle + np.einsum("nij,nj->ni", axes[rows], np.stack(footprint_sample(a, b), axis=1))
    column, line = np.floor(point).astype(int).T
    share = np.minimum(np.sqrt(KERNEL_VARIANCE / points), LARGEST_SPREAD / footprint.long_axis)[rows]
    parts = share[:, None, None] * axes[rows].transpose(0, 2, 1)
    place = np.concatenate([point - np.floor(point), parts.reshape(-1, 4)], axis=1)
    corner = np.floor(point) if is_linear else point
    offset = corner - middle
    near = (np.abs(point - np.round(point)) < CLOSE).any(axis=1)
    return Visits(rows, column, line, *offset.T, np.ones(len(rows)), near, place if is_thin and is_linear else None)


def points_of(mode, footprint, visits):
    """Points (n,) that visit_elements visits in the modes POINTS and SUBSET."""
    if mode != MODE_POINTS:
        return np.full(len(footprint.area), visits)
    wanted = POINTS_PER_TEXEL * 2 * footprint.long_axis * np.maximum(2 * footprint.short_axis, 1.0)
    return np.clip(np.ceil(wanted), FEWEST_POINTS, LARGEST_VISIT).astype(int)


def visit_elements(footprint, u, v, random, mode, visits, is_linear, sure):
    """Sum (n,) of all weights, and Visits, in one of the modes POINTS, ALL and SUBSET; random: (n, 2)."""
    if mode == MODE_ALL:
        return visit_rows(footprint, u, v, is_linear, sure=sure, odds=random[:, 0])
    points = points_of(mode, footprint, visits)
    return points.astype(float), visit_points(footprint, u, v, random, points, is_linear, mode == MODE_POINTS)


def visit_texel(hints, normals, strength, visits, queries, between=(0, 8)):
    """Selected texels; hints, strength: of each of the `queries`. Hints outside `between` select for another visit."""
    found, slopes, margin = selecting_hint(
        [hint.at(visits.row) for hint in hints], map_normal(normals, strength[visits.row], visits.i, visits.j),
        visits.offset_u, visits.offset_v,
    )
    lobe = np.concatenate([visits.weight[:, None], slopes, np.zeros((len(found), 3))], axis=1)
    return kept(visits, found, lobe, margin, queries, between)


def visit_patch(hints, normals, strength, alpha, visits, queries, between=(0, 8)):
    """Selected parts of patches."""
    patch = map_patch(normals, strength[visits.row], visits.i, visits.j)
    if visits.place is None:
        (columns, exact_columns), (rows, exact_rows) = (
            parts(patch, alpha[visits.row]) for parts in (patch_columns, patch_rows)
        )
        visits.unclear |= np.minimum(*(np.abs(exact - np.round(exact)) for exact in (exact_columns, exact_rows))) < 1e-4
        which = np.repeat(np.arange(len(columns)), columns * rows)
        number = np.arange(len(which)) - np.repeat(np.cumsum(columns * rows) - columns * rows, columns * rows)
        columns, rows = columns[which], rows[which]
        a, b = (number % columns + 0.5) / columns, (number // columns + 0.5) / rows
        zero, deviation = np.zeros(len(which)), np.sqrt(1 / 12)  # of a uniform distribution over 0..1
        place = np.stack([a, b, deviation / columns, zero, zero, deviation / rows], axis=1)
        share = columns * rows
    else:
        which, place, share = np.arange(len(patch)), visits.place, 1
    visits, patch = visits.at(which), patch[which]
    a, b = place[:, :2].T
    many = [hint.at(visits.row) for hint in hints]
    found, slopes, margin = selecting_hint(many, patch_normal(patch, a, b), visits.offset_u + a, visits.offset_v + b)
    above = above_margin(many, found, patch)
    found, margin = np.where(above > 0, found, -1), np.minimum(margin, np.abs(above))
    covariance = np.stack([spread_over_part(hint, patch, a, b, place[:, 2:4], place[:, 4:]) for hint in many])
    covariance = covariance[np.maximum(found, 0), np.arange(len(found))]
    lobe = np.concatenate([(visits.weight / share)[:, None], slopes, covariance], axis=1)
    return kept(visits, found, lobe, margin, queries, between)


def kept(visits, found, lobe, margin, queries, between):
    """Selected of what hints select, and which queries are unclear."""
    unclear = np.zeros(queries, bool)
    unclear[visits.row[visits.unclear | (margin < 1e-4)]] = True
    selected = (found >= between[0]) & (found < between[1])
    return Selected(visits.row[selected], found[selected], lobe[selected], unclear)
