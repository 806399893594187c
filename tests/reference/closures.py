"""Numpy twin of osl/closures.h and of the closure of osl/facet.h, shown by the light that each reflects, (n,).

view and light: unit vectors (n, 3) from the surface. Reflected of a sun of irradiance 1: the BSDF times the cosine.
"""

from __future__ import annotations

import numpy as np

from .facet import facet_gain
from .selection import LEAST_SHARE

LEAST_WEIGHT = 2e-5


def dot(a, b):
    return np.einsum("nk,nk->n", a, b)


def unit(a):
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def smith_lambda(is_ggx, square):
    """Smith's Lambda of a direction; square: its squared alpha times its squared tangent. Cycles has Walter's
    approximation for Beckmann (Microfacet Models for Refraction through Rough Surfaces, 2007)."""
    a = 1 / np.sqrt(np.maximum(square, 1e-30))
    beckmann = np.where(a < 1.6, (1 - 1.259 * a + 0.396 * a * a) / (3.535 * a + 2.181 * a * a), 0.0)
    return np.where(is_ggx, 0.5 * (np.sqrt(1 + square) - 1), beckmann)


def microfacet(is_ggx, n, axis, alpha_x, alpha_y, view, light):
    """A microfacet closure of Cycles, without Fresnel; alpha_x along `axis` (n, 3); Cycles lets no alpha be above 1."""
    alpha_x, alpha_y = np.minimum(alpha_x, 1.0), np.minimum(alpha_y, 1.0)
    y = unit(np.cross(n, axis))
    x = np.cross(y, n)
    h = unit(view + light)
    cosines = np.stack([dot(w, n) for w in (view, light, h)])
    slopes = np.stack([(dot(w, x) * alpha_x) ** 2 + (dot(w, y) * alpha_y) ** 2 for w in (view, light)])
    slopes = slopes / cosines[:2] ** 2
    square = ((dot(h, x) / alpha_x) ** 2 + (dot(h, y) / alpha_y) ** 2) / cosines[2] ** 2
    shape = np.where(is_ggx, (1 + square) ** -2, np.exp(-square)) / (np.pi * alpha_x * alpha_y * cosines[2] ** 4)
    masking = 1 + smith_lambda(is_ggx, slopes[0]) + smith_lambda(is_ggx, slopes[1])
    return np.where((cosines[:2] > 0).all(axis=0), shape / (4 * cosines[0] * masking), 0.0)


def facet_closure(is_ggx, alpha, n, view, light):
    """One facet of the unit normal n."""
    across = unit(np.where(np.abs(n[:, :1]) < 0.5, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    return microfacet(is_ggx, n, across, alpha, alpha, view, light)


def element_normal(hint, lobe):
    """Unit normals at the slopes of lobes (n, 6)."""
    return unit(hint.h + np.einsum("ns,nsk->nk", lobe[:, 1:3], hint.axes))


def covariance_of(lobe):
    return lobe[:, [3, 4, 4, 5]].reshape(-1, 2, 2)


def glint_closure(is_ggx, alpha, hint, lobe, view, light):
    """One element: its covariance widens the facet's lobe, along the axes of the covariance."""
    shrink = (1 + (lobe[:, 1:3] ** 2).sum(axis=1)) ** -1.5
    gain = facet_gain(is_ggx, alpha, hint.radius) * shrink
    values, vectors = np.linalg.eigh(covariance_of(lobe))
    squares = alpha[:, None] ** 2 + gain[:, None] * values
    is_round = (squares[:, 1] - squares[:, 0]) / 2 < 0.01 * alpha**2
    squares = np.where(is_round[:, None], squares.mean(axis=1, keepdims=True), squares)
    squares = np.maximum(squares, LEAST_SHARE * alpha[:, None] ** 2)
    axis = np.einsum("ns,nsk->nk", vectors[:, :, 1], hint.axes)
    return microfacet(is_ggx, element_normal(hint, lobe), axis, *np.sqrt(squares[:, ::-1]).T, view, light)


def merged_reflection(hint, alpha, lobe, view):
    """Reflection of those facets of a cell that mirror the light, relative to the reflection of its mean normal."""
    s = 0.5 * alpha[:, None, None] ** 2 * np.eye(2)
    slope = lobe[:, 1:3]
    mirror = np.einsum("nij,nj->ni", s @ np.linalg.inv(s + covariance_of(lobe)), slope)
    mirror = np.where((np.minimum(lobe[:, 3], lobe[:, 5]) > 0)[:, None], mirror, slope)
    cosines = []
    for at in (slope, mirror):
        cosines.append(dot(unit(hint.h + np.einsum("ns,nsk->nk", at, hint.axes)), view))
    both = (cosines[0] > 0) & (cosines[1] > 0)
    return np.where(both, cosines[0] / np.where(both, cosines[1], 1.0), 1.0)
