"""Numpy twin of osl/selection.h: which of the selected elements are kept, and what they stand for."""

from __future__ import annotations

import numpy as np

from .facet import facet_lobe
from .light_hint import REGION

CLOSURE_BUDGET = 24
LEAST_IMPORTANCE = 0.002
LEAST_SHARE = 0.5
GOLDEN_RATIO = 0.6180339887
EPSILON = 2.0**-24


def element_importance(is_ggx, alpha, radius, weight, p, covariance):
    """Importance (n,) of elements of `weight` (n,), mean slope p (n, 2), covariance (c11, c12, c22) (n, 3)."""
    width = np.maximum(alpha**2 + covariance[:, 0] + covariance[:, 2], LEAST_SHARE * alpha**2)
    width = width + 0.5 * (radius - REGION * alpha) ** 2
    return weight * (LEAST_IMPORTANCE + facet_lobe(is_ggx, (p**2).sum(axis=1), width))


def reservoirs(importance, limit, random):
    """Of the elements with `importance` (n,): the one (m,) that each reservoir keeps, the reservoir's sum (m,), and
    whether (m,) no choice was so close that rounding in 32 bits may decide it."""
    count = min(len(importance), limit)
    kept, sums = np.arange(count), importance[:count].copy()
    odds = (random + GOLDEN_RATIO * np.arange(count)) % 1
    error, clear = np.full(count, 4 * EPSILON), np.ones(count, bool)
    for number in range(limit, len(importance)):
        k = number % limit
        sums[k] += importance[number]
        share = importance[number] / sums[k]
        clear[k] &= abs(odds[k] - share) > 4 * error[k] + 4 * EPSILON
        is_kept = odds[k] < share
        odds[k] = odds[k] / share if is_kept else (odds[k] - share) / (1 - share)
        error[k] = error[k] / (share if is_kept else 1 - share) + 4 * EPSILON
        kept[k] = number if is_kept else kept[k]
    return kept, sums, clear
