"""Numpy twin of osl/light_hint.h: float64, one row for each hint. Vectors are (n, 3), the rest (n,)."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

HINT_SUN = 1.0
HINT_LOCAL = 2.0
REGION = 2.5  # alpha
LARGEST_REGION = 0.8
LARGEST_OF_VIEW = 1.0
LARGEST_OF_LIGHT = 2.0
LARGEST_TURN = 2.0
FLAT_CONE = 1.5707


@dataclass
class NormalFrame:
    """World vectors of a tangent-space normal's x, y and z, (n, 3), and their change per dpdx and dpdy."""

    tangent: np.ndarray
    bitangent: np.ndarray
    upright: np.ndarray
    dpdx: np.ndarray
    dpdy: np.ndarray
    tangent_dx: np.ndarray
    tangent_dy: np.ndarray
    bitangent_dx: np.ndarray
    bitangent_dy: np.ndarray
    upright_dx: np.ndarray
    upright_dy: np.ndarray


@dataclass
class HalfVector:
    """Slopes around a half vector, as in OSL; `forms` stacks f1, f2, f3: (n, 3, 3); `turns` is (n, slope, texel)."""

    h: np.ndarray
    axes: np.ndarray
    forms: np.ndarray
    turns: np.ndarray
    radius: np.ndarray
    patch_turn: np.ndarray
    turn: np.ndarray | None = None
    reach: np.ndarray | None = None
    ball_growth: np.ndarray | None = None

    def at(self, rows):
        """The hints of some rows, each as often as it is named."""
        values = (getattr(self, field.name) for field in fields(self))
        return HalfVector(*(None if value is None else value[rows] for value in values))


def dot(a, b):
    return np.einsum("...k,...k->...", a, b)


def unit(a):
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def slope_axes(frame, h):
    """Axes (n, 2, 3) across h and the three linear forms (n, 3, 3) on tangent-space normals."""
    x, y, z = np.moveaxis(h, -1, 0)
    zero = np.zeros_like(x)
    first = unit(np.where(np.abs(z)[:, None] < 0.9, np.stack([-y, x, zero], -1), np.stack([zero, -z, y], -1)))
    axes = np.stack([first, np.cross(h, first)], axis=1)
    basis = np.stack([frame.tangent, frame.bitangent, frame.upright], axis=1)
    return axes, np.einsum("nbk,nfk->nfb", basis, np.concatenate([axes, h[:, None]], axis=1))


def shines_here(light, shape, axis, position):
    """Whether each light can shine on OSL's P, and by how much: the cosine there less the cone's (positive: it can)."""
    offset = np.asarray(light, float) - position
    distance = np.linalg.norm(offset, axis=-1)
    widening = np.where(shape[:, 1] < distance, np.arcsin(np.minimum(shape[:, 1] / distance, 1.0)), np.pi)
    cone = shape[:, 2] + np.where(shape[:, 2] < FLAT_CONE, widening, 0.0)
    has_cone = (shape[:, 0] == HINT_LOCAL) & (shape[:, 2] > 0) & (cone < np.pi)
    margin = np.where(has_cone, dot(offset, axis) / distance - np.cos(np.minimum(cone, np.pi)), 1.0)
    return margin > 0, margin


def half_vector(light, shape, region, frame, footprint, view_turn, position, view, geometric_normal):
    """Validity (n,) bool and HalfVector of each hint; position, view and geometric_normal are OSL's P, I and Ng."""
    light, view = np.asarray(light, float), np.asarray(view, float)
    is_local = shape[:, 0] == HINT_LOCAL
    offset = light - position
    distance = np.where(is_local, np.linalg.norm(offset, axis=-1), 1.0)
    valid = (shape[:, 0] != 0) & (distance > 0)
    distance = np.where(distance > 0, distance, 1.0)
    direction = np.where(is_local[:, None], offset / distance[:, None], light)
    local_angle = np.where(shape[:, 1] < distance, np.arcsin(np.minimum(shape[:, 1] / distance, 1.0)), np.pi)
    half_angle = np.where(is_local, local_angle, shape[:, 1])
    light_turn = np.where(is_local, 1.0 / distance, 0.0)

    total = direction + view
    length = np.linalg.norm(total, axis=-1)
    valid &= length >= 1e-3
    length = np.where(length > 0, length, 1.0)
    h = total / length[:, None]
    radius = region + half_angle / length
    largest = np.minimum(LARGEST_OF_VIEW * length / 2, LARGEST_OF_LIGHT * dot(direction, geometric_normal))
    valid &= radius < np.minimum(largest, LARGEST_REGION)

    axes, forms = slope_axes(frame, h)
    turns = []
    for step, change in (
        (frame.dpdx, (frame.tangent_dx, frame.bitangent_dx, frame.upright_dx)),
        (frame.dpdy, (frame.tangent_dy, frame.bitangent_dy, frame.upright_dy)),
    ):
        turn = sum(forms[:, 2, k, None] * change[k] for k in range(3))
        across_light = step - dot(step, direction)[:, None] * direction
        across_view = step - dot(step, view)[:, None] * view
        half_turn = light_turn[:, None] * across_light + np.asarray(view_turn)[:, None] * across_view
        turns.append(np.einsum("nak,nk->na", axes, turn + half_turn / length[:, None]))
    turn = np.stack(turns, axis=-1)  # (n, slope, step)
    to_steps = np.stack([np.stack([footprint.xu, footprint.xv], -1), np.stack([footprint.yu, footprint.yv], -1)], -2)
    turns = turn @ to_steps
    hint = HalfVector(h, axes, forms, turns, radius, 0.5 * np.linalg.norm(turns, axis=1).sum(axis=-1))
    return valid & (hint.patch_turn < LARGEST_TURN), hint


def forms_norm(forms):
    """Largest length (n,) of the first two of three forms (n, 3, 3) on unit normals."""
    return np.linalg.svd(forms[:, :2], compute_uv=False)[:, 0]


def turn_over(footprint, hint):
    """The hint with what depends on the footprint's size."""
    extent = np.stack([np.hypot(footprint.ux, footprint.uy), np.hypot(footprint.vx, footprint.vy)], axis=-1)
    return turn_over_texels(extent, hint)


def turn_over_texels(extent, hint):
    """As turn_over, for elements that lie up to `extent` (n, 2) texels along u and v from the hit point."""
    rates = np.linalg.norm(hint.turns, axis=1)  # (n, texel)
    turn = (rates * extent).sum(axis=-1)
    reach = turn + rates.sum(axis=-1)
    growth = forms_norm(hint.forms) + (hint.radius + reach) * np.linalg.norm(hint.forms[:, 2], axis=-1)
    return replace(hint, turn=turn, reach=reach, ball_growth=growth)


def hull_reaches_hint(hint, corners, turn, r):
    """Whether a combination of normals `corners` (4, n, 3), whose slopes turn by `turn` (n, 2), can come within r of h.

    By how much, too (positive: it can). None can if all lie beyond one side of a square around h, or behind it.
    """
    x, y, along = np.einsum("nfk,cnk->fcn", hint.forms, corners)
    x, y = x + turn[:, 0] * along, y + turn[:, 1] * along
    limit = r * along
    margin = np.min([side.max(axis=0) for side in (along, limit - x, limit + x, limit - y, limit + y)], axis=0)
    return margin > 0, margin


def map_reaches_hint(hint, low, high):
    """Whether any normal with slopes between low and high, (n, 2), can come within the region of h; by how much."""
    corners = np.stack([
        np.stack([(high if u else low)[:, 0], (high if v else low)[:, 1], np.ones(len(low))], axis=-1)
        for v in (0, 1)
        for u in (0, 1)
    ])
    return hull_reaches_hint(hint, corners, np.zeros((len(low), 2)), hint.radius + hint.reach)
