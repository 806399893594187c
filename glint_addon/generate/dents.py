"""Dents: a surface that was hammered all over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lattice import LARGEST_SPREAD, nearest, offsets, random_lattice
from .microstructure import LARGEST, LINEAR, Generator, Microstructure, normals_of
from .settings import FACTOR, LENGTH, setting


@dataclass(frozen=True, kw_only=True)
class Dents(Generator):
    """The lowest of many equal paraboloids, one for each blow; ridges are where two of them meet.

    A blow that went deeper has a larger dent: the lowest of paraboloids (x - c)^2 / (2 R) - d is the power diagram of
    the points c with weights 2 R d.
    """

    kind = "DENTS"
    label = "Dents"
    help = "Round dents beside each other: hammered metal"
    interpolation = LINEAR

    size: float = setting(0.005, "Size", "Mean width of a dent", low=1e-6, high=10.0, quantity=LENGTH)
    size_spread: float = setting(0.2, "Size Spread", "Standard deviation of the widths, in relation to their mean",
                                 low=0.0, high=LARGEST_SPREAD, quantity=FACTOR)
    depth: float = setting(0.0002, "Depth", "Depth of a dent of the mean width, from its rim to its bottom", low=0.0,
                           high=10.0, quantity=LENGTH)
    extent: float = setting(0.1, "Extent", "Length that one repeat of the map covers on the surface", low=1e-6,
                            high=100.0, quantity=LENGTH)

    def made(self, resolution: int) -> Microstructure:
        columns = self.columns_of(self.size, "Size", LARGEST)
        lattice = random_lattice(columns, self.size_spread, self.random(0))
        dent = nearest(lattice, resolution)
        ids = self.random(1).random(lattice.count, np.float32)[dent]
        # A paraboloid of depth d at half the width w rises by 4 d x^2 / w^2; x is in widths.
        slopes = offsets(lattice, dent) * np.float32(-8 * self.depth / self.size)
        return Microstructure(normals_of(slopes), None, ids, self.extent, self.interpolation)
