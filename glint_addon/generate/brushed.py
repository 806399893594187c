"""Brushed metal: fine streaks along u. UVs that run around an axis make it turned metal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .fields import random_slopes
from .microstructure import LINEAR, Generator, Microstructure, normals_of
from .settings import LENGTH, setting

REACH = 3.7  # beyond which the amplitude of a wave, exp(-x^2), is under a millionth


@dataclass(frozen=True, kw_only=True)
class Brushed(Generator):
    """A Gaussian random height whose autocorrelation is exp(-(x / length)^2 / 2 - (y / width)^2 / 2)."""

    kind = "BRUSHED"
    label = "Brushed"
    help = "Fine streaks along u; UVs around an axis make circles of them"
    interpolation = LINEAR

    length: float = setting(0.002, "Length", "How far a streak goes on, as its correlation length", low=1e-7,
                            high=100.0, quantity=LENGTH)
    width: float = setting(0.00002, "Width", "Width of a streak, as its correlation length", low=1e-7, high=1.0,
                           quantity=LENGTH)
    slope: float = setting(0.2, "Strength", "Root mean square of the slope across the streaks", low=0.0, high=2.0)

    def made(self, resolution: int) -> Microstructure:
        self.columns_of(self.width, "Width")
        along, across = (np.pi * size / self.extent for size in (self.length, self.width))

        def amplitude(j, k):
            # The spectrum of the autocorrelation is exp(-(l w)^2 / 2) with w = 2 pi j / extent; its root:
            return np.exp(-((along * j) ** 2) - (across * k) ** 2)

        waves = int(np.ceil(REACH / along)), int(np.ceil(REACH / across))
        slopes, squares = random_slopes(amplitude, waves, resolution, self.random())
        scale = np.float32(self.slope / np.sqrt(squares[1]))
        return Microstructure(normals_of(slopes * scale), None, None, self.extent, self.interpolation)
