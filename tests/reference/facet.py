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


def f82_tint(cosine, head_on, edge_tint):
    """Reflectance of a metal: Schlick's approximation, lowered so that it is `edge_tint` of itself at the cosine 1/7.

    Kutz, Hasan, Edmondson: Novel aspects of the Adobe Standard Material, 2021.
    """
    edge = 1 / 7
    schlick = head_on + (1 - head_on) * (1 - edge) ** 5
    lowered = schlick * (1 - edge_tint) / (edge * (1 - edge) ** 6)
    return np.clip(head_on + (1 - head_on) * (1 - cosine) ** 5 - lowered * cosine * (1 - cosine) ** 6, 0, 1)


def conductor(cosine, n, k):
    """Fresnel reflectance of unpolarised light at a complex refractive index n + ik, by complex amplitudes."""
    index = n + 1j * k
    inside = np.sqrt(1 - (1 - cosine**2) / index**2 + 0j)
    across = (cosine - index * inside) / (cosine + index * inside)
    along = (index * cosine - inside) / (index * cosine + inside)
    return 0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2)
