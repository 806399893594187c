"""Truths without noise: a Closest map on one plane or sphere under suns and small lamps, summed texel by texel.

A pixel of Cycles is the mean over samples that its pixel filter spreads in the picture. Each sees one texel, and the
lobe there is a known function of view, light and the texel's normal. So the pixel is the sum over texels of filter x
projected area x the lobe's integral over each light's disc, with all of them varying over the surface. What light the
surface throws on itself is left out, so that it must be convex; the rest of a scene is checked by `exact_scene`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glint_addon.nodes.map_choices import DISTRIBUTION

from . import exact_scene
from .exact_cells import boxes, cells_of, patch_of
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

FAR_TERMS = 10.0  # alphas from the half vector beyond which GGX hardly varies over a small light


@dataclass(frozen=True)
class Facets:
    """The surface: decoded normals of the map (height, width, 3), not unit; "BECKMANN" or "GGX"; alpha."""

    normals: np.ndarray
    distribution: str
    alpha: float


def closest_facets(normal_map, *, roughness, interpolation, distribution=DISTRIBUTION.default) -> Facets:
    """Those of an encoded normal map (height, width, 3) in `create_glint_material`'s settings of these names.

    Raises ValueError unless the map is read by the Closest texel: between texels there is no finite sum.
    """
    if interpolation != "CLOSEST":
        raise ValueError("An exact truth needs a map that is read by the Closest texel: render this one.")
    return Facets(np.asarray(normal_map, np.float64) * 2.0 - 1.0, distribution, roughness**2)


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
        patch = patch_of(triangle, camera, facets.normals.shape[1::-1])
        for box, parts in boxes(patch, size):
            cells, shares = cells_of(patch, box, parts, size)
            if len(cells):
                _add(picture, _light(patch, cells, facets, camera, lights) * shares, cells, patch, density)
    return picture[FILTER_REACH:-FILTER_REACH, FILTER_REACH:-FILTER_REACH]


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
    return found


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
