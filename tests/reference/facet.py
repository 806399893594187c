"""Numpy twin of osl/facet.h: what one microfacet closure shows of its slopes. Arrays of any equal shape."""

from __future__ import annotations

import numpy as np


def facet_gain(is_ggx, alpha, radius):
    """Squared width of a facet's lobe by the variance of slopes that blurs it."""
    return np.where(is_ggx, 4.0 / (1.0 + (radius / np.maximum(alpha, 1e-6)) ** 2), 2.0)


def facet_lobe(is_ggx, square, width):
    """What a facet shows at a squared slope from its middle, relative to its middle; width: its squared alpha."""
    q = square / width
    return np.where(is_ggx, (1.0 + q) ** -2, np.exp(-q))
