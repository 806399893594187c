"""Colours of random numbers: spreads around a colour, and ramps."""

import colorsys

import numpy as np
import pytest

from glint_addon.errors import GenerateError
from glint_addon.generate import ramp_colors, spread_colors

ID = np.random.default_rng(2).random((40, 50), np.float32)
COLOR = (0.6, 0.3, 0.1)
STOPS = [(0.25, (1.0, 0.0, 0.0)), (0.75, (0.0, 1.0, 0.5))]


def hsv(colors):
    return np.array([colorsys.rgb_to_hsv(*map(float, color)) for color in colors.reshape(-1, 3)])


@pytest.mark.parametrize("color", [COLOR, (0, 0, 0), (1, 1, 1), (0.2, 0.9, 0.4), (0.1, 0.2, 0.8), (2.0, 1.0, 0.5)])
def test_without_spread_every_flake_has_the_colour(color):
    found = spread_colors(ID, color)
    assert found.shape == (40, 50, 3) and found.dtype == np.float32
    np.testing.assert_allclose(found, np.broadcast_to(np.float32(color), found.shape), atol=1e-6)


@pytest.mark.parametrize(("name", "number"), [("hue", 0), ("saturation", 1), ("value", 2)])
def test_each_spread_changes_its_own_part_evenly_to_both_sides(name, number):
    own = np.array(colorsys.rgb_to_hsv(*COLOR))
    found = hsv(spread_colors(ID, COLOR, **{name: 0.2}))
    difference = found - own
    difference[:, 0] -= np.round(difference[:, 0])
    others = np.delete(difference, number, axis=1)
    assert np.abs(others).max() < 1e-5
    assert difference[:, number].min() == pytest.approx(-0.1, abs=0.002)
    assert difference[:, number].max() == pytest.approx(0.1, abs=0.002)
    assert abs(difference[:, number].mean()) < 5 * 0.2 / np.sqrt(12 * ID.size)


def test_the_three_parts_vary_independently():
    found = hsv(spread_colors(ID, COLOR, hue=0.1, saturation=0.2, value=0.2))
    off = np.corrcoef(found.T) - np.eye(3)
    assert np.abs(off).max() < 4.5 / np.sqrt(ID.size)


def test_colours_reflect_no_more_than_all_light():
    found = spread_colors(ID, (1, 1, 1), hue=1.0, saturation=1.0, value=1.0)
    assert found.min() >= 0 and found.max() <= 1


def test_a_ramp_is_linear_between_its_stops_and_constant_beyond():
    at = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    expected = [(1, 0, 0), (1, 0, 0), (0.5, 0.5, 0.25), (0, 1, 0.5), (0, 1, 0.5)]
    np.testing.assert_allclose(ramp_colors(at, STOPS[::-1]), expected, atol=1e-6)
    assert ramp_colors(ID, STOPS).shape == (40, 50, 3) and ramp_colors(ID, STOPS).dtype == np.float32


def test_a_constant_ramp_has_the_colours_of_its_stops_alone():
    found = ramp_colors(np.array([0.0, 0.3, 0.74, 0.76]), STOPS, "CONSTANT")
    np.testing.assert_array_equal(found, np.float32([STOPS[0][1]] * 3 + [STOPS[1][1]]))


@pytest.mark.parametrize(("stops", "interpolation", "words"), [
    ([], "LINEAR", "A colour ramp has no stops: add one."),
    (STOPS, "EASE", 'A colour ramp cannot be "EASE": choose LINEAR or CONSTANT.'),
])
def test_ramps_that_cannot_be_are_refused(stops, interpolation, words):
    with pytest.raises(GenerateError, match=words):
        ramp_colors(ID, stops, interpolation)
