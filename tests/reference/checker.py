"""The 3D checker in numpy: the plain one as written, and its mean over a Gaussian by brute force."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from .footprint import cone_on_surface

CONSTANT_LIMIT = 0.08
SPECTRUM_REACH = 3.0
HIGHEST_OF_TWO, HIGHEST_OF_THREE, HIGHEST_HARMONIC = 31, 19, 63
SLICES = 64
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
    first = normal_quantile((cells[:, None] + random.uniform(size=(SIDE, SIDE))) / SIDE)
    second = normal_quantile((cells[None, :] + random.uniform(size=(SIDE, SIDE))) / SIDE)
    points = point + first[..., None] * long_axis + second[..., None] * short_axis
    return float(checker_is_first(points).mean())


def normal_quantile(probabilities):
    """Inverse of the normal distribution, by interpolation in a table of its integral."""
    x = np.linspace(-6, 6, 20001)
    integral = np.cumsum(np.exp(-0.5 * x * x))
    return np.interp(probabilities, integral / integral[-1], x)


def normal_slices():
    """Means (64,) of equal slices of a normal distribution."""
    normal = NormalDist()
    density = [0.0, *(normal.pdf(normal.inv_cdf(i / SLICES)) for i in range(1, SLICES)), 0.0]
    return SLICES * -np.diff(density)


def checker_points(points, long_axis, short_axis):
    """The 64 points (n, 64, 3) of a lattice over the Gaussian around each of `points` (n, 3)."""
    i = np.arange(SLICES)
    slices = normal_slices()
    first, second = slices, slices[(37 * i + 18) % SLICES]
    return points[:, None] + first[:, None] * long_axis[:, None] + second[:, None] * short_axis[:, None]


def odd_from(least):
    """Smallest odd number that is at least each of `least` (n,)."""
    odd = np.arange(-201, 202, 2)
    return odd[np.searchsorted(odd, least)]


def damped_wave(phase, middle, x, step, use_sine):
    """Sum over signed odd n up to 63 of sin or cos of phase + n x, over n, damped by exp(-|middle + n step|^2 / 2).

    Terms damped by more than SPECTRUM_REACH deviations are left out. middle, step: (n, 2). Also returns the distance of
    the closest term from that limit.
    """
    n = np.arange(-HIGHEST_HARMONIC, HIGHEST_HARMONIC + 1, 2)
    square = ((middle[:, None] + n[:, None] * step[:, None]) ** 2).sum(axis=2)
    angle = phase[:, None] + n * x[:, None]
    terms = np.where(use_sine[:, None], np.sin(angle), np.cos(angle)) * np.exp(-0.5 * square) / n
    return np.where(square <= SPECTRUM_REACH**2, terms, 0.0).sum(axis=1), np.abs(square - SPECTRUM_REACH**2).min(axis=1)


def checker_wave_mean(point, long_axis, short_axis):
    """Mean of sign(sin x) sign(sin y) sign(sin z) over a Gaussian, by a series of exponentials e^(i (k x + l y + m z)).

    Each square wave is the sum of 2 / (i pi k) e^(i k x) over signed odd k. All arguments are (3,).
    """
    axes = np.stack([long_axis, short_axis])
    spread = np.linalg.norm(axes, axis=0)
    constant = spread < CONSTANT_LIMIT
    mean = 1.0
    for x, width in zip(point[constant], spread[constant], strict=True):
        mean *= math.copysign(1, math.sin(x)) * math.erf(float(edge_distance(x[None])) / (math.sqrt(2) * width))
    highest = {1: HIGHEST_HARMONIC, 2: HIGHEST_OF_TWO, 3: HIGHEST_OF_THREE}[int((~constant).sum())]
    frequency, phase, factor = np.zeros((1, 2)), np.zeros(1), np.ones(1, complex)
    widest = np.argmax(spread)
    for axis in np.flatnonzero(~constant):
        most = HIGHEST_HARMONIC if axis == widest else highest
        n = np.arange(-most, most + 1, 2)
        frequency = (frequency[:, None] + n[:, None] * axes[:, axis]).reshape(-1, 2)
        phase = (phase[:, None] + n * point[axis]).ravel()
        factor = (factor[:, None] * (2 / (1j * np.pi * n))).ravel()
    square = (frequency**2).sum(axis=1)
    kept = square <= SPECTRUM_REACH**2
    total = (factor * np.exp(1j * phase - 0.5 * square))[kept].sum()
    return float(np.clip(mean * total.real, -1, 1))


def surface_footprint(dpdx, dpdy, view, geometric_normal, std_pixels):
    """Two standard deviations (n, 3) of each pixel's footprint on the surface."""
    surface = cone_on_surface(dpdx, dpdy, view, geometric_normal, std_pixels)
    steps = np.stack([dpdx, dpdy], axis=2)
    return tuple(np.moveaxis(steps @ surface, 2, 0))
