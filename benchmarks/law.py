"""The law of an unbiased method, err^2 = c / spp, fitted to what was measured, and the time it takes to an error.

A point is (spp, seeds, rmse): the relative RMSE expected of one picture, found from `seeds` pictures of `spp` samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Law:
    """constant: c; exponent: of err against spp, fitted freely (-0.5 if the law holds); largest: spp measured."""

    constant: float
    exponent: float
    largest: int


def fitted_law(points) -> Law:
    """Fit both to at least two points of different spp and an error above 0. Raises ValueError for fewer.

    c is the mean of err^2 spp weighted by the samples behind each point: a few samples rarely meet the rare bright
    paths that make most of the error, so they count little.
    """
    spp, seeds, rmse = np.array([point for point in points if point[2] > 0.0], float).reshape(-1, 3).T
    if len(set(spp)) < 2:
        raise ValueError("A law needs errors above the truth's noise at two sample counts: renew the truth with more.")
    weights = spp * seeds
    constant = float(np.sum(weights * rmse**2 * spp) / np.sum(weights))
    exponent = float(np.polyfit(np.log(spp), np.log(rmse), 1)[0])
    return Law(constant, exponent, int(spp.max()))


def samples_to(law: Law, rmse: float) -> float:
    """Samples a pixel at which the law gives `rmse`; at least 1, since no picture has fewer."""
    return max(law.constant / rmse**2, 1.0)
