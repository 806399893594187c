"""Numpy twin of osl/map.h: float64, one row for each patch. A patch is its corners n00, n10, n01, n11: (n, 4, 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .table import strengthened, wrapped

CORNERS = ((0, 0), (1, 0), (0, 1), (1, 1))  # (column, row) of the corners, in order
PART_SPAN = 1.5  # alpha
MOST_PARTS = 8


@dataclass
class Hit:
    """The map at hit points, one row for each: see osl/map.h."""

    u: np.ndarray
    v: np.ndarray
    i: np.ndarray
    j: np.ndarray
    n: np.ndarray
    unscaled: np.ndarray
    is_flake: np.ndarray


def is_flake(unscaled, has_flakes):
    """Whether normals (n, 3) without Strength are those of flakes, or of a map without flakes."""
    return (unscaled != 0).any(axis=-1) | (not has_flakes)


def map_normal(normals, strength, i, j, has_flakes=False):
    """Tangent-space normals of texels (i, j), which repeat, of a map (height, width, 3); strength: one or (n,)."""
    height, width = normals.shape[:2]
    unscaled = normals[wrapped(j, height), wrapped(i, width)]
    return np.where(is_flake(unscaled, has_flakes)[..., None], strengthened(unscaled, strength), 0.0)


def map_patch(normals, strength, i, j):
    """Patches (n, 4, 3) between texels (i, j) and their right and upper neighbours."""
    return np.stack([map_normal(normals, strength, i + du, j + dv) for du, dv in CORNERS], axis=1)


def patch_normal(patch, a, b):
    """Bilinear normals (n, 3) at (a, b) in 0..1 of each patch; not normalised."""
    weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=-1)
    return np.einsum("nc,nck->nk", weights, patch)


def square_turn(start, end):
    """Square (n,) of about the angle between normals of any length."""
    shorter = np.minimum(np.linalg.norm(start, axis=-1), np.linalg.norm(end, axis=-1))
    return (np.linalg.norm(end - start, axis=-1) / shorter) ** 2


def patch_parts(from_a, to_a, from_b, to_b, alpha):
    """Parts of a patch along one side, and the unrounded number."""
    span = np.sqrt(np.maximum(square_turn(from_a, to_a), square_turn(from_b, to_b)))
    exact = span / (PART_SPAN * alpha)
    return np.clip(np.ceil(exact), 1, MOST_PARTS).astype(int), exact


def patch_columns(patch, alpha):
    """Parts along u, and the unrounded number."""
    n00, n10, n01, n11 = np.moveaxis(patch, 1, 0)
    return patch_parts(n00, n10, n01, n11, alpha)


def patch_rows(patch, alpha):
    """Parts along v, and the unrounded number."""
    n00, n10, n01, n11 = np.moveaxis(patch, 1, 0)
    return patch_parts(n00, n01, n10, n11, alpha)


def map_hit(normals, strength, is_linear, uv, has_flakes=False):
    """The map at UV coordinates (n, 2)."""
    height, width = normals.shape[:2]
    u, v = (uv % 1.0 * [width, height] - (0.5 if is_linear else 0.0)).T
    i, j = np.floor(u).astype(int), np.floor(v).astype(int)
    if is_linear:
        unscaled = patch_normal(map_patch(normals, 1.0, i, j), u - i, v - j)
    else:
        unscaled = map_normal(normals, 1.0, i, j)
    known = is_flake(unscaled, has_flakes)
    return Hit(u, v, i, j, np.where(known[:, None], strengthened(unscaled, strength), 0.0), unscaled, known)
