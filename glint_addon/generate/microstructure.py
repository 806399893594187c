"""What generators make, and what all of them share: seed, size of one repeat, random numbers, the range of normals."""

from __future__ import annotations

import dataclasses
import zlib
from typing import ClassVar

import numpy as np

from ..errors import GenerateError
from .settings import LENGTH, check_settings, setting

SMALLEST, LARGEST = 64, 4096  # texels along a side
# Normals lean by less than 85 degrees: a steeper facet would hardly be seen, and its slope would swamp a map's range.
STEEPEST = float(np.tan(np.radians(85.0)))
CLOSEST, LINEAR = "CLOSEST", "LINEAR"


@dataclasses.dataclass(frozen=True)
class Microstructure:
    """One repeat of a surface, in square arrays of texels; row 0 is v = 0, column 0 is u = 0, and all wrap around.

    normals: float32 (r, r, 3), unit vectors in tangent space, OpenGL convention (+Y along v); not encoded.
    presence: bool (r, r), which texels belong to a flake, scratch or sequin; None where all do.
    id: float32 (r, r) in 0..1, a uniform random number for each flake, grain...; 0 where none is; None without any.
    extent: metres that one repeat measures. interpolation: how to read the normals, CLOSEST for facets or LINEAR.
    """

    normals: np.ndarray
    presence: np.ndarray | None
    id: np.ndarray | None
    extent: float
    interpolation: str


@dataclasses.dataclass(frozen=True, kw_only=True)
class Generator:
    """Base of all generators. A subclass sets what the class says of itself, and `made()`."""

    kind: ClassVar[str]  # as files have it
    label: ClassVar[str]
    help: ClassVar[str]
    interpolation: ClassVar[str]  # how to read the normals

    seed: int = setting(1, "Seed", "Another number gives another surface of the same kind", low=0, high=2**31 - 1)
    extent: float = setting(
        0.02, "Extent", "Length that one repeat of the map covers on the surface", low=1e-6, high=100.0,
        quantity=LENGTH,
    )

    def microstructure(self, resolution: int = 2048) -> Microstructure:
        """One repeat of `resolution` texels a side, a power of two from SMALLEST to LARGEST.

        Another resolution shows the same surface, unless flakes are much smaller than texels. Raises GenerateError.
        """
        is_power = isinstance(resolution, int) and resolution > 0 and resolution & (resolution - 1) == 0
        if not is_power or not SMALLEST <= resolution <= LARGEST:
            raise GenerateError(f"{self.label} cannot have {resolution} texels a side: choose a power of two from "
                                f"{SMALLEST} to {LARGEST}.")
        check_settings(self)
        return self.made(resolution)

    def made(self, resolution: int) -> Microstructure:
        """The microstructure, of settings that were checked."""
        raise NotImplementedError

    def random(self, *purpose: int) -> np.random.Generator:
        """Random numbers of this kind and seed, others for each purpose."""
        return np.random.default_rng([self.seed, zlib.crc32(self.kind.encode()), *purpose])

    def columns_of(self, length: float, label: str, most: float = np.inf) -> int:
        """How many times `length` fits into the extent, from 2 to `most`. Raises GenerateError if it does not."""
        if 2 * length > self.extent:
            raise GenerateError(f"{self.label} of {label} {length:g} metres do not fit twice into one repeat of "
                                f"{self.extent:g} metres: choose a larger Extent or a smaller {label}.")
        if self.extent / length > most:
            raise GenerateError(f"{self.label} of {label} {length:g} metres are too many in one repeat of "
                                f"{self.extent:g} metres: choose an Extent below {most * length:g}.")
        return round(self.extent / length)


def normals_of(slopes: np.ndarray) -> np.ndarray:
    """Unit normals float32 (..., 3) of slopes (..., 2): n.x / n.z and n.y / n.z, minus a height's derivatives.

    Slopes beyond STEEPEST are shortened to it.
    """
    slopes = np.asarray(slopes, np.float32)
    x, y = slopes[..., 0], slopes[..., 1]
    squared = x * x + y * y
    inverse = 1 / np.sqrt(1 + np.minimum(squared, np.float32(STEEPEST**2)))
    scale = inverse
    if squared.size and squared.max() > STEEPEST**2:
        scale = inverse * np.minimum(1, STEEPEST / np.sqrt(np.maximum(squared, 1e-30)))
    normals = np.empty((*x.shape, 3), np.float32)
    normals[..., 0] = x * scale
    normals[..., 1] = y * scale
    normals[..., 2] = inverse
    return normals


def slopes_of(normals: np.ndarray) -> np.ndarray:
    """Slopes (..., 2) of normals (..., 3): the inverse of `normals_of`."""
    return normals[..., :2] / normals[..., 2:]


def encoded(normals: np.ndarray) -> np.ndarray:
    """Normals (..., 3) as colours of a normal map, float32 in 0..1: rgb = (n + 1) / 2."""
    return np.asarray(normals, np.float32) * np.float32(0.5) + np.float32(0.5)
