"""Random heights made of periodic waves, each drawn for itself, so that another resolution shows the same heights."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .microstructure import LARGEST

MOST_WAVES = LARGEST // 2 - 1  # along an axis: what the finest map can show


def random_slopes(
    amplitude: Callable[[np.ndarray, np.ndarray], np.ndarray],
    waves: tuple[int, int],
    resolution: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Slopes float32 (r, r, 2), per repeat, of a Gaussian random height, and the mean squares of the slopes (2,).

    amplitude: of a wave that fits j times into a repeat along u and k times along v, of arrays that broadcast; waves:
    the largest j and k that matter. The mean squares are those of all waves, also of those that `resolution` is too
    coarse for, so that what is scaled by them is the same at every resolution.
    """
    most_j, most_k = (min(most, MOST_WAVES) for most in waves)
    j, k = np.arange(-most_j, most_j + 1)[None, :], np.arange(-most_k, most_k + 1)[:, None]
    shape = (2 * most_k + 1, 2 * most_j + 1)
    noise = rng.standard_normal((*shape, 2), np.float32).view(np.complex64)[..., 0]
    # Heights are real if opposite waves are each other's conjugates.
    height = (noise + np.conj(noise[::-1, ::-1])) * amplitude(j, k).astype(np.float32)
    height[most_k, most_j] = 0
    squares = np.square(np.abs(height))
    means = np.array([np.sum(squares * (2 * np.pi * axis) ** 2, dtype=float) for axis in (j, k)])

    # The slope is minus the derivative; both axes are real, so that one transform gives both.
    spectrum = -2j * np.pi * (j + 1j * k).astype(np.complex64) * height
    limit = resolution // 2 - 1
    rows, columns = (slice(max(0, most - limit), most + min(most, limit) + 1) for most in (most_k, most_j))
    whole = np.zeros((resolution, resolution), np.complex64)
    whole[np.ix_(k[rows, 0] % resolution, j[0, columns] % resolution)] = spectrum[rows, columns]
    slopes = np.fft.ifft2(_to_centres(whole), norm="forward").astype(np.complex64)
    return slopes.view(np.float32).reshape(resolution, resolution, 2), means


def _to_centres(spectrum):
    """Move a spectrum's picture by half a texel, so that its values are those at the centres of texels."""
    resolution = len(spectrum)
    turn = np.exp(1j * np.pi * np.fft.fftfreq(resolution)).astype(np.complex64)
    return spectrum * turn[None, :] * turn[:, None]
