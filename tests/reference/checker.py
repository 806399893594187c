"""The 3D checker in numpy: the plain one as written, and its mean over a Gaussian by brute force."""

from __future__ import annotations

import numpy as np

SIDE = 400  # points along each axis of the Gaussian: stratified, so the mean of an edge is good to about 1e-3


def checker_is_first(points) -> np.ndarray:
    """Whether points (..., 3), in radians, have color 1: sin(x) sin(y) sin(z) < 0."""
    return np.prod(np.sin(points), axis=-1) < 0


def edge_distance(points) -> np.ndarray:
    """Distance in radians of points (..., 3) to the nearest plane where a sine is 0."""
    return np.abs(points - np.pi * np.round(points / np.pi)).min(axis=-1)


def checker_share(point, long_axis, short_axis, random) -> float:
    """Share of color 1 in a Gaussian on the plane through `point` whose standard deviations are the two axes."""
    cells = np.arange(SIDE)
    first = _normal_quantile((cells[:, None] + random.uniform(size=(SIDE, SIDE))) / SIDE)
    second = _normal_quantile((cells[None, :] + random.uniform(size=(SIDE, SIDE))) / SIDE)
    points = point + first[..., None] * long_axis + second[..., None] * short_axis
    return float(checker_is_first(points).mean())


def _normal_quantile(probabilities):
    """Inverse of the normal distribution, by interpolation in a table of its integral."""
    x = np.linspace(-6, 6, 20001)
    integral = np.cumsum(np.exp(-0.5 * x * x))
    return np.interp(probabilities, integral / integral[-1], x)
