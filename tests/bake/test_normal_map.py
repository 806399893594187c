"""Pixels to tangent-space normals: decoding against Cycles' formula, the two conventions, and each refusal."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glint_addon.bake.normal_map import CONVENTIONS, LARGEST_SIDE, ROWS, check_normals, decoded_normals, slope_bounds
from glint_addon.errors import MapError

seeds = st.integers(0, 2**32 - 1)


def pixels(*colors):
    """An image of one row."""
    return np.array([colors], np.float32)


def refusal(*arguments, **settings) -> str:
    """The one sentence with which a map is refused, whether it is decoded or checked alone."""
    with pytest.raises(MapError) as error:
        decoded_normals(*arguments, **settings)
    sentence = str(error.value)
    with pytest.raises(MapError) as same:
        check_normals(*arguments, **settings)
    assert str(same.value) == sentence
    assert sentence.endswith(".") and ": " in sentence and "\n" not in sentence
    return sentence


def test_a_colour_is_decoded_as_the_normal_map_node_does_and_not_normalised():
    normals = decoded_normals(pixels((0.5, 0.5, 1), (1, 0.25, 0.5), (0, 0, 0), (0.75, 0.5, 0.75)))
    np.testing.assert_array_equal(normals[0], [(0, 0, 1), (1, -0.5, 0), (-1, -1, -1), (0.5, 0, 0.5)])
    assert normals.dtype == np.float32


def test_directx_turns_green_around_and_nothing_else():
    image = np.random.default_rng(1).random((5, 7, 3)).astype(np.float32)
    opengl, directx = (decoded_normals(image, convention=name) for name in CONVENTIONS)
    np.testing.assert_array_equal(directx, opengl * np.float32([1, -1, 1]))


def test_alpha_is_ignored_and_the_image_is_left_alone():
    image = np.random.default_rng(2).random((4, 3, 4)).astype(np.float32)
    before = image.copy()
    np.testing.assert_array_equal(decoded_normals(image, convention="DIRECTX"),
                                  decoded_normals(image[..., :3], convention="DIRECTX"))
    np.testing.assert_array_equal(image, before)


def test_an_unknown_convention_is_refused_with_those_there_are():
    sentence = refusal(pixels((0.5, 0.5, 1)), convention="VULKAN")
    assert "VULKAN" in sentence and all(name in sentence for name in CONVENTIONS)


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 1), (4, 4, 2), (0, 4, 3), (4, 0, 3), (2, 4, 4, 3)])
def test_what_has_no_colour_pixels_is_refused(shape):
    sentence = refusal(np.ones(shape, np.float32), name="grey.png")
    assert "grey.png" in sentence and "RGB" in sentence


def test_a_map_too_large_is_refused_before_it_is_copied():
    # A view of one pixel: gigabytes if anything touched it.
    huge = np.broadcast_to(np.float32([0.5, 0.5, 1]), (1, LARGEST_SIDE + 1, 3))
    assert "larger than 32768" in refusal(huge)
    assert decoded_normals(huge[:, :LARGEST_SIDE]).shape == (1, LARGEST_SIDE, 3)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30, -2e6])
def test_pixels_that_are_no_numbers_are_counted_and_refused(value):
    image = np.full((4, 5, 3), 0.75, np.float32)
    image[1, 2, 0] = image[3, 4, 1] = image[3, 4, 2] = value
    assert 'Normal map "odd.exr" has 2 pixels that are NaN, infinite or huge' in refusal(image, name="odd.exr")


def test_normals_of_length_zero_are_counted_and_refused():
    image = np.full((4, 5, 3), 0.75, np.float32)
    image[0, 0] = image[2, 2] = image[3, 0] = 0.5
    assert "has 3 pixels of value (0.5, 0.5, 0.5)" in refusal(image)


@pytest.mark.parametrize("value", [0.0, 0.25, 0.49])
def test_a_black_or_grey_picture_is_refused_because_nothing_faces_up(value):
    image = np.full((3 * ROWS, 5, 3), value, np.float32)
    sentence = refusal(image, name="black.png")
    assert '"black.png" has no pixel that faces up' in sentence and "choose a normal map" in sentence
    # One texel that does is enough, wherever it is.
    image[-1, -1] = (0.5, 0.5, 0.75)
    assert decoded_normals(image)[-1, -1, 2] == 0.5


def test_a_flat_map_is_a_mirror_and_not_refused():
    flat = np.full((4, 4, 3), (0.5, 0.5, 1.0), np.float32)
    check_normals(flat)
    assert (decoded_normals(flat) == (0, 0, 1)).all()


@pytest.mark.parametrize("height", [1, ROWS - 1, ROWS, 3 * ROWS + 1])
def test_the_last_row_of_a_map_of_any_height_is_checked(height):
    image = np.full((height, 5, 3), (0.5, 0.5, 1.0), np.float32)
    check_normals(image)
    image[-1, 4] = 0.5
    assert "has 1 pixels of value" in refusal(image)


def test_checking_a_map_keeps_no_normals():
    image = np.full((64 * ROWS, 64, 3), (0.5, 0.5, 1.0), np.float32)
    tracemalloc.start()
    try:
        check_normals(image)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < image.nbytes / 4


@settings(max_examples=100, deadline=None, derandomize=True)
@given(seeds, st.integers(1, 6), st.integers(1, 6), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_slope_bounds_hold_the_slopes_of_every_bilinear_normal(seed, height, width, a, b):
    normals = np.random.default_rng(seed).uniform([-1, -1, 0.05], [1, 1, 1], (height, width, 3)).astype(np.float32)
    low, high = slope_bounds(normals)
    corners = [np.roll(normals, (-dv, -du), (0, 1)).astype(float) for dv in (0, 1) for du in (0, 1)]
    weights = ((1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b)
    between = sum(weight * corner for weight, corner in zip(weights, corners, strict=True))
    slopes = between[..., :2] / between[..., 2:]
    rounding = 4 * 2.0**-24 * np.abs([low, high]).max()  # the bounds are float32 quotients
    assert (slopes >= low - rounding).all() and (slopes <= high + rounding).all()


def test_slope_bounds_are_reached():
    normals = np.float32([[(0.5, 0, 1), (0, -0.25, 0.5), (-0.125, 0.25, 1)]])
    low, high = slope_bounds(normals)
    np.testing.assert_array_equal(low, [-0.125, -0.5])
    np.testing.assert_array_equal(high, [0.5, 0.25])


@pytest.mark.parametrize("z", [0.0, -0.1])
def test_a_normal_at_or_below_the_horizon_leaves_no_bound(z):
    low, high = slope_bounds(np.float32([[(0, 0, 1), (0.5, 0, z)]]))
    assert np.isneginf(low).all() and np.isposinf(high).all()
