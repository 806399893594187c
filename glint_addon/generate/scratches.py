"""Scratches: straight grooves, or the arcs that polishing in circles leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import GenerateError
from .grooves import STEP, Grooves, carved, walk
from .microstructure import LINEAR, Generator, Microstructure, normals_of
from .settings import ANGLE, FACTOR, LENGTH, Choice, setting

STRAIGHT, SWIRLS = "STRAIGHT", "SWIRLS"
_SHAPES = (
    Choice(STRAIGHT, "Straight", "Straight scratches"),
    Choice(SWIRLS, "Swirls", "Arcs of circles, as polishing leaves them"),
)
SQUARE_CENTIMETRE = 1e-4  # square metres
MOST = 1_000_000  # scratches in a repeat: about a minute
MOST_POINTS = 300_000_000  # at which grooves are looked at: half a minute
APART = 3.0  # distance between neighbours of a bundle, in widths


@dataclass(frozen=True, kw_only=True)
class Scratches(Generator):
    """Grooves with a cosine profile, flat between them; where grooves cross, the deeper one is seen."""

    kind = "SCRATCHES"
    label = "Scratches"
    help = "Grooves, straight or in arcs of polishing, flat between them"
    interpolation = LINEAR

    shape: str = setting(STRAIGHT, "Shape", "What the scratches look like", choices=_SHAPES)
    density: float = setting(150.0, "Density", "Scratches on a square centimetre", low=0.0, high=1e6)
    length: float = setting(0.003, "Length", "Mean length of a scratch", low=1e-6, high=100.0, quantity=LENGTH)
    width: float = setting(0.00004, "Width", "Mean width of a scratch; none is drawn narrower than two texels",
                           low=1e-7, high=1.0, quantity=LENGTH)
    depth: float = setting(0.000004, "Depth", "Mean depth of a scratch", low=0.0, high=1.0, quantity=LENGTH)
    variation: float = setting(0.5, "Variation", "How far length, width, depth and radius differ from their means at "
                               "most, in relation to these", low=0.0, high=0.95, quantity=FACTOR)
    direction: float = setting(0.0, "Direction", "Direction of the scratches, from that of u", low=-np.pi, high=np.pi,
                               quantity=ANGLE)
    directions: int = setting(1, "Directions", "Number of directions, evenly around: 2 is a cross", low=1, high=16)
    direction_spread: float = setting(0.15, "Direction Spread", "Standard deviation of a scratch's direction; from 3 "
                                      "on all directions are as frequent", low=0.0, high=10.0, quantity=ANGLE)
    radius: float = setting(0.004, "Radius", "Mean radius of the circles of swirls", low=1e-5, high=100.0,
                            quantity=LENGTH, only=("shape", (SWIRLS,)))
    bundle: int = setting(1, "Bundle", "How many scratches lie beside each other, as one stroke leaves them", low=1,
                          high=100)

    def made(self, resolution: int) -> Microstructure:
        grooves = self._grooves()
        # A groove under two texels would be missed by most of their centres: it is wider then, and as steep.
        texel = self.extent / resolution
        wider = np.maximum(1.0, 2 * texel / grooves.width)
        drawn = grooves._replace(width=grooves.width * wider, depth=grooves.depth * wider)
        steps, lanes = walk(drawn, texel)
        if np.dot(steps, lanes) > MOST_POINTS:
            times = np.dot(steps, lanes) * STEP**2 / resolution**2
            raise GenerateError(f"Scratches cover a repeat of {self.extent:g} metres {times:.0f} times over: choose a "
                                "smaller Density, Length or Width.")
        slopes, number = carved(drawn, self.extent, resolution)
        ids = np.concatenate([self.random(1).random(len(grooves.width), np.float32), [np.float32(0)]])
        return Microstructure(normals_of(slopes), number >= 0, ids[number], self.extent, self.interpolation)

    def _grooves(self) -> Grooves:
        """All scratches of a repeat, strokes of a bundle each."""
        strokes = round(self.density * self.extent**2 / SQUARE_CENTIMETRE / self.bundle)
        count = strokes * self.bundle
        if count > MOST:
            raise GenerateError(f"Scratches of Density {self.density:g} are {count} in one repeat of {self.extent:g} "
                                f"metres, more than {MOST}: choose a smaller Density or Extent.")
        # Random numbers of its own for each property: a larger density adds scratches and moves none.
        rng = [self.random(0, number) for number in range(10)]
        place = rng[0].random((strokes, 2)) * self.extent
        angle = self.direction + rng[1].integers(self.directions, size=strokes) * (np.pi / self.directions)
        angle += rng[2].standard_normal(strokes) * self.direction_spread
        radius = self.radius * self._varied(rng[3], strokes) * np.where(rng[4].random(strokes) < 0.5, -1, 1)

        # Neighbours in a bundle lie at random across it, and begin anywhere within a length.
        across = rng[5].standard_normal(count) * self.width * APART * np.sqrt(self.bundle - 1)
        along = (rng[6].random(count) - 0.5) * self.length * (self.bundle > 1)
        x, y, angle, radius = (np.repeat(values, self.bundle) for values in (*place.T, angle, radius))
        length, width, depth = (mean * self._varied(random, count) for mean, random in
                                zip((self.length, self.width, self.depth), rng[7:], strict=True))
        return Grooves(x, y, angle, across, along, length, width, depth, radius if self.shape == SWIRLS else None)

    def _varied(self, rng, count):
        return 1 + self.variation * rng.uniform(-1, 1, count)
