"""Bumps: smooth random waves, as orange peel in lacquer, cast metal and water."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .fields import random_slopes
from .microstructure import LINEAR, Generator, Microstructure, normals_of
from .settings import LENGTH, setting

# The waves around a wavelength: relative standard deviation of their frequencies. Less looks like ripples, more like
# noise without a size.
BAND = 0.2
MOST = 1024  # waves along a repeat: finer ones would not be seen in the finest map
REACH = 3.5  # standard deviations beyond which waves are left out: two of a million


@dataclass(frozen=True, kw_only=True)
class Bumps(Generator):
    """A Gaussian random height of waves around one wavelength, and finer ones around a second."""

    kind = "BUMPS"
    label = "Bumps"
    help = "Smooth random waves: orange peel, cast metal, water"
    interpolation = LINEAR

    wavelength: float = setting(0.0005, "Wavelength", "Distance from crest to crest", low=1e-7, high=10.0,
                                quantity=LENGTH)
    slope: float = setting(0.1, "Slope", "Root mean square of the slope: seen from far, the bumps look as a Glossy "
                           "BSDF whose roughness is the root of it", low=0.0, high=2.0)
    fine_wavelength: float = setting(0.0001, "Fine Wavelength", "Distance from crest to crest of the finer waves",
                                     low=1e-7, high=10.0, quantity=LENGTH)
    fine_slope: float = setting(0.0, "Fine Slope", "Root mean square of the finer waves' slope; 0 leaves them out",
                                low=0.0, high=2.0)

    def made(self, resolution: int) -> Microstructure:
        slopes = np.zeros((resolution, resolution, 2), np.float32)
        pairs = ((self.wavelength, self.slope), (self.fine_wavelength, self.fine_slope))
        for number, (wavelength, slope) in enumerate(pairs):
            if slope > 0:
                slopes += self._waves(wavelength, slope, resolution, self.random(number))
        return Microstructure(normals_of(slopes), None, None, self.extent, self.interpolation)

    def _waves(self, wavelength, slope, resolution, rng):
        self.columns_of(wavelength, "Wavelength", MOST)
        middle = self.extent / wavelength

        def amplitude(j, k):
            frequency = np.hypot(j, k)
            return np.exp(-0.25 * ((frequency - middle) / (BAND * middle)) ** 2) / np.maximum(frequency, 1)

        # At the narrowest bands at least the waves beside the middle are there.
        most = int(np.ceil(middle * (1 + REACH * BAND)))
        slopes, squares = random_slopes(amplitude, (most, most), resolution, rng)
        return slopes * np.float32(slope / np.sqrt(squares.sum()))


ORANGE_PEEL = Bumps(extent=0.05, wavelength=0.003, slope=0.02, fine_wavelength=0.0005, fine_slope=0.01)
