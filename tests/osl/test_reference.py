"""What the mathematics of osl/*.h must obey, on the numpy twins (test_*_header.py compare these with OSL)."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.osl.queries import whole_hint
from tests.reference import footprint, light_hint, query
from tests.reference import map as normal_map

SETTINGS = settings(max_examples=200, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32 - 1)
POINTS = 200_000
STANDARD_ERRORS = 5  # of a Monte Carlo mean: one random failure in a million


def unit(vector):
    return np.asarray(vector, float) / np.linalg.norm(vector, axis=-1, keepdims=True)


def test_the_integral_of_the_kernel_is_a_third_of_pi():
    # Midpoint rule in t = r^2, whose area element is pi dt: exact to 1 / (12 n^2).
    t = (np.arange(1000) + 0.5) / 1000
    assert np.pi * footprint.footprint_kernel(t).mean() == pytest.approx(np.pi / 3, rel=1e-6)
    assert footprint.footprint_kernel(np.array([1.0, 1.5, 100.0])).max() == 0


def test_the_kernel_has_the_variance_it_states():
    # E[x^2] = E[r^2] / 2 = integral of t (1 - t)^2 / 2 over integral of (1 - t)^2 = (1 / 24) / (1 / 3).
    t = (np.arange(1000) + 0.5) / 1000
    kernel = footprint.footprint_kernel(t)
    assert 0.5 * (t * kernel).sum() / kernel.sum() == pytest.approx(footprint.KERNEL_VARIANCE, rel=1e-5)


def test_samples_of_the_footprint_have_the_density_of_the_kernel():
    a, b = np.random.default_rng(1).random((2, POINTS))
    x, y = footprint.footprint_sample(a, b)
    assert np.hypot(x, y).max() < 1
    # Moments of odd order 0, of second order 1/8 and 0; each against its own standard error.
    for values, expected in ((x, 0), (y, 0), (x * y, 0), (x * x, 0.125), (y * y, 0.125), (x * x - y * y, 0)):
        assert abs(values.mean() - expected) < STANDARD_ERRORS * values.std() / np.sqrt(POINTS)
    # The share within radius r is 1 - (1 - r^2)^3, for every r.
    radii = np.sort(np.hypot(x, y))
    share = 1 - (1 - radii**2) ** 3
    assert np.abs(share - np.arange(POINTS) / POINTS).max() < 2.2 / np.sqrt(POINTS)  # Kolmogorov, 1e-4


@SETTINGS
@given(seeds, st.floats(1e-3, 1.0), st.floats(0.1, 2.0))
def test_the_footprint_has_the_pixels_area_divided_by_the_cosine(seed, cosine, radius):
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    cone = 10.0 ** rng.uniform(-4, 0)
    angle = rng.uniform(0, 2 * np.pi)
    across = np.cos(angle) * basis[0] + np.sin(angle) * basis[1]
    view = cosine * basis[2] + np.sqrt(1 - cosine**2) * across
    scale = rng.uniform(0.1, 100)  # texels per unit of the surface
    texels = scale * cone
    diagonal = [np.array([entry]) for entry in (texels, 0, 0, texels)]
    valid, shape = footprint.ray_footprint(
        cone * basis[:1], cone * basis[1:2], view[None], basis[2:], radius, *diagonal
    )
    assert valid.all()
    assert shape.area[0] == pytest.approx(np.pi * (radius * cone * scale) ** 2 / cosine, rel=1e-9)
    # Its long axis lies along the view, and is that of the cone divided by the cosine.
    assert shape.long_axis[0] == pytest.approx(radius * texels / cosine, rel=1e-9)
    assert shape.short_axis[0] == pytest.approx(radius * texels, rel=1e-9)
    axes = np.array([[shape.ux[0], shape.uy[0]], [shape.vx[0], shape.vy[0]]])
    along = axes @ axes.T @ [np.cos(angle), np.sin(angle)]
    np.testing.assert_allclose(along, shape.long_axis[0] ** 2 * np.array([np.cos(angle), np.sin(angle)]),
                               rtol=0, atol=1e-9 * shape.long_axis[0] ** 2)


@SETTINGS
@given(seeds, st.floats(0, 1.5), st.floats(0.001, 0.3))
def test_the_region_holds_the_half_vectors_of_the_whole_light(seed, tilt, half_angle):
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    view = np.cos(tilt) * basis[2] + np.sin(tilt) * basis[0]
    light = unit(rng.normal(size=3) + 2 * basis[2])
    hint = sun_hint(basis, light, half_angle, view)
    assume(hint is not None)

    # Directions on the rim of the light and within.
    across = unit(np.cross(light, rng.normal(size=(200, 3))))
    angle = np.where(np.arange(200) < 100, half_angle, rng.uniform(0, half_angle, 200))[:, None]
    directions = np.cos(angle) * light + np.sin(angle) * across
    half = unit(directions + view)
    slopes = half @ hint.axes[0].T / (half @ hint.h[0])[:, None]

    # With r = tan(half_angle / 2) / cos, a tilted half vector adds up to r and the turned plane up to 1 / (1 - r).
    r = hint.radius[0] * np.tan(half_angle / 2) / (half_angle / 2)
    assume(r < 1)
    assert np.linalg.norm(slopes, axis=1).max() <= r * (1 + r) / (1 - r) + 1e-12


def sun_hint(basis, light, half_angle, view, k_alpha=0.0):
    """HalfVector of a sun on the flat surface whose tangent, bitangent and normal are `basis`; None if it has none."""
    still = np.zeros((1, 3))
    frame = light_hint.NormalFrame(*basis[:, None], basis[:1], basis[1:2], *[still] * 6)
    flat = footprint.Footprint(*[np.ones(1)] * 11)
    valid, hint = light_hint.half_vector(
        light[None], np.array([[light_hint.HINT_SUN, half_angle]]), k_alpha, frame, flat, np.zeros(1), still,
        view[None], basis[2:],
    )
    return light_hint.turn_over(flat, hint) if valid[0] else None


@SETTINGS
@given(seeds)
def test_slopes_around_the_half_vector_are_tangents_of_the_angle_to_it(seed):
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    view, light = unit(rng.normal(size=(2, 3)) + 2 * basis[2])
    hint = sun_hint(basis, light, 0.01, view, k_alpha=0.1)
    assume(hint is not None)
    np.testing.assert_allclose(unit(light + view), hint.h[0], atol=1e-12)
    n = rng.normal(size=(1, 3))
    valid, slope = query.hint_slope(hint, n, 0.0, 0.0)
    cosine = unit(n[0]) @ basis @ hint.h[0]
    assert valid[0] == (cosine > 0)
    assume(cosine > 1e-6)
    assert np.linalg.norm(slope) == pytest.approx(np.tan(np.arccos(min(cosine, 1.0))), rel=1e-6, abs=1e-7)


@SETTINGS
@given(seeds, st.floats(0.0, 0.5), st.floats(0.0, 0.3))
def test_a_ball_of_normals_is_never_skipped_while_one_of_them_is_in_the_region(seed, ball, sharpness):
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    view, light = unit(rng.normal(size=(2, 3)) + 2 * basis[2])
    hint = sun_hint(basis, light, 0.01, view, k_alpha=sharpness)
    assume(hint is not None)
    count = 500
    many = hint.at(np.zeros(count, int))
    slope = unit(rng.normal(size=(count, 2))) * hint.radius[0] * rng.uniform(0, 1, (count, 1))
    inside = np.linalg.solve(many.forms, np.c_[slope, np.ones(count)][..., None])[..., 0]
    centre = inside * rng.uniform(0.3, 1, (count, 1)) + ball * unit(rng.normal(size=(count, 3)))
    assert query.hint_reaches_ball(many, centre, np.full(count, ball * (1 + 1e-9)), 0.0, 0.0)[0].all()


@SETTINGS
@given(seeds, st.floats(0.001, 1.0), st.floats(0.0, 0.3))
def test_a_map_is_never_skipped_while_one_of_its_slopes_is_in_the_region(seed, width, reach):
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    view, light = unit(rng.normal(size=(2, 3)) + 2 * basis[2])
    hint = sun_hint(basis, light, 0.01, view, k_alpha=0.05)
    assume(hint is not None)
    low = rng.normal(size=(1, 2)) * 0.5
    high = low + width * rng.random((1, 2))
    slopes = low + (high - low) * rng.random((500, 2))
    normals = np.c_[slopes, np.ones(500)]
    many = hint.at(np.zeros(500, int))
    valid, p = query.hint_slope(many, normals, 0.0, 0.0)
    shifted = p + rng.uniform(-reach, reach, p.shape)
    selected = valid & (np.linalg.norm(shifted, axis=1) < hint.radius[0])
    hint.reach[:] = np.hypot(reach, reach)
    assert not selected.any() or light_hint.map_reaches_hint(hint, low, high)[0][0]


@SETTINGS
@given(seeds, st.floats(0.02, 0.3), st.floats(0.0, 0.005), st.floats(0.0, 0.5))
def test_a_patch_is_never_skipped_while_a_normal_of_it_is_in_the_region(seed, radius, turn, shear):
    # turn: of the surface or the half vector from one texel to the next; a sphere 1200 texels around turns by 0.005.
    rng = np.random.default_rng(seed)
    count = 500
    forms = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0] @ (np.eye(3) + shear * rng.normal(size=(3, 3)))
    turns = turn * rng.normal(size=(count, 2, 2))
    hint = whole_hint(forms, turns, np.full(count, radius), extent=5.0)
    slopes = rng.normal(size=(count, 2)) * 2 * radius
    centre = unit(np.linalg.solve(forms, np.c_[slopes, np.ones(count)][..., None])[..., 0])
    patch = centre[:, None] + rng.choice([0.01, 0.1]) * rng.normal(size=(count, 4, 3))
    u, v = rng.uniform(-5, 5, (2, count))
    at = rng.random((2, count))

    selected = query.selecting_hint([hint], normal_map.patch_normal(patch, *at), u + at[0], v + at[1])[0] == 0
    assert selected.any()
    middle = patch.mean(axis=1)
    ball = np.linalg.norm(patch - middle[:, None], axis=2).max(axis=1)
    assert query.hint_reaches_ball(hint, middle, ball, u + 0.5, v + 0.5)[0][selected].all()


@SETTINGS
@given(seeds)
def test_the_normal_of_a_patch_is_its_corners_at_the_corners_and_their_mean_in_the_middle(seed):
    patch = np.random.default_rng(seed).normal(size=(1, 4, 3))
    for corner, (a, b) in enumerate(normal_map.CORNERS):
        np.testing.assert_array_equal(normal_map.patch_normal(patch, np.array([a]), np.array([b]))[0], patch[0, corner])
    middle = normal_map.patch_normal(patch, np.array([0.5]), np.array([0.5]))[0]
    np.testing.assert_allclose(middle, patch[0].mean(0), atol=1e-12)
