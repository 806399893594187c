"""How the error of an unbiased method falls with its samples: measured, and err^2 = c / spp beyond what was measured.

A point is (spp, seeds, rmse): the relative RMSE expected of one picture, found from `seeds` pictures of `spp` samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

INDEPENDENT = -0.5  # exponent of err against spp for samples that know nothing of each other


@dataclass(frozen=True)
class Law:
    """constant: c; exponent: of err against spp, fitted freely (-0.5 if the law holds); spp, rmse: of the points."""

    constant: float
    exponent: float
    spp: tuple[float, ...]
    rmse: tuple[float, ...]

    @property
    def largest(self) -> float:
        """The most samples that were measured."""
        return self.spp[-1]


def fitted_law(points) -> Law:
    """Fit both to at least two points of different spp and an error above 0. Raises ValueError for fewer.

    c is the mean of err^2 spp weighted by the samples behind each point: a few samples rarely meet the rare bright
    paths that make most of the error, so they count little.
    """
    kept = sorted(point for point in points if point[2] > 0.0)
    spp, seeds, rmse = np.array(kept, float).reshape(-1, 3).T
    if len(set(spp)) < 2:
        raise ValueError("A law needs errors above the truth's noise at two sample counts: renew the truth with more.")
    weights = spp * seeds
    constant = float(np.sum(weights * rmse**2 * spp) / np.sum(weights))
    exponent = float(np.polyfit(np.log(spp), np.log(rmse), 1)[0])
    return Law(constant, exponent, tuple(spp.tolist()), tuple(rmse.tolist()))


def samples_to(law: Law, rmse: float) -> float:
    """Samples a pixel that give the error `rmse`; at least 1, since no picture has fewer.

    Between measured points these decide; only beyond the last one the law does. Where the error was seen to fall faster
    than the law (Cycles' samples are spread evenly, not independent), it is let fall as fast: fewer samples.
    """
    errors = np.minimum.accumulate(law.rmse)
    if rmse >= errors[0]:
        return max(law.spp[0] * (errors[0] / rmse) ** 2, 1.0)
    if rmse >= errors[-1]:
        return float(np.exp(np.interp(-np.log(rmse), -np.log(errors), np.log(law.spp))))
    samples = law.constant / rmse**2
    if law.exponent < INDEPENDENT:
        samples = min(samples, law.largest * (errors[-1] / rmse) ** (-1.0 / law.exponent))
    return max(samples, law.largest)
