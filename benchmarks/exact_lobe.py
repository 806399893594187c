"""What Cycles 5.2 computes for one sample of Blender's Glossy BSDF, in numpy: pixel filter, normal, lobe, light's disc.

Facts are read in Cycles' sources, named at each function; directions are unit vectors in world space, (..., 3).
"""

from __future__ import annotations

import functools

import numpy as np

TABLE = 1024  # FILTER_TABLE_SIZE of kernel/types.h
STEPS = 1024  # bins of the filter's density in a pixel: a texel of a sharp scene is ten of them wide
SMOOTHED = 1 / 32  # pixels over which the density is averaged: widens the filter's variance by 0.1 %
FILTER_REACH = 1  # pixels on each side of the sample's own that a filter 1.5 wide reaches
SLOPES_APART = 5.0  # alphas from the half vector beyond which a Beckmann lobe is 0: exp(-25) of its peak


def filter_density(width=1.5) -> np.ndarray:
    """Samples per pixel width that fall at x - p, in STEPS bins a pixel from -1 to 2; p is the pixel's left edge.

    Of the inverted cumulative Blackman-Harris window that Cycles reads with one random number (scene/film.cpp,
    util/math_cdf.cpp, kernel/util/lookup_table.h), with its flaw: the last entry stays 0, so that a sample in 1023 is
    spread evenly from 2 to 0.
    """
    # Sum the window from the middle to the rim, as util_cdf_evaluate does.
    phase = np.pi * np.arange(TABLE - 1) / (TABLE - 2) + np.pi
    window = np.array([0.35875, -0.48829, 0.14128, -0.01168]) @ np.cos(np.arange(4)[:, None] * phase)
    cumulative = np.concatenate([[0.0], np.cumsum(np.abs(window))])
    cumulative /= cumulative[-1]

    # Invert it at equal steps; the second half of the table mirrors the first.
    half = (TABLE - 1) // 2
    wanted = np.arange(half + 1) / half
    after = np.searchsorted(cumulative, wanted, side="right")
    index = np.minimum(after, TABLE - 2)
    share = (wanted - cumulative[index]) / (cumulative[index + 1] - cumulative[index])
    distance = width * np.where(after < TABLE - 1, index + share, TABLE - 1) / (TABLE - 1)
    table = 0.5 + np.concatenate([-distance[:0:-1], distance])

    # Between entries samples are spread evenly: their density is a staircase, whose steps would be noise.
    middles = -1.0 + (np.arange(3 * STEPS) + 0.5) / STEPS
    low, high = (np.interp(x, table, np.arange(TABLE - 1)) + np.clip(x / table[-1], 0.0, 1.0)
                 for x in (middles - SMOOTHED / 2, middles + SMOOTHED / 2))
    return (high - low) / (TABLE - 1) / SMOOTHED


def disc_points(rings) -> np.ndarray:
    """Points (n, 2) and weights, in all (n, 3), whose weighted mean is that over the unit disc; exact to degree
    4 rings - 1: Gauss-Legendre in the radius squared, equal angles (Abramowitz and Stegun 1964, 25.4.61)."""
    nodes, weights = gauss_legendre(rings)
    radius = np.sqrt((nodes + 1.0) / 2.0)
    angles = (np.arange(4 * rings) + 0.5) * np.pi / (2 * rings)
    places = radius[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    share = np.broadcast_to(weights[:, None, None] / (8 * rings), (rings, 4 * rings, 1))
    return np.concatenate([places, share], axis=-1).reshape(-1, 3)


@functools.cache
def gauss_legendre(count) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on -1..1."""
    return np.polynomial.legendre.leggauss(count)


def rings_of(radius_in_alphas) -> int:
    """Rings that integrate a lobe over a light's disc of so many alphas, seen from the half vector, to 0.1 %."""
    return 1 + int(np.ceil(2.0 * radius_in_alphas))


def valid_normals(normals, geometric, view) -> np.ndarray:
    """Normals raised where a mirror would reflect the view below the surface (`ensure_valid_specular_reflection` of
    kernel/closure/bsdf_util.h). geometric: (3,) of the face."""
    height = view @ geometric
    threshold = np.minimum(0.9 * height, 0.01)
    mirrored = 2.0 * dot(normals, view) * (normals @ geometric) - height
    low = mirrored < threshold
    if not low.any():
        return normals
    n, v, z, t = normals[low], view[low], height[low], threshold[low]
    across = n - (n @ geometric)[:, None] * geometric
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), np.finfo(float).tiny)
    x = dot(v, across)

    # Solve 4 a n^4 - 2 b n^2 + c = 0 for the height of the normal whose mirror direction is at the threshold.
    a, b, c = x * x + z * z, 2.0 * (x * x + z * z + z * t), (t + z) ** 2
    root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
    square = 0.25 * np.where(x < 0.0, b + root, b - root) / a
    raised = np.sqrt(np.maximum(1.0 - square, 0.0))[:, None] * across
    found = normals.copy()
    found[low] = raised + np.sqrt(np.maximum(square, 0.0))[:, None] * geometric
    return found


def lobe(distribution, alpha, normals, view, light) -> np.ndarray:
    """The Glossy BSDF times the light's cosine (`bsdf_microfacet_eval` of kernel/closure/bsdf_microfacet.h).

    distribution: "BECKMANN" or "GGX"; Smith's masking correlated in height (Heitz, JCGT 3(2), 2014); no Fresnel.
    """
    cos_view, cos_light = dot(normals, view), dot(normals, light)
    seen = (cos_view > 0.0) & (cos_light > 0.0)
    cos_view, cos_light = np.where(seen, cos_view, 1.0), np.where(seen, cos_light, 1.0)
    between = view + light
    cos_half_2 = np.minimum(dot(normals, between) ** 2 / dot(between, between), 1.0)
    masking = 1.0 + _hidden(distribution, alpha, cos_view) + _hidden(distribution, alpha, cos_light)
    return np.where(seen, _density(distribution, alpha, cos_half_2) / (4.0 * cos_view * masking), 0.0)


def dot(a, b) -> np.ndarray:
    """Scalar products of vectors (..., 3)."""
    return np.einsum("...i,...i->...", a, b)


def cross(a, b) -> np.ndarray:
    """Vector products of vectors (..., 3); numpy's own takes several times as long."""
    found = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        found[..., axis] = a[..., first] * b[..., second] - a[..., second] * b[..., first]
    return found


def _density(distribution, alpha, cos_2):
    """Microfacets' normals in a solid angle, by the cosine squared to the normal."""
    sin_2, alpha_2 = 1.0 - cos_2, alpha * alpha
    if distribution == "GGX":
        return alpha_2 / (np.pi * (sin_2 + alpha_2 * cos_2) ** 2)
    return np.exp(-sin_2 / (cos_2 * alpha_2)) / (np.pi * alpha_2 * cos_2 * cos_2)


def _hidden(distribution, alpha, cosine):
    """Smith's lambda: Heitz 2014, equation 72 for GGX, the fit below equation 69 for Beckmann."""
    square = alpha * alpha * np.maximum(1.0 / (cosine * cosine) - 1.0, 0.0)
    if distribution == "GGX":
        return 0.5 * (np.sqrt(1.0 + square) - 1.0)
    a = 1.0 / np.sqrt(np.maximum(square, 0.39))
    return np.where(square < 0.39, 0.0, ((0.396 * a - 1.259) * a + 1.0) / ((2.181 * a + 3.535) * a))
