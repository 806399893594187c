"""Numpy twin of osl/sample_filter.h."""

from __future__ import annotations

import numpy as np


def sample_filter_std(samples):
    """Standard deviation in pixels of the Gaussian over which one of `samples` samples averages."""
    return 0.4 / np.sqrt(np.sqrt(np.maximum(samples, 1.0)))
