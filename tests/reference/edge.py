"""Numpy twin of osl/edge.h."""

from __future__ import annotations

import numpy as np

EDGE_MARGIN = 1.0  # texels


def meets_edge(size, uv, valid, footprint):
    """Whether a part of each footprint around UV coordinates (n, 2) lies outside a map of `size` = (width, height), and
    by how many texels (positive: yes). Footprints that are not valid have no extent."""
    axes = np.where(valid[:, None, None], footprint.axes(), 0.0)
    reach = EDGE_MARGIN + np.linalg.norm(axes, axis=2)
    place = uv * size
    beyond = np.maximum(reach - place, place + reach - size).max(axis=1)
    return beyond > 0, beyond
