"""Small bright spots of an environment picture: the sun of an HDRI, lamps, windows far away. Pure numpy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import cos, pi

import numpy as np

from .projections import PROJECTIONS, Projection

# Blocks across a picture's width: of 0.7 degrees, about the size of the sun, so that a spot is one or a few of them.
BLOCKS = 512

# Least share of a spot in all the picture's light: Cycles samples a fainter spot so rarely that a hint gains little:
# decision 45.
SHARE = 0.01
# Least brightness of a spot, in means of the picture. A spot of `SHARE` and a radius of 5 degrees has 5.
BRIGHTNESS = 4.0
# A spot ends where its radiance falls below this part of its peak; beyond lies its glow. The limb of the sun has 0.4.
EDGE = 0.1
# Part of a spot's light within its radius; for a disk, this radius is 0.95 of the true one.
HELD = 0.9
# Linear interpolation spreads 0.9 of a texel's light to this many texels from its centre; a whole texel has 0.71.
TEXEL_RADIUS = 0.75

NEIGHBOURS = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if (row, column) != (0, 0)]

Block = tuple[int, int]  # row and column of a block of texels


@dataclass(frozen=True)
class Spot:
    """A spot: unit vector towards it, radius [rad], irradiance [W/m^2] that it adds to its surroundings."""

    direction: tuple[float, float, float]
    half_angle: float
    irradiance: float


def bright_spots(pixels: np.ndarray, projection: str, widest: float) -> tuple[list[Spot], int]:
    """Spots of an environment picture, strongest first, and how many reach beyond a radius of `widest` [rad].

    pixels: linear radiance (height, width, 3 or more), row 0 at the bottom; negative and not finite values count as
    black, as in Cycles. projection: EQUIRECTANGULAR or MIRROR_BALL.
    """
    view = PROJECTIONS[projection](*pixels.shape[:2])
    blocks = _Blocks(pixels, view)
    mean = blocks.power.sum() / (4 * pi)
    if mean <= 0:
        return [], 0

    spots, wide = [], 0
    regions = list(_regions(blocks.radiance, BRIGHTNESS * mean, view.wraps))
    owned = set().union(*regions)
    for region in regions:
        if sum(blocks.power[block] for block in region) < SHARE * 4 * pi * mean:
            continue
        if sum(blocks.solid_angle[block] for block in region) > 2 * pi * (1 - cos(widest)):
            wide += 1
            continue
        spot = _measured(blocks, region, owned)
        if spot.half_angle > widest:
            wide += 1
        elif spot.irradiance >= SHARE * 4 * pi * mean:
            spots.append(spot)
    return sorted(spots, key=lambda spot: -spot.irradiance), wide


class _Blocks:
    """The picture in blocks of about equal sides: power [W/m^2], solid angle [sr] and mean radiance of each."""

    def __init__(self, pixels: np.ndarray, view: Projection) -> None:
        self.pixels, self.view = pixels, view
        side = -(-view.width // BLOCKS)
        self.rows, self.columns = np.arange(0, view.height, side), np.arange(0, view.width, side)
        self.side = side
        sums = [self._row_of_sums(int(row)) for row in self.rows]
        self.power, self.solid_angle = (np.array(part) for part in zip(*sums, strict=True))
        self.radiance = self.power / np.maximum(self.solid_angle, np.finfo(float).tiny)

    def texels(self, block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Radiance, solid angle and direction of the texels of a block (row, column), flat."""
        rows, columns = (slice(start[index], start[index] + self.side)
                         for start, index in zip((self.rows, self.columns), block, strict=True))
        values = strength(self.pixels[rows, columns])
        places = np.mgrid[rows, columns][:, :values.shape[0], :values.shape[1]]
        return values.ravel(), self.view.solid_angle(*places).ravel(), self.view.direction(*places).reshape(-1, 3)

    def _row_of_sums(self, row: int) -> list[np.ndarray]:
        values = strength(self.pixels[row:row + self.side])
        texels = np.ogrid[row:row + len(values), :self.view.width]
        solid_angle = self.view.solid_angle(*texels)
        return [np.add.reduceat(part.sum(axis=0), self.columns) for part in (values * solid_angle, solid_angle)]


def strength(pixels: np.ndarray) -> np.ndarray:
    """The largest of red, green and blue, by which lights are ranked; 0 where it is negative or not finite."""
    largest = np.maximum(np.maximum(pixels[..., 0], pixels[..., 1]), pixels[..., 2])
    return np.where((largest > 0) & np.isfinite(largest), largest, 0.0)


def _regions(radiance: np.ndarray, threshold: float, wraps: bool) -> Iterator[list[Block]]:
    """Sets of connected blocks around peaks above `threshold`, brightest first, without the glow of each peak."""
    taken = np.zeros(radiance.shape, bool)
    bright = np.argwhere(radiance > threshold)
    for place in bright[np.argsort(-radiance[tuple(bright.T)], kind="stable")]:
        peak = int(place[0]), int(place[1])
        if taken[peak]:
            continue
        # Leave out a glow: its brightest block touches the spot that it surrounds.
        is_glow = any(taken[block] for block in _around(peak, radiance.shape, wraps))
        region = _flooded(peak, radiance, max(threshold, EDGE * radiance[peak]), taken, wraps)
        if not is_glow:
            yield region


def _flooded(peak: Block, radiance: np.ndarray, level: float, taken: np.ndarray, wraps: bool) -> list[Block]:
    """The free blocks above `level` that are connected to `peak`, which this takes from the free ones."""
    taken[peak] = True
    region = [peak]
    for block in region:  # grows meanwhile
        for near in _around(block, radiance.shape, wraps):
            if not taken[near] and radiance[near] >= level:
                taken[near] = True
                region.append(near)
    return region


def _around(block: Block, shape: tuple[int, ...], wraps: bool) -> Iterator[Block]:
    """The up to eight blocks around one; the columns of a picture that wraps go round."""
    for row, column in NEIGHBOURS:
        row, column = block[0] + row, block[1] + column
        if wraps:
            column %= shape[1]
        if 0 <= row < shape[0] and 0 <= column < shape[1]:
            yield row, column


def _measured(blocks: _Blocks, region: list[Block], owned: set[Block]) -> Spot:
    """Middle, radius and irradiance of the light of a region above that of its surroundings, from the region's texels.

    owned: the blocks of all regions; a block beside a region may belong to another region.
    """
    shape, wraps = blocks.radiance.shape, blocks.view.wraps
    edge = [block for block in _rim(region, shape, wraps) if block not in owned]
    around = [blocks.radiance[block] for block in _rim([*region, *edge], shape, wraps) if block not in owned]
    background = np.median(around) if around else 0.0
    texels = zip(*(blocks.texels(block) for block in [*region, *edge]), strict=True)
    values, solid_angle, direction = (np.concatenate(part) for part in texels)
    power = np.maximum(values - background, 0) * solid_angle
    middle = power @ direction
    middle /= max(np.linalg.norm(middle), np.finfo(float).tiny)

    # Find angles by the chord, because the cosine of a small angle is too rough.
    angle = 2 * np.arcsin(np.minimum(np.linalg.norm(direction - middle, axis=1) / 2, 1))
    order = np.argsort(angle)
    held = np.cumsum(power[order])
    radius = angle[order][np.searchsorted(held, HELD * held[-1])]
    texel = np.sqrt(solid_angle.max())
    x, y, z = map(float, middle)
    return Spot((x, y, z), float(radius + TEXEL_RADIUS * texel), float(power.sum()))


def _rim(region: Iterable[Block], shape: tuple[int, ...], wraps: bool) -> list[Block]:
    """The blocks that touch a region from outside, in a fixed order."""
    return sorted({near for block in region for near in _around(block, shape, wraps)} - set(region))
