"""Grains: snow, sand, sugar, as grains with a few flat facets each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lattice import LARGEST_SPREAD, nearest, offsets, random_lattice
from .microstructure import CLOSEST, Generator, Microstructure, normals_of
from .settings import FACTOR, LENGTH, setting
from .tilts import cone_setting, distribution_setting, random_slopes, roughness_setting, tail_setting

MOST = 1024  # grains along a repeat: each takes memory for all its facets


@dataclass(frozen=True, kw_only=True)
class Grains(Generator):
    """Polygons that cover everything, each cut into facets of random tilt, on a dome if wanted.

    A facet is the part of its grain that is nearest to a random point in it. The dome adds to its tilt the slope that
    the dome has at this point, or, as far as the grain is worn, at each place.
    """

    kind = "GRAINS"
    label = "Grains"
    help = "Grains with a few flat facets of random tilt each: snow, sand, sugar"
    interpolation = CLOSEST

    size: float = setting(0.0005, "Size", "Mean width of a grain", low=1e-7, high=1.0, quantity=LENGTH)
    size_spread: float = setting(0.3, "Size Spread", "Standard deviation of the widths, in relation to their mean",
                                 low=0.0, high=LARGEST_SPREAD, quantity=FACTOR)
    facets: int = setting(4, "Facets", "How many flat facets a grain has", low=1, high=12)
    distribution: str = distribution_setting()
    roughness: float = roughness_setting(0.6)
    cone: float = cone_setting()
    tail: float = tail_setting()
    dome: float = setting(0.3, "Dome", "Slope of a round grain at its edge, which its facets follow; 0: facets lean at "
                          "random alone", low=0.0, high=4.0)
    worn: float = setting(0.0, "Worn", "How far grains are rounded: 0 is facets, 1 a smooth dome", low=0.0, high=1.0,
                          quantity=FACTOR)

    def made(self, resolution: int) -> Microstructure:
        columns = self.columns_of(self.size, "Size", MOST)
        lattice = random_lattice(columns, self.size_spread, self.random(0))
        grain = nearest(lattice, resolution)
        ids = self.random(1).random(lattice.count, np.float32)[grain]

        # The facets of all grains, their points in a disc as wide as a mean grain.
        rng, count = self.random(2), lattice.count * self.facets
        radius = 0.5 * np.sqrt(rng.random(count, np.float32))
        turn = rng.random(count, np.float32) * np.float32(2 * np.pi)
        points = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1).astype(np.float32)
        # Points from their common middle: the dome's slope is 0 there.
        points = points.reshape(lattice.count, self.facets, 2)
        points -= points.mean(axis=1, keepdims=True)
        points = points.reshape(count, 2)
        tilts = random_slopes(self, count, rng) * np.float32(1 - self.worn)

        place = offsets(lattice, grain)
        facet = _nearest_facet(place, grain, points, self.facets)
        slopes = tilts + np.float32(2 * self.dome * (1 - self.worn)) * points
        slopes = slopes[facet]
        if self.dome * self.worn > 0:
            slopes += np.float32(2 * self.dome * self.worn) * place
        return Microstructure(normals_of(slopes), None, ids, self.extent, self.interpolation)


def _nearest_facet(place, grain, points, facets):
    """Number of the facet nearest to each place (r, r, 2) within its grain (r, r)."""
    first = grain * np.int32(facets)
    found = first.copy()
    x, y = np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])
    least = np.full(grain.shape, np.inf, np.float32)
    for number in range(facets if facets > 1 else 0):
        index = first + np.int32(number)
        distance = np.square(place[..., 0] - x[index]) + np.square(place[..., 1] - y[index])
        nearer = distance < least
        np.copyto(least, distance, where=nearer)
        np.copyto(found, index, where=nearer)
    return found


SNOW = Grains(extent=0.1, size=0.0008, size_spread=0.35, facets=3, roughness=0.85, dome=0.2)
SAND = Grains(extent=0.05, size=0.0004, size_spread=0.25, facets=5, roughness=0.6, dome=0.8, worn=0.4)
SUGAR = Grains(extent=0.05, size=0.0006, size_spread=0.2, facets=3, distribution="CONE", cone=0.9, dome=0.0)
