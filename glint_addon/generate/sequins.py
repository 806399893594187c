"""Sequins: round discs sewn in rows, each lying as it likes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import GenerateError
from .lattice import Lattice, offsets, rows_of, topmost
from .microstructure import CLOSEST, LARGEST, Generator, Microstructure, normals_of
from .settings import FACTOR, LENGTH, setting
from .tilts import cone_setting, distribution_setting, random_slopes, roughness_setting, tail_setting


@dataclass(frozen=True, kw_only=True)
class Sequins(Generator):
    """Flat discs on a lattice of hexagons, each over those of the row above; where none lies, or its hole, is a gap."""

    kind = "SEQUINS"
    label = "Sequins"
    help = "Round discs in rows that overlap, each with a tilt of its own: sequins, scales"
    interpolation = CLOSEST

    size: float = setting(0.006, "Size", "Diameter of a sequin", low=1e-6, high=1.0, quantity=LENGTH)
    spacing: float = setting(0.005, "Spacing", "Distance between the centres of two neighbours, at least half of Size",
                             low=1e-6, high=1.0, quantity=LENGTH)
    disorder: float = setting(0.1, "Disorder", "How far sequins lie from their places, in relation to Spacing", low=0.0,
                              high=0.5, quantity=FACTOR)
    hole: float = setting(0.15, "Hole", "Diameter of the hole in a sequin, in relation to Size", low=0.0, high=0.9,
                          quantity=FACTOR)
    distribution: str = distribution_setting()
    roughness: float = roughness_setting(0.4)
    cone: float = cone_setting()
    tail: float = tail_setting()
    extent: float = setting(0.1, "Extent", "Length that one repeat of the map covers on the surface", low=1e-6,
                            high=100.0, quantity=LENGTH)

    def made(self, resolution: int) -> Microstructure:
        if self.size > 2 * self.spacing:
            raise GenerateError(f"Sequins of Size {self.size:g} metres lie more than half over each other at a Spacing "
                                f"of {self.spacing:g}: choose a Spacing of at least half the Size.")
        columns = self.columns_of(self.spacing, "Spacing", LARGEST)
        lattice = self._lattice(columns)
        # The lattice's width is the spacing, but for rounding to a whole number of them in a repeat.
        radius = 0.5 * self.size * columns / self.extent
        sequin = topmost(lattice, resolution, radius)
        away = offsets(lattice, np.maximum(sequin, 0))
        presence = (sequin >= 0) & (np.square(away).sum(axis=-1) >= (radius * self.hole) ** 2)

        rng = self.random(1)
        ids = rng.random(lattice.count, np.float32)[sequin] * presence
        normals = normals_of(random_slopes(self, lattice.count, rng))[sequin]
        normals[~presence] = (0, 0, 1)
        return Microstructure(normals, presence, ids, self.extent, self.interpolation)

    def _lattice(self, columns):
        rng, shape = self.random(0), (rows_of(columns), columns)
        x, y = (0.5 + np.float32(self.disorder) * (rng.random(shape, np.float32) - 0.5) for _ in range(2))
        return Lattice(x, y, np.zeros(shape, np.float32))
