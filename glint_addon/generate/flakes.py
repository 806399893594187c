"""Flakes: flat mirrors, each tilted on its own, as in metallic paint, glitter and mica."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lattice import LARGEST_SPREAD, nearest, random_lattice
from .microstructure import CLOSEST, Generator, Microstructure, normals_of
from .settings import FACTOR, LENGTH, setting
from .tilts import cone_setting, distribution_setting, random_slopes, roughness_setting, tail_setting

# Up to so many flakes along a texel, and along a repeat, a coarse map shows those of a fine one, where the middles of
# its texels lie. Of more it would take too long to draw all, and it shows as many as it has texels.
FINER, MOST = 4, 2048


@dataclass(frozen=True, kw_only=True)
class Population:
    """Flakes of one make."""

    share: float = setting(1.0, "Share", "Part of the covered surface that these flakes cover, in relation to the "
                           "shares of all", low=0.0, high=1.0, quantity=FACTOR)
    size: float = setting(0.00005, "Size", "Mean width of a flake; if less than a texel, each texel shows a flake",
                          low=1e-7, high=1.0, quantity=LENGTH)
    size_spread: float = setting(0.2, "Size Spread", "Standard deviation of the widths, in relation to their mean",
                                 low=0.0, high=LARGEST_SPREAD, quantity=FACTOR)
    distribution: str = distribution_setting()
    roughness: float = roughness_setting(0.5)
    cone: float = cone_setting()
    tail: float = tail_setting()
    id_low: float = setting(0.0, "Lowest ID", "Random numbers of these flakes begin here: another range than that of "
                            "others gives them other colours", low=0.0, high=1.0, quantity=FACTOR)
    id_high: float = setting(1.0, "Highest ID", "Random numbers of these flakes end here", low=0.0, high=1.0,
                             quantity=FACTOR)


@dataclass(frozen=True, kw_only=True)
class Flakes(Generator):
    """Polygons of one or several populations, the first on top. Coverage takes or gives whole flakes."""

    kind = "FLAKES"
    label = "Flakes"
    help = "Flat mirrors, each with a tilt of its own: metallic paint, glitter, mica"
    interpolation = CLOSEST

    coverage: float = setting(1.0, "Coverage", "Part of the surface that flakes cover: how many there are, not how "
                              "bright they are", low=0.0, high=1.0, quantity=FACTOR)
    populations: tuple[Population, ...] = setting((Population(),), "Populations", "Flakes of different makes", low=1,
                                                  high=8)

    def made(self, resolution: int) -> Microstructure:
        normals = np.zeros((resolution, resolution, 3), np.float32)
        normals[..., 2] = 1.0
        presence = np.zeros((resolution, resolution), bool)
        ids = np.zeros((resolution, resolution), np.float32)
        for number, (population, chance) in enumerate(zip(self.populations, self._chances(), strict=True)):
            if chance > 0:
                layer = self._layer(population, chance, number, resolution)
                _put_below(layer, normals, presence, ids)
        return Microstructure(normals, presence, ids, self.extent, self.interpolation)

    def _chances(self) -> list[float]:
        """The chance of each place in a population's own pattern to hold a flake, the first population on top.

        What lies above hides a part of a layer, as often as it covers the surface, so the layer needs more flakes.
        """
        total = sum(population.share for population in self.populations)
        chances, uncovered = [], 1.0
        for population in self.populations:
            wanted = self.coverage * population.share / total if total > 0 else 0.0
            chances.append(min(1.0, wanted / uncovered) if uncovered > 1e-9 else 0.0)
            uncovered -= wanted
        return chances

    def _layer(self, population, chance, number, resolution):
        """(normals (n, 3), ids (n,), is_there (n,), index (r, r) of the flake at each texel) of one population."""
        columns = self.columns_of(population.size, "Size")
        rng = self.random(number)
        if columns > max(resolution, min(MOST, FINER * resolution)):
            count, index = resolution**2, np.arange(resolution**2, dtype=np.int32).reshape(resolution, resolution)
        else:
            lattice = random_lattice(columns, population.size_spread, rng)
            count, index = lattice.count, nearest(lattice, resolution)
        is_there = rng.random(count, np.float32) < chance
        low, high = sorted((population.id_low, population.id_high))
        ids = np.float32(low) + rng.random(count, np.float32) * np.float32(high - low)
        return normals_of(random_slopes(population, count, rng)), ids, is_there, index


def _put_below(layer, normals, presence, ids):
    """Put a layer where nothing is yet, in place."""
    flake_normals, flake_ids, is_there, index = layer
    free = is_there[index]
    if not presence.any() and free.all():
        normals[...] = flake_normals[index]
        ids[...] = flake_ids[index]
    else:
        free &= ~presence
        seen = index[free]
        normals[free] = flake_normals[seen]
        ids[free] = flake_ids[seen]
    presence |= free
