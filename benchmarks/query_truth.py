"""The NDF of every query's footprint by binning samples, stored beside this file.

Compared is what facets mirror of a sun that is a point and shines with 1 W/m^2: for a half vector h, view v and a
normal n drawn from the footprint, E[D(h; n) / (4 n.v)], D the Beckmann distribution of alpha around n (Walter et al.,
Microfacet Models for Refraction, EGSR 2007, equations 20 and 25; shadowing is 1 at these angles and this alpha). The
footprint of half-width w around a point of the map is the density (1 - d^2 / w^2)^2 of distances d < w; n is what the
map shows there, interpolated or the texel's. Samples are stratified and come in two independent halves, whose
difference is their noise.

`python -m benchmarks.query --renew-truth` makes them again (ten minutes).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .query_scene import ALPHA, HALF_VECTORS, HALF_WIDTHS, MAPS, places, query_map, unit_normal

FILE = Path(__file__).resolve().parent / "query_truth.npz"
SAMPLES = 10**8  # for each map and half-width, shared by the footprints
SEED = 3


@dataclass(frozen=True)
class NdfTruth:
    """mean: float64 (half vectors, footprints); variance: of a mean, averaged over both; samples: of all footprints."""

    mean: np.ndarray
    variance: float
    samples: int

    @property
    def noise(self) -> float:
        """The truth's own relative RMSE."""
        return float(np.sqrt(self.variance) / self.mean.mean())


def stored(name, half_width) -> NdfTruth:
    """The truth of a map at one half-width. Raises FileNotFoundError if there is none: renew it."""
    with np.load(FILE) as data:
        index = HALF_WIDTHS.index(half_width)
        return NdfTruth(data[name][index].astype(np.float64), float(data[f"{name}_variance"][index]),
                        int(data["samples"]))


def renew():
    """Draw and store the samples of all maps and half-widths."""
    values = {"samples": SAMPLES}
    for name in MAPS:
        kind = query_map(name)
        results = [binned(kind, half_width) for half_width in HALF_WIDTHS]
        values[name] = np.stack([truth.mean for truth in results]).astype(np.float16)
        values[f"{name}_variance"] = np.array([truth.variance for truth in results])
    unfinished = FILE.with_suffix(".part.npz")
    np.savez_compressed(unfinished, **values)
    unfinished.replace(FILE)


def binned(kind, half_width, samples=SAMPLES) -> NdfTruth:
    """Draw at least `samples` normals from the footprints of `half_width` texels of a QueryMap."""
    rng = np.random.default_rng((SEED, half_width))
    centres = places() * kind.encoded.shape[0]
    strata = int(np.ceil(np.sqrt(samples / len(centres) / 2)))
    normals = 2.0 * kind.encoded.astype(np.float64) - 1.0
    halves = np.array([
        [brightness(shown_normals(normals, centre + half_width * kernel_points(strata, rng), kind.interpolation))
         for centre in centres]
        for _ in range(2)
    ])
    variance = np.mean((halves[0] - halves[1]) ** 2) / 4
    return NdfTruth(halves.mean(axis=0).T, float(variance), 2 * len(centres) * strata**2)


def kernel_points(strata, rng) -> np.ndarray:
    """strata^2 points (n, 2) of the unit disk with the footprint kernel's density; its radial CDF: 1 - (1 - r^2)^3."""
    cell = np.stack(np.meshgrid(np.arange(strata), np.arange(strata)), axis=-1).reshape(-1, 2)
    a, b = ((cell + rng.random(cell.shape)) / strata).T
    r = np.sqrt(1.0 - np.cbrt(1.0 - a))
    return np.stack([r * np.cos(2 * np.pi * b), r * np.sin(2 * np.pi * b)], axis=-1)


def shown_normals(normals, points, interpolation) -> np.ndarray:
    """Unit normals (n, 3) that the map (height, width, 3) shows at points in texels (n, 2); it repeats."""
    size = normals.shape[0]
    flat = normals.reshape(-1, 3)
    if interpolation == "CLOSEST":
        column, row = np.floor(points).astype(np.int64).T % size
        n = flat[row * size + column]
    else:
        low = np.floor(points - 0.5)
        a, b = (points - 0.5 - low).T[..., None]
        left, bottom = low.astype(np.int64).T % size
        right, top = (left + 1) % size, (bottom + 1) % size
        below = (1 - a) * flat[bottom * size + left] + a * flat[bottom * size + right]
        above = (1 - a) * flat[top * size + left] + a * flat[top * size + right]
        n = (1 - b) * below + b * above
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def brightness(normals) -> np.ndarray:
    """Mean of D(h; n) / (4 n.v) over unit normals (n, 3), for each of HALF_VECTORS; the view is (0, 0, 1)."""
    means = []
    for slope in HALF_VECTORS:
        cosine = normals @ unit_normal(slope)
        tangent2 = 1.0 / cosine**2 - 1.0
        ndf = np.exp(-tangent2 / ALPHA**2) / (np.pi * ALPHA**2 * cosine**4)
        means.append(np.mean(ndf / (4.0 * normals[:, 2])))
    return np.array(means)
