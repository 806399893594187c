"""Truths without noise: a Closest map on one plane or sphere under suns and small lamps, summed texel by texel.

A pixel of Cycles is the mean over samples that its pixel filter spreads in the picture. Each sees one texel, and the
lobe there is a known function of view, light and the texel's normal. So the pixel is the sum over texels of filter x
projected area x the lobe's integral over each light's disc, with all of them varying over the surface. What light the
surface throws on itself is left out, so that it must be convex; the rest of a scene is checked by `exact_scene`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import exact_scene
from .exact_lobe import (
    FILTER_REACH,
    SLOPES_APART,
    STEPS,
    cross,
    disc_points,
    dot,
    filter_density,
    lobe,
    rings_of,
    valid_normals,
)

CELLS_A_PIXEL = 8  # along each axis, at least: larger texels are divided, because view and filter vary in them
MOST_PARTS = 64  # along each axis of a texel: of 8 pixels
CELLS = 1 << 14  # that are computed at once: their arrays stay in the processor's cache
FAR_TERMS = 10.0  # alphas from the half vector beyond which GGX hardly varies over a small light


@dataclass(frozen=True)
class Facets:
    """The surface: decoded normals of the map (height, width, 3), not unit; "BECKMANN" or "GGX"; alpha; luminance."""

    normals: np.ndarray
    distribution: str
    alpha: float
    tint: float = 1.0


@dataclass(frozen=True)
class Patch:
    """A triangle in texel coordinates (s, t): each matrix takes (s, t, 1) to what it is named after."""

    triangle: exact_scene.Triangle
    corners: np.ndarray  # (3, 2), texels
    raster: np.ndarray  # (3, 3), homogeneous pixels
    places: np.ndarray  # (3, 3)
    normals: np.ndarray
    tangents: np.ndarray


def exact_picture(scene, facets) -> np.ndarray:
    """Linear luminance (height, width) of `scene`, row 0 at the bottom, whose only mesh has `facets`.

    Raises ValueError for a scene that cannot be summed.
    """
    scene.view_layers[0].update()
    camera, lights = exact_scene.camera(scene), exact_scene.lights(scene)
    size = scene.render.resolution_x, scene.render.resolution_y
    picture = np.zeros((size[1] + 2 * FILTER_REACH, size[0] + 2 * FILTER_REACH))
    density = filter_density(scene.cycles.filter_width)
    for triangle in exact_scene.triangles(scene):
        if dot(triangle.face_normal, camera.views(triangle.places)[0]) <= 0.0:
            continue
        patch = _patch(triangle, facets, camera)
        for box, parts in boxes(patch, size):
            cells, shares = _cells(patch, box, parts, size)
            if len(cells):
                _add(picture, _light(patch, cells, facets, camera, lights) * shares, cells, patch, density)
    return picture[FILTER_REACH:-FILTER_REACH, FILTER_REACH:-FILTER_REACH]


def boxes(patch, size):
    """Yield ((s0, t0, s1, t1), (parts along s, along t)): texels that the picture sees, in boxes of about CELLS cells."""
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


def _patch(triangle, facets, camera):
    height, width = facets.normals.shape[:2]
    corners = triangle.uv * (width, height)
    inverse = np.linalg.inv(np.column_stack([corners, np.ones(3)]).T)
    places = triangle.places.T @ inverse
    raster = camera.raster @ np.concatenate([places, np.ones(3)[None] @ inverse])
    return Patch(triangle, corners, raster, places, triangle.normals.T @ inverse, triangle.tangents.T @ inverse)


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


def _cells(patch, box, parts, size):
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


def _points(first, last, parts):
    """Points in the texels from `first` to before `last` along one axis, and their shares of a texel."""
    nodes, weights = np.polynomial.legendre.leggauss(parts)
    points = np.arange(first, last)[:, None] + (nodes + 1.0) / 2.0
    return points.ravel(), np.tile(weights / 2.0, last - first)


def _light(patch, cells, facets, camera, lights):
    """Luminance (n,) that the cells reflect to the viewer."""
    triangle = patch.triangle
    places = cells @ patch.places.T
    view = camera.views(places)
    normals = valid_normals(_mapped(patch, cells, facets), triangle.face_normal, view)
    found = np.zeros(len(cells))
    for light in lights:
        middle, radius = light.middles(places)
        between = view + middle
        length = np.sqrt(dot(between, between))
        cosine = dot(normals, between) / length
        slope = np.sqrt(1.0 / np.clip(cosine, 1e-3, 1.0) ** 2 - 1.0)
        spread = radius / length  # of the half vector, at most
        near = (slope < SLOPES_APART * facets.alpha + spread) & (cosine > 0.0)
        rings = rings_of(np.max(spread) / facets.alpha)
        groups = [(near, rings)]
        if facets.distribution == "GGX":
            near = slope < FAR_TERMS * facets.alpha + spread
            groups = [(near, rings), (~near, 1)]
        for group, count in groups:
            index = np.flatnonzero(group)
            if len(index):
                found[index] += _disc(light, places[index], normals[index], view[index], facets, triangle, count)
    return found * facets.tint


def _disc(light, places, normals, view, facets, triangle, rings):
    """The lobe's integral over the disc of one light, (n,)."""
    u, v, weight = (column[:, None] for column in disc_points(rings).T)
    direction, irradiance = light.sample(places, u, v)
    value = lobe(facets.distribution, facets.alpha, normals, view, direction) * irradiance * weight
    return np.where(direction @ triangle.face_normal > 0.0, value, 0.0).sum(axis=0)


def _mapped(patch, cells, facets):
    """Unit normals (n, 3) that the Normal Map node makes: the map's number times interpolated tangent, bitangent and
    normal, none of which is made unit before (`svm_node_normal_map` of kernel/svm/tex_coord.h)."""
    height, width = facets.normals.shape[:2]
    column, row = np.floor(cells[:, 0]).astype(int) % width, np.floor(cells[:, 1]).astype(int) % height
    mapped = facets.normals[row, column]
    normal, tangent = cells @ patch.normals.T, cells @ patch.tangents.T
    bitangent = patch.triangle.sign * cross(normal, tangent)
    found = mapped[:, :1] * tangent + mapped[:, 1:2] * bitangent + mapped[:, 2:] * normal
    return found / np.sqrt(dot(found, found))[:, None]


def _add(picture, light, cells, patch, density):
    """Add the light of cells to `picture`, which has a rim of FILTER_REACH pixels, by filter and projected area."""
    lit = light > 0.0
    seen = cells[lit] @ patch.raster.T
    raster = seen[:, :2] / seen[:, 2:]
    # A projection changes areas by its determinant over the third coordinate cubed.
    area = np.abs(np.linalg.det(patch.raster)) / seen[:, 2] ** 3
    pixel = np.floor(raster).astype(int)
    step = ((raster - pixel) * STEPS).astype(int)
    height, width = picture.shape
    for down in (-1, 0, 1):
        for left in (-1, 0, 1):
            x, y = pixel[:, 0] + left + FILTER_REACH, pixel[:, 1] + down + FILTER_REACH
            kept = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            weight = density[step[:, 0] + (1 - left) * STEPS] * density[step[:, 1] + (1 - down) * STEPS]
            value = light[lit] * area * weight
            picture += np.bincount((y * width + x)[kept], value[kept], height * width).reshape(height, width)
