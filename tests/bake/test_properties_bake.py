"""What baking must obey for every map: normals, slope bounds, tables, pyramids, tangent frames, on random inputs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from glint_addon.bake import float_image, normal_map, pyramid, table
from glint_addon.bake.openimageio import oiio
from glint_addon.errors import MapError
from tests.reference import image_texture as interpolation
from tests.reference import map as patches
from tests.reference import table as shader
from tests.reference import tangent_frame

SETTINGS = settings(max_examples=60, deadline=None, derandomize=True)
EPSILON = 2.0**-23  # float32 rounding of one operation
ROUNDING = 16 * EPSILON  # of the few operations a value goes through

seeds = st.integers(0, 2**32 - 1)
sides = st.integers(1, 9)
colors = st.floats(0, 1, width=32)
strengths = st.one_of(st.floats(0, 1), st.floats(1, 10), st.floats(-3, 0))
shapes = st.tuples(sides, sides, st.just(3))
encoded_maps = arrays.arrays(np.float32, shapes, elements=colors)
# Of any size that a float32 holds, the smallest and the largest among them.
any_floats = st.floats(width=32, allow_nan=True, allow_infinity=True)
sizes = st.floats(-30, 30).map(lambda exponent: 10.0**exponent)


def upright_normals(seed, shape, lowest=0.05):
    """Random normals above the horizon, of any length up to 1.7: float32 (*shape, 3)."""
    return np.random.default_rng(seed).uniform([-1, -1, lowest], [1, 1, 1], (*shape, 3)).astype(np.float32)


def between(normals, a, b):
    """The bilinear normals at (a, b) of every patch of a map that repeats, in float64."""
    corners = [np.roll(normals, (-dv, -du), (0, 1)).astype(float) for du, dv in patches.CORNERS]
    patch = np.stack(corners, axis=2).reshape(-1, 4, 3)
    at = np.full(len(patch), a), np.full(len(patch), b)
    return patches.patch_normal(patch, *at).reshape(normals.shape)


# --- normal_map.py ---


@SETTINGS
@given(arrays.arrays(np.float32, shapes, elements=any_floats), st.sampled_from(normal_map.CONVENTIONS))
def test_a_map_of_any_numbers_is_refused_in_a_sentence_or_has_finite_directions(pixels, convention):
    try:
        normals = normal_map.decoded_normals(pixels, convention=convention, name="odd")
    except MapError as error:
        assert str(error).startswith('Normal map "odd" has ') and str(error).endswith(".")
        return
    with np.errstate(over="raise", invalid="raise"):
        lengths = np.einsum("hwc,hwc->hw", normals, normals)
    assert (lengths > 0).all()
    low, high = normal_map.slope_bounds(normals)
    assert not np.isnan([low, high]).any() and (low <= high).all()
    assert np.isfinite(table.table_pixels(normals, "LINEAR")).all()


@SETTINGS
@given(encoded_maps, st.integers(0, 8), st.integers(0, 8))
def test_decoding_commutes_with_moving_and_mirroring_the_map(pixels, right, up):
    def moved(image):
        return np.roll(image, (up, right), (0, 1))[::-1, ::-1]

    try:
        expected = moved(normal_map.decoded_normals(pixels))
    except MapError:
        with pytest.raises(MapError):
            normal_map.decoded_normals(moved(pixels))
        return
    np.testing.assert_array_equal(normal_map.decoded_normals(moved(pixels)), expected)


@SETTINGS
@given(seeds, sides, sides, strengths, st.floats(0, 1), st.floats(0, 1), st.floats(0.02, 2.0), st.booleans())
def test_slope_bounds_hold_every_interpolated_normal_at_every_strength(
    seed, height, width, strength, a, b, length, tilted
):
    # tilted: all slopes on one side of 0, which weak strengths pull out of the scaled bounds.
    normals = upright_normals(seed, (height, width))
    if tilted:
        normals[..., :2] = np.abs(normals[..., :2])
    normals *= np.float32(length)
    n = shader.strengthened(between(normals, a, b), strength)
    slopes = n[..., :2] / n[..., 2:]
    low, high = shader.strengthened_bounds(*normal_map.slope_bounds(normals), strength)
    rounding = ROUNDING * max(np.abs([low, high]).max(), 1e-6)
    assert (slopes >= low - rounding).all() and (slopes <= high + rounding).all()


@SETTINGS
@given(seeds, sides, sides)
def test_slope_bounds_turn_with_the_map(seed, height, width):
    normals = upright_normals(seed, (height, width))
    low, high = normal_map.slope_bounds(normals)
    # A quarter turn: (x, y) -> (-y, x); a mirror: x -> -x.
    turned = normal_map.slope_bounds(np.rot90(normals)[..., [1, 0, 2]] * np.float32([-1, 1, 1]))
    np.testing.assert_array_equal(turned, [[-high[1], low[0]], [-low[1], high[0]]])
    mirrored = normal_map.slope_bounds(normals[:, ::-1] * np.float32([-1, 1, 1]))
    np.testing.assert_array_equal(mirrored, [[-high[0], low[1]], [-low[0], high[1]]])


# --- table.py, float_image.py ---


@SETTINGS
@given(seeds, sides, sides, st.sampled_from(["LINEAR", "CLOSEST"]), sizes)
def test_a_table_holds_each_normal_once_and_zeros_beside_it(seed, height, width, way, size):
    normals = upright_normals(seed, (height, width)) * np.float32(min(size, 1e6))
    pixels = table.table_pixels(normals, way)
    np.testing.assert_array_equal(pixels[:height, :width, :3], normals)
    outside = pixels.copy()
    outside[:height, :width] = 0
    assert not outside.any()
    # Only the first texel has the magic: any shrinking mixes it.
    assert pixels[0, 0, 3] == table.MAGIC and (pixels[..., 3] == table.MAGIC).sum() == 1
    assert way == "LINEAR" or np.count_nonzero(pixels[..., 3]) == 1
    assert pixels.shape == (table.padded_size(height), table.padded_size(width), 4)


@SETTINGS
@given(seeds, sides, sides, st.integers(-20, 20), st.integers(-20, 20))
def test_radii_of_patches_move_and_mirror_with_the_map(seed, height, width, right, up):
    normals = upright_normals(seed, (height, width))
    radii = table.patch_radii(normals)
    np.testing.assert_array_equal(table.patch_radii(np.roll(normals, (up, right), (0, 1))),
                                  np.roll(radii, (up, right), (0, 1)))
    # Mirrored, a patch starts at its other side's texel, which is the one before.
    mirrored = np.roll(table.patch_radii(normals[:, ::-1])[:, ::-1], -1, axis=1)
    np.testing.assert_allclose(mirrored, radii, rtol=ROUNDING, atol=ROUNDING)


@SETTINGS
@given(seeds, sides, sides, strengths, st.floats(0, 1), st.floats(0, 1))
def test_the_ball_of_a_patch_holds_its_normals_at_every_strength(seed, height, width, strength, a, b):
    normals = upright_normals(seed, (height, width), lowest=-1)
    j, i = np.indices((height, width))
    bounded = shader.patch_has_bounds(width, height, i, j)
    centre, radius = shader.patch_bounds(table.table_pixels(normals, "LINEAR"), i[bounded], j[bounded])
    n = shader.strengthened(between(normals, a, b)[bounded], strength)
    larger = max(abs(strength), 1.0)
    distance = np.linalg.norm(n - shader.strengthened(centre, strength), axis=-1)
    assert (distance <= (radius + ROUNDING) * larger).all()


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seeds, sides, sides, st.sampled_from(["LINEAR", "CLOSEST"]))
def test_a_table_comes_back_from_disk_to_the_last_bit(tmp_path_factory, seed, height, width, way):
    rng = np.random.default_rng(seed)
    normals = (rng.normal(size=(height, width, 3)) * 10.0 ** rng.uniform(-6, 6, (height, width, 1))).astype(np.float32)
    path, written = table.bake_table(normals, tmp_path_factory.mktemp("tables"), interpolation=way)
    source = oiio.ImageInput.open(str(path))
    stored = source.read_image(oiio.FLOAT)[::-1]
    source.close()
    np.testing.assert_array_equal(stored, table.table_pixels(normals, way))
    assert written and table.bake_table(normals, path.parent, interpolation=way) == (path, False)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(arrays.arrays(np.float32, (3, 5, 4), elements=st.floats(width=32)))
def test_a_float_image_keeps_every_float_there_is(tmp_path_factory, pixels):
    file = tmp_path_factory.mktemp("floats") / "any.exr"
    float_image.write_whole(file, pixels)
    source = oiio.ImageInput.open(str(file))
    stored = source.read_image(oiio.FLOAT)[::-1]
    source.close()
    np.testing.assert_array_equal(stored.view(np.uint32), pixels.view(np.uint32))


# --- pyramid.py ---


@SETTINGS
@given(seeds, sides, sides)
def test_every_level_of_a_pyramid_keeps_the_mean_of_the_image_and_stays_within_its_range(seed, height, width):
    image = np.random.default_rng(seed).random((height, width, 4)).astype(np.float32)
    levels = pyramid.levels(image, encoded=False, associated=False)
    assert levels[-1].shape == (1, 1, 4)
    for level in levels[1:]:
        np.testing.assert_allclose(level.mean(axis=(0, 1)), image.mean(axis=(0, 1)), rtol=ROUNDING)
        assert (level >= image.min((0, 1)) * (1 - ROUNDING)).all()
        assert (level <= image.max((0, 1)) * (1 + ROUNDING)).all()


@SETTINGS
@given(st.integers(1, 20000))
def test_the_overlaps_of_a_halved_row_cover_it_once(size):
    index, weight = pyramid.area_overlaps(size)
    np.testing.assert_allclose(weight.sum(axis=1), 1, rtol=ROUNDING)
    covered = np.bincount(index.ravel(), weight.ravel() * size / len(index), minlength=size)
    # A float32 share of the row, whose overlaps are differences of numbers up to its size.
    np.testing.assert_allclose(covered, 1, atol=ROUNDING)


@SETTINGS
@given(seeds, sides, sides, colors)
def test_the_means_of_a_flat_encoded_image_are_its_decoded_color(seed, height, width, alpha):
    flat = np.empty((height, width, 4), np.float32)
    flat[..., :3] = np.random.default_rng(seed).random(3) * alpha
    flat[..., 3] = alpha
    means = pyramid.texel_means(flat, associated=True)
    straight = flat[..., :3] / alpha if alpha > 0 else flat[..., :3]
    # Where alpha is tiny the straight color is a quotient of tiny numbers; the result is as small as alpha.
    np.testing.assert_allclose(means[..., :3], interpolation.srgb_decoded(straight) * alpha, rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(means[..., 3], alpha, rtol=ROUNDING)


# --- tangent_frame.py ---


@SETTINGS
@given(seeds, sizes, sizes)
def test_a_solved_frame_gives_back_the_edges_at_every_size(seed, size, uv_size):
    rng = np.random.default_rng(seed)
    positions, uvs = size * rng.normal(size=(40, 3, 3)), uv_size * rng.normal(size=(40, 3, 2))
    frame = tangent_frame.triangle_frame(positions, uvs)
    good = ~frame.degenerate
    assert good.mean() > 0.9
    for edge in (1, 2):
        du, dv = (uvs[good, edge] - uvs[good, 0]).T
        step = du[:, None] * frame.tangent[good] + dv[:, None] * frame.bitangent[good]
        # Slivers amplify rounding by the inverse of their sine, 1e6 at most.
        np.testing.assert_allclose(step, (positions[:, edge] - positions[:, 0])[good], rtol=0, atol=1e-8 * size)


@SETTINGS
@given(seeds, sizes, sizes, st.booleans())
def test_a_frame_is_orthonormal_and_mirrored_exactly_where_its_uvs_are(seed, size, uv_size, flat_uvs):
    rng = np.random.default_rng(seed)
    positions, uvs = size * rng.normal(size=(40, 3, 3)), uv_size * rng.normal(size=(40, 3, 2))
    if flat_uvs:
        uvs[::2, :, 1] = uvs[::2, :, :1].mean(axis=1)
        uvs[::4] = 0
    frame = tangent_frame.triangle_frame(positions, uvs)
    assert not flat_uvs or frame.degenerate[::2].all()
    axes = np.stack([tangent_frame.tangent_to_world(frame, np.broadcast_to(n, (40, 3))) for n in np.eye(3)], axis=1)
    np.testing.assert_allclose(axes @ axes.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (40, 3, 3)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(axes), frame.sign, atol=1e-9)
    mirrored = tangent_frame.triangle_frame(positions, uvs * [-1, 1])
    np.testing.assert_array_equal(mirrored.sign, np.where(frame.degenerate, 1, -frame.sign))


@SETTINGS
@given(seeds)
def test_frames_turn_with_the_triangle_and_do_not_move_with_it(seed):
    rng = np.random.default_rng(seed)
    positions, uvs = rng.normal(size=(40, 3, 3)), rng.normal(size=(40, 3, 2))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))  # no mirror
    here = tangent_frame.triangle_frame(positions, uvs)
    there = tangent_frame.triangle_frame(positions @ turn.T + rng.normal(size=3), uvs + rng.normal(size=2))
    n = rng.normal(size=(40, 3))
    for orthonormal in (True, False):
        expected = tangent_frame.tangent_to_world(here, n, orthonormal=orthonormal) @ turn.T
        np.testing.assert_allclose(tangent_frame.tangent_to_world(there, n, orthonormal=orthonormal), expected,
                                   atol=1e-8)


@SETTINGS
@given(arrays.arrays(np.float64, (3, 3), elements=st.floats(-1e30, 1e30)),
       arrays.arrays(np.float64, (3, 2), elements=st.floats(-1e30, 1e30)))
def test_any_triangle_with_finite_corners_has_a_finite_frame(positions, uvs):
    frame = tangent_frame.triangle_frame(positions, uvs)
    world = tangent_frame.tangent_to_world(frame, np.array([0.3, -0.2, 0.9]))
    assert np.isfinite(frame.tangent).all() and np.isfinite(frame.bitangent).all()
    assert np.linalg.norm(frame.normal) == pytest.approx(1) and np.linalg.norm(world) == pytest.approx(1)
    assert np.isfinite(tangent_frame.tangent_to_world(frame, np.zeros(3))).all()


@SETTINGS
@given(seeds, st.floats(1e-6, 1), st.floats(1e-6, 1))
def test_the_basis_around_any_unit_vector_is_right_handed_and_orthonormal(seed, small, other):
    n = np.random.default_rng(seed).normal(size=(40, 3)) * [small, other, 1]
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    first, second = tangent_frame.basis_around(n)
    np.testing.assert_allclose(np.cross(first, second), n, atol=1e-9)
    np.testing.assert_allclose(np.einsum("nk,nk->n", first, second), 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm([first, second], axis=-1), 1, atol=1e-9)
