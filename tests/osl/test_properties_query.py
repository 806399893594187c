"""Symmetries and bounds of footprints, hints, patches and the query, on the numpy twins and on the shader itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.osl.queries import whole_hint
from tests.reference import checker, footprint, image_texture, light_hint, query, selection, table
from tests.reference import map as patches

SETTINGS = settings(max_examples=60, deadline=None, derandomize=True)
FEW = settings(max_examples=10, deadline=None, derandomize=True)  # of slow brute force
COUNT = 100  # rows of one example
seeds = st.integers(0, 2**32 - 1)
exponents = st.floats(-6, 6)
strengths = st.floats(-2, 10)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def rotations(rng, count):
    """Random proper rotations (count, 3, 3)."""
    turn = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn))[:, None, None]


# --- table.h ---


@SETTINGS
@given(seeds, st.integers(1, 9000))
def test_wrapping_is_periodic_and_keeps_what_is_inside(seed, size):
    i = np.random.default_rng(seed).integers(-(2**30), 2**30, COUNT)
    inside = table.wrapped(i, size)
    assert (inside >= 0).all() and (inside < size).all() and ((inside - i) % size == 0).all()
    np.testing.assert_array_equal(table.wrapped(i + 7 * size, size), inside)
    np.testing.assert_array_equal(table.wrapped(inside, size), inside)


@SETTINGS
@given(seeds, strengths)
def test_strength_goes_through_interpolation(seed, strength):
    rng = np.random.default_rng(seed)
    patch, at = rng.uniform(-1, 1, (COUNT, 4, 3)), rng.random((2, COUNT))
    np.testing.assert_allclose(patches.patch_normal(table.strengthened(patch, strength), *at),
                               table.strengthened(patches.patch_normal(patch, *at), strength), atol=1e-12)


# --- footprint.h ---


def random_cones(rng):
    """Arguments of ray_footprint: rays of random size and direction to 89.9 degrees, random UVs."""
    basis = rotations(rng, COUNT)
    cone = 10.0 ** rng.uniform(-3, 0, (COUNT, 1))
    cosine, angle = 10.0 ** rng.uniform(-2.7, 0, COUNT), rng.uniform(0, 2 * np.pi, COUNT)
    across = np.cos(angle)[:, None] * basis[:, 0] + np.sin(angle)[:, None] * basis[:, 1]
    view = cosine[:, None] * basis[:, 2] + np.sqrt(1 - cosine**2)[:, None] * across
    jacobian = rng.normal(size=(COUNT, 2, 2)) * 10.0 ** rng.uniform(-2, 2, (COUNT, 1, 1))
    return [cone * basis[:, 0], cone * basis[:, 1], view, basis[:, 2], rng.uniform(0.2, 1.1, COUNT), jacobian]


def shape_of(dpdx, dpdy, view, normal, radius, jacobian):
    """Footprint, and its covariance (n, 2, 2) in texels."""
    entries = jacobian.reshape(-1, 4).T
    valid, shape = footprint.ray_footprint(dpdx, dpdy, view, normal, radius, *entries)
    assert valid.all()
    axes = np.stack([shape.ux, shape.uy, shape.vx, shape.vy], -1).reshape(-1, 2, 2)
    return shape, axes @ axes.transpose(0, 2, 1)


def assert_close(one, other):
    """Equal relative to the largest entry of each row."""
    size = np.abs(other).reshape(len(other), -1).max(1).reshape(-1, *[1] * (np.ndim(other) - 1))
    np.testing.assert_allclose(one / size, other / size, atol=1e-6)


@SETTINGS
@given(seeds)
def test_area_and_axes_of_a_footprint_agree_and_its_steps_are_the_inverse_of_the_uvs(seed):
    arguments = random_cones(np.random.default_rng(seed))
    shape, covariance = shape_of(*arguments)
    np.testing.assert_allclose(shape.area, np.pi * shape.long_axis * shape.short_axis, rtol=1e-9)
    np.testing.assert_allclose(np.linalg.eigvalsh(covariance)[:, 1], shape.long_axis**2, rtol=1e-6)
    assert (shape.long_axis >= shape.short_axis).all()
    steps = np.stack([shape.xu, shape.xv, shape.yu, shape.yv], -1).reshape(-1, 2, 2)
    condition = np.linalg.cond(arguments[5])[:, None, None]
    error = np.abs(steps @ arguments[5] - np.eye(2))
    assert (error < 1e-12 * condition).all()


@SETTINGS
@given(seeds)
def test_footprints_do_not_depend_on_which_way_the_world_or_the_ray_differentials_are_turned(seed):
    rng = np.random.default_rng(seed)
    dpdx, dpdy, view, normal, radius, jacobian = random_cones(rng)
    _, expected = shape_of(dpdx, dpdy, view, normal, radius, jacobian)
    turn = rotations(rng, 1)[0]
    _, turned = shape_of(dpdx @ turn.T, dpdy @ turn.T, view @ turn.T, normal @ turn.T, radius, jacobian)
    assert_close(turned, expected)
    # Cycles may choose any pair in the surface: (x, y) -> (cos x + sin y, -sin x + cos y), and the UVs with it.
    c, s = np.cos(1.0), np.sin(1.0)
    _, other = shape_of(c * dpdx + s * dpdy, c * dpdy - s * dpdx, view, normal, radius,
                        jacobian @ np.array([[c, -s], [s, c]]))
    assert_close(other, expected)
    # A back face is seen as the front is.
    _, behind = shape_of(dpdx, dpdy, view, -normal, radius, jacobian)
    assert_close(behind, expected)


@SETTINGS
@given(seeds, exponents, exponents)
def test_footprints_grow_with_the_uvs_and_not_with_the_world(seed, size, uv_size):
    dpdx, dpdy, view, normal, radius, jacobian = random_cones(np.random.default_rng(seed))
    before, covariance = shape_of(dpdx, dpdy, view, normal, radius, jacobian)
    assume((before.long_axis * 10.0**uv_size < 1e9).all())  # larger ones are refused
    after, grown = shape_of(dpdx * 10.0**size, dpdy * 10.0**size, view, normal, radius, jacobian * 10.0**uv_size)
    assert_close(grown, covariance * 100.0**uv_size)
    np.testing.assert_allclose(after.area, before.area * 100.0**uv_size, rtol=1e-9)
    # Mirrored and exchanged UVs: the same ellipse, mirrored.
    for change in (np.diag([-1.0, 1.0]), np.array([[0.0, 1.0], [1.0, 0.0]])):
        _, mirrored = shape_of(dpdx, dpdy, view, normal, radius, change @ jacobian)
        assert_close(mirrored, change @ covariance @ change.T)


@SETTINGS
@given(st.floats(0, 1e6), st.floats(1, 1e6))
def test_more_samples_have_smaller_footprints(samples, factor):
    one, many = footprint.footprint_radius(np.array([samples, max(samples, 1.0) * factor]))
    assert 0 < many <= one <= footprint.FOOTPRINT_SCALE


# --- light_hint.h ---


def seen_hint(rng, light, shape, position, view, basis, *, view_turn=0.0, step=1e-6, k_alpha=0.05):
    """Twin's hint on a flat surface (its tangent, bitangent and normal are `basis`), with texels of length `step`."""
    still = np.zeros((1, 3))
    frame = light_hint.NormalFrame(*basis[:, None], step * basis[:1], step * basis[1:2], *[still] * 6)
    pixel = footprint.Footprint(*[np.array([value]) for value in (1, 0, 0, 1, 1, 0, 0, 1, 1, 1, 1)])
    return light_hint.half_vector(
        light[None], shape[None], k_alpha, frame, pixel, np.array([view_turn]), position[None], view[None], basis[2:],
    )


@SETTINGS
@given(seeds, st.booleans(), st.booleans())
def test_slopes_turn_along_the_surface_as_the_half_vector_does(seed, is_local, is_perspective):
    rng = np.random.default_rng(seed)
    basis = rotations(rng, 1)[0]
    eye = rng.normal(size=3) + 3 * basis[2]
    light = rng.normal(size=3) + 3 * basis[2]
    shape = np.array([light_hint.HINT_LOCAL if is_local else light_hint.HINT_SUN, 0.01])
    if not is_local:
        light = unit(light)
    far = unit(rng.normal(size=3) + 3 * basis[2])

    def at(texel):
        position = 1e-6 * (texel[0] * basis[0] + texel[1] * basis[1])
        view = unit(eye - position) if is_perspective else far
        turn = 1 / np.linalg.norm(eye - position) if is_perspective else 0.0
        return seen_hint(rng, light, shape, position, view, basis, view_turn=turn)

    valid, hint = at((0, 0))
    assume(valid[0])
    # The normal that mirrors the light here; its slope a few texels further, around the half vector there.
    mirror = basis @ hint.h[0]
    for texel in ((30, 0), (0, 30), (20, -10)):
        _, there = at(texel)
        moved = query.hint_slope(there, mirror[None], 0.0, 0.0)[1][0] @ there.axes[0]
        predicted = query.hint_slope(hint, mirror[None], *texel)[1][0] @ hint.axes[0]
        np.testing.assert_allclose(moved, predicted, atol=1e-8)


@SETTINGS
@given(seeds, st.floats(0.001, 0.9), st.floats(0.0, 3.0))
def test_the_region_of_a_lamp_holds_the_half_vectors_of_all_its_points(seed, size, distance_to_surface):
    rng = np.random.default_rng(seed)
    basis = rotations(rng, 1)[0]
    light = (size + distance_to_surface) * unit(rng.normal(size=3) + 2 * basis[2])
    view = unit(rng.normal(size=3) + 2 * basis[2])
    shape = np.array([light_hint.HINT_LOCAL, size])
    valid, hint = seen_hint(rng, light, shape, np.zeros(3), view, basis, k_alpha=0.0)
    assume(valid[0])
    points = light + size * unit(rng.normal(size=(200, 3))) * rng.random((200, 1)) ** (1 / 3)
    half = unit(unit(points) + view)
    slopes = half @ hint.axes[0].T / (half @ hint.h[0])[:, None]
    # As in test_reference.py: a region of slopes is a little narrower than the half vectors of the light's cone.
    half_angle = np.arcsin(size / np.linalg.norm(light))
    r = hint.radius[0] * np.tan(half_angle / 2) / (half_angle / 2)
    assume(r < 1)
    assert np.linalg.norm(slopes, axis=1).max() <= r * (1 + r) / (1 - r) + 1e-9


@SETTINGS
@given(seeds, st.floats(0.0, 3.0), st.floats(0.0, 0.3), st.floats(0.0, 0.3), st.floats(0.02, 0.5))
def test_no_patch_is_skipped_on_uneven_objects_and_small_spheres(seed, uneven, turn, roughness, radius):
    # uneven: logarithm of the ratio of an object's scales; turn: of the surface from one texel to the next, in radians;
    # roughness: of the map within a patch, 0 where all its corners are alike.
    rng = np.random.default_rng(seed)
    scale = np.exp(np.stack([uneven * rng.uniform(-1, 1, COUNT), np.zeros(COUNT), np.zeros(COUNT)], axis=1))
    forms = rotations(rng, COUNT) * scale[:, None]
    turns = turn * unit(rng.normal(size=(COUNT, 2, 2)))
    away = rng.uniform(0, 5, (2, COUNT))
    hint = whole_hint(forms, turns, np.full(COUNT, radius), extent=away.T)

    # A patch whose normal at (a, b) is at the rim of the region, all others as far beyond it as its ball allows.
    at = rng.random((2, COUNT))
    offset = away * rng.choice([-1, 1], (2, COUNT))
    slope = radius * rng.uniform(0.9, 1.0, (COUNT, 1)) * unit(rng.normal(size=(COUNT, 2)))
    turned = slope - np.einsum("nst,nt->ns", turns, (offset + at).T)
    inside = np.linalg.solve(forms, np.concatenate([turned, np.ones((COUNT, 1))], axis=1)[..., None])[..., 0]
    worst = np.linalg.svd(forms[:, :2])[2][:, 0]
    worst *= np.sign(np.einsum("ns,nsk,nk->n", slope, forms[:, :2], worst))[:, None]
    ball = roughness * np.linalg.norm(inside, axis=1)
    centre = inside + ball[:, None] * worst
    reached, _ = query.hint_reaches_ball(hint, centre, ball + 1e-9, *(offset + 0.5))
    assert reached.all()


# --- map.h ---


@SETTINGS
@given(seeds)
def test_a_patch_mirrored_has_its_normals_mirrored(seed):
    rng = np.random.default_rng(seed)
    patch, (a, b) = rng.normal(size=(COUNT, 4, 3)), rng.random((2, COUNT))
    expected = patches.patch_normal(patch, a, b)
    np.testing.assert_allclose(patches.patch_normal(patch[:, [1, 0, 3, 2]], 1 - a, b), expected, atol=1e-12)
    np.testing.assert_allclose(patches.patch_normal(patch[:, [0, 2, 1, 3]], b, a), expected, atol=1e-12)


@SETTINGS
@given(seeds, st.floats(0.02, 0.5))
def test_the_covariance_of_a_patch_is_that_of_the_slopes_around_a_point(seed, radius):
    rng = np.random.default_rng(seed)
    forms = rotations(rng, 1)
    upright = unit(np.linalg.solve(forms, np.array([[[0.1], [-0.1], [1.0]]]))[..., 0])
    patch = upright[:, None] + 0.1 * rng.normal(size=(1, 4, 3))
    hint = whole_hint(forms, 0.02 * rng.normal(size=(1, 2, 2)), np.array([radius]))
    # Positions around (0.5, 0.5) whose two deviations are so small that the slope is linear.
    first, second = 1e-3 * rng.normal(size=(2, 1, 2))
    draws = rng.normal(size=(2, 4000))
    positions = 0.5 + draws[0][:, None] * first + draws[1][:, None] * second
    many = hint.at(np.zeros(4000, int))
    normals = patches.patch_normal(np.repeat(patch, 4000, axis=0), *positions.T)
    sampled = np.cov(query.hint_slope(many, normals, *positions.T)[1].T)
    expected = query.spread_over_part(hint, patch, np.full(1, 0.5), np.full(1, 0.5), first, second)[0]
    # 4000 draws know a variance to 2 %; five times that.
    tolerance = 0.11 * expected[[0, 2]].max()
    np.testing.assert_allclose([sampled[0, 0], sampled[0, 1], sampled[1, 1]], expected, atol=tolerance)


# --- selection.h ---


@SETTINGS
@given(seeds, st.integers(1, 12), st.integers(1, 4))
def test_reservoirs_keep_elements_with_odds_of_their_importance(seed, count, limit):
    """So that what is kept, times sum over importance, has all elements as its mean, whatever lights these show."""
    importance = np.random.default_rng(seed).uniform(0.02, 1, count)
    draws = 1000
    kept = np.zeros(count)
    for draw in range(draws):
        chosen, sums, _ = selection.reservoirs(importance, limit, (draw + 0.5) / draws)
        kept[chosen] += 1
    for k in range(min(count, limit)):
        own = importance[k::limit]
        assert sums[k] == pytest.approx(own.sum())
        # Each of the reservoir's elements is kept over a few intervals of the random number, whose ends may be missed.
        np.testing.assert_allclose(kept[k::limit] / draws, own / own.sum(), atol=(len(own) + 1) / draws)


# --- image_texture.h, checker.h ---


@SETTINGS
@given(seeds, st.integers(1, 7), st.integers(1, 7), st.integers(-50, 50), st.integers(-50, 50))
def test_interpolation_is_periodic_stays_in_range_and_meets_the_texels(seed, width, height, right, up):
    rng = np.random.default_rng(seed)
    pixels, uv = rng.random((height, width, 3)), rng.uniform(-2, 2, (COUNT, 2))
    shown = image_texture.bilinear(pixels, uv)
    np.testing.assert_allclose(image_texture.bilinear(pixels, uv + [right, up]), shown, atol=1e-9)
    assert (shown >= pixels.min((0, 1)) - 1e-12).all() and (shown <= pixels.max((0, 1)) + 1e-12).all()
    centres = (np.floor(uv * [width, height]) + 0.5) / [width, height]
    texels = image_texture.nearest(pixels, centres)
    np.testing.assert_allclose(image_texture.bilinear(pixels, centres), texels, atol=1e-9)
    moved = image_texture.bilinear(np.roll(pixels, (up, right), (0, 1)), uv + [right / width, up / height])
    np.testing.assert_allclose(moved, shown, atol=1e-9)


@SETTINGS
@given(seeds, st.floats(-3, 3), exponents)
def test_spherical_coordinates_turn_with_the_sphere(seed, angle, size):
    rng = np.random.default_rng(seed)
    points, origin = rng.normal(size=(COUNT, 3)), rng.normal(size=3)
    uv = image_texture.spherical_uv(origin + points, origin)
    assert ((uv >= 0) & (uv <= 1)).all()
    np.testing.assert_allclose(image_texture.spherical_uv(10.0**size * points), uv, atol=1e-9)
    c, s = np.cos(angle), np.sin(angle)
    turned = image_texture.spherical_uv(points @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]))
    np.testing.assert_allclose((turned[:, 0] - uv[:, 0] - angle / (2 * np.pi) + 0.5) % 1, 0.5, atol=1e-9)
    np.testing.assert_allclose(turned[:, 1], uv[:, 1], atol=1e-9)


@FEW
@given(seeds, st.floats(0.05, 3.0))
def test_the_share_of_the_checker_swaps_with_every_half_period_and_returns_after_a_whole_one(seed, spread):
    rng = np.random.default_rng(seed)
    point, (long_axis, short_axis) = rng.uniform(-5, 5, 3), spread * rng.normal(size=(2, 3))

    def share(at, first=long_axis, second=short_axis):
        return checker.checker_share(at, first, second, np.random.default_rng(seed))

    expected = share(point)
    noise = 0.01  # of 160,000 stratified points, whose strata the edges cut
    assert share(point + [np.pi, 0, 0]) == pytest.approx(1 - expected, abs=1e-9)
    assert share(point + [0, 2 * np.pi, -2 * np.pi]) == pytest.approx(expected, abs=1e-9)
    assert share(point, -long_axis, short_axis) == pytest.approx(expected, abs=noise)
    assert share(point, short_axis, long_axis) == pytest.approx(expected, abs=noise)
    assert share(-point, -long_axis, -short_axis) == pytest.approx(1 - expected, abs=1e-9)
