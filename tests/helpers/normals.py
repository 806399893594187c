"""Normal maps that no camera made."""

from __future__ import annotations

import numpy as np


def random_normals(width, height, seed=1) -> np.ndarray:
    """Normals (height, width, 3) of any length around +z, some below the horizon; all float32 digits used."""
    normals = np.random.default_rng(seed).normal(0.0, 0.3, (height, width, 3))
    normals[..., 2] += 0.6
    return normals.astype(np.float32)
