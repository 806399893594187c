"""Numpy twin of osl/query.h: float64, one row for each element. Several hints are a list of HalfVector."""

from __future__ import annotations

import numpy as np

from .map import map_patch, patch_columns, patch_normal, patch_rows

SINGLE_ELEMENT = 0.5
THIN_FOOTPRINT = 1.0
MODE_SINGLE, MODE_POINTS, MODE_ALL, MODE_SUBSET = 1, 2, 3, 4


def query_mode(long_axis, short_axis, area, visits):
    """How footprints are queried, one of MODE_..."""
    whole = np.where(area <= visits, MODE_ALL, MODE_SUBSET)
    return np.where(long_axis < SINGLE_ELEMENT, MODE_SINGLE, np.where(short_axis < THIN_FOOTPRINT, MODE_POINTS, whole))


def hint_slope(hint, n, offset_u, offset_v):
    """Validity and slopes (n, 2) around the half vector of tangent-space normals `n` at texel offsets."""
    values = np.einsum("nfk,nk->nf", hint.forms, n)
    valid = values[:, 2] > 0
    along = np.where(valid, values[:, 2], 1.0)
    offset = np.stack(np.broadcast_arrays(offset_u, offset_v, along)[:2], axis=-1)
    return valid, values[:, :2] / along[:, None] + np.einsum("nst,nt->ns", hint.turns, offset)


def selecting_hint(hints, n, offset_u, offset_v):
    """The first hint (n,) in whose region lies the slope of each normal, or -1; that slope (n, 2), or 0; and the
    distance of the closest condition from its limit."""
    found, slopes, margin = np.full(len(n), -1), np.zeros((len(n), 2)), np.full(len(n), np.inf)
    for number, hint in enumerate(hints):
        valid, slope = hint_slope(hint, n, offset_u, offset_v)
        along = np.einsum("nk,nk->n", hint.forms[:, 2], n)
        inside = np.where(valid, hint.radius - np.linalg.norm(slope, axis=1), -np.inf)
        is_open = found < 0
        doubt = np.where(valid, np.minimum(along, np.abs(inside)), -along)
        margin = np.where(is_open, np.minimum(margin, doubt), margin)
        chosen = is_open & (inside > 0)
        found[chosen], slopes[chosen] = number, slope[chosen]
    return found, slopes, margin


def hint_reaches_ball(hint, centre, ball, offset_u, offset_v):
    """Whether any normal of a patch, all within a ball, can lie in the region around h; by how much (positive: yes)."""
    values = np.einsum("nfk,nk->nf", hint.forms, centre)
    along = values[:, 2]
    offset = np.stack(np.broadcast_arrays(offset_u, offset_v, along)[:2], axis=-1)
    x = values[:, :2] + along[:, None] * np.einsum("nst,nt->ns", hint.turns, offset)
    limit = (hint.radius + hint.patch_turn) * along + ball * hint.ball_growth
    margin = np.minimum(limit, limit - np.linalg.norm(x, axis=-1))
    return margin > 0, margin


def spread_over_part(hint, patch, a, b, first, second):
    """Covariance (n, 3) = (c11, c12, c22) of slopes, J S J^T, of a part around (a, b).

    first, second: (n, 2) position offsets of one deviation each; their outer products add up to S. J comes from
    differences of the slope itself, so that OSL's quotient rule is tested and not repeated.
    """
    step = 1e-5
    columns = []
    for da, db in ((step, 0.0), (0.0, step)):
        ahead = hint_slope(hint, patch_normal(patch, a + da, b + db), a + da, b + db)[1]
        behind = hint_slope(hint, patch_normal(patch, a - da, b - db), a - da, b - db)[1]
        columns.append((ahead - behind) / (2.0 * step))
    jacobian = np.stack(columns, axis=-1)
    spread = jacobian @ np.stack([first, second], axis=-1)
    covariance = spread @ spread.transpose(0, 2, 1)
    return np.stack([covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]], axis=-1)


def hit_place(normals, strength, alpha, hit, is_whole):
    """The normal by which hit points are judged, and its offset (n,) along u and v; is_whole: the normal at the hit
    itself, else (Linear) that in the middle of the part of its patch."""
    if is_whole:
        return hit.n, np.zeros(len(hit.u)), np.zeros(len(hit.u))
    patch = map_patch(normals, strength, hit.i, hit.j)
    at = []
    for (parts, _), place in ((patch_columns(patch, alpha), hit.u - hit.i), (patch_rows(patch, alpha), hit.v - hit.j)):
        at.append((np.minimum(np.floor(place * parts), parts - 1) + 0.5) / parts)
    return patch_normal(patch, *at), hit.i + at[0] - hit.u, hit.j + at[1] - hit.v


def patch_is_above(hint, patch):
    """Whether all of each patch (n, 4, 3) lies above the hint's horizon, and by how much (positive: yes)."""
    along = np.einsum("nk,nck->nc", hint.forms[:, 2], patch).min(axis=1)
    return along > 0, along


def above_margin(hints, found, patch):
    """By how much (n,) each patch lies above the horizon of the hint that selects of it; infinite where none does."""
    margins = np.stack([patch_is_above(hint, patch)[1] for hint in hints])[np.maximum(found, 0), np.arange(len(found))]
    return np.where(found >= 0, margins, np.inf)


def hit_is_selected(hints, normals, strength, alpha, hit, *, is_linear, mode):
    """Whether some hint selects the element at each hit point, and the distance of that from its limit."""
    place = hit_place(normals, strength, alpha, hit, not is_linear or mode == MODE_POINTS)
    found, _, margin = selecting_hint(hints, *place)
    above = np.full(len(found), np.inf)
    if is_linear:
        above = above_margin(hints, found, map_patch(normals, strength, hit.i, hit.j))
    return (found >= 0) & (above > 0), np.minimum(margin, np.abs(above))
