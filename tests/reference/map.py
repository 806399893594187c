"""Numpy twin of osl/map.h: float64, one row for each patch. A patch is its corners n00, n10, n01, n11: (n, 4, 3)."""

from __future__ import annotations

import numpy as np

CORNERS = ((0, 0), (1, 0), (0, 1), (1, 1))  # (column, row) of the corners, in order


def patch_normal(patch, a, b):
    """Bilinear normals (n, 3) at (a, b) in 0..1 of each patch; not normalised."""
    weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=-1)
    return np.einsum("nc,nck->nk", weights, patch)


def patch_slopes(hint, patch, offset_u, offset_v):
    """Validity (n,), forms at the four corners (n, 4, 3), and the distance of the closest condition from its limit.

    The forms are (n.f1, n.f2, n.f3), shifted by surface and half vector; where OSL keeps value and differences, the
    corners are kept here.
    """
    forms = np.einsum("nfk,nck->ncf", hint.forms, patch)
    corner = np.array(CORNERS, float)
    offset = np.stack([offset_u, offset_v], -1)[:, None] + corner
    forms[..., :2] += forms[..., 2:] * np.einsum("nst,nct->ncs", hint.turns, offset)
    limit = hint.radius[:, None, None] * forms[..., 2:]
    margins = np.concatenate([
        forms[..., 2].min(axis=1)[:, None],
        -(forms[..., :2] - limit).min(axis=1),
        (forms[..., :2] + limit).max(axis=1),
    ], axis=1)
    return (margins > 0).all(axis=1), forms, np.abs(margins).min(axis=1)


def patch_slope(hint, forms, a, b):
    """Whether the normal at (a, b) lies in the region around the half vector, and its slope there (n, 2)."""
    form = patch_normal(forms, a, b)
    p = form[:, :2] / form[:, 2:]
    return np.linalg.norm(p, axis=-1) < hint.radius, p


def patch_covariance(forms, a, b, first, second):
    """Covariance (n, 3) = (c11, c12, c22) of slopes, J S J^T.

    first, second: (n, 2) position offsets of one deviation each; their outer products add up to S. J comes from
    differences of the slope itself, so that OSL's quotient rule is tested and not repeated.
    """
    step = 1e-5
    columns = []
    for da, db in ((step, 0.0), (0.0, step)):
        ahead, behind = patch_normal(forms, a + da, b + db), patch_normal(forms, a - da, b - db)
        columns.append((ahead[:, :2] / ahead[:, 2:] - behind[:, :2] / behind[:, 2:]) / (2.0 * step))
    jacobian = np.stack(columns, axis=-1)
    spread = jacobian @ np.stack([first, second], axis=-1)
    covariance = spread @ spread.transpose(0, 2, 1)
    return np.stack([covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]], axis=-1)


def patch_parts(from_a, to_a, from_b, to_b, alpha, *, part_span=1.5, most_parts=8):
    """Parts of a patch along one side, and the unrounded number."""
    turns = [np.linalg.norm(to - start, axis=-1) / np.linalg.norm([start, to], axis=-1).min(axis=0)
             for start, to in ((from_a, to_a), (from_b, to_b))]
    span = np.maximum(*turns)
    exact = span / (part_span * alpha)
    return np.clip(np.ceil(exact), 1, most_parts), exact
