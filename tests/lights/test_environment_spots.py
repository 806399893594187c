"""Spots of environment pictures whose lights are known: where they are, how wide, how strong, and what is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glint_addon.lights.world.projections import PROJECTIONS
from glint_addon.lights.world.spots import SHARE, bright_spots

SIZES = {"EQUIRECTANGULAR": (500, 1100), "MIRROR_BALL": (700, 700)}  # no multiple of a block's side
SOFT = math.radians(15)
SUN = (0.4, -0.7, 0.5)
# Of what is drawn by whole texels of a third of a degree.
POWER_TOLERANCE = 0.03
RADIUS_TOLERANCE = 0.1
TEXELS = 0.1  # of a texel, by which the direction of one may be off
DRAWN_TEXELS = 0.15  # that of a disk drawn by whole texels


def picture(projection, lights, size=None, sky=1.0):
    """Radiance of a sky with round lights ((direction, half-angle in degrees, radiance), ...), (height, width, 3)."""
    height, width = size or SIZES[projection]
    view = PROJECTIONS[projection](height, width)
    directions = view.direction(*np.mgrid[:height, :width])
    pixels = np.full((height, width, 3), sky, np.float32)
    for direction, half_angle, radiance in lights:
        pixels[directions @ unit(direction) > math.cos(math.radians(half_angle))] = radiance
    return pixels


def unit(direction):
    return np.array(direction, float) / np.linalg.norm(direction)


def irradiance(half_angle, radiance):
    return radiance * 2 * math.pi * (1 - math.cos(math.radians(half_angle)))


def angle_to(spot, direction):
    return math.degrees(np.linalg.norm(np.array(spot.direction) - unit(direction)))


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_the_texels_of_a_projection_cover_the_sphere_once(projection):
    height, width = SIZES[projection]
    view = PROJECTIONS[projection](height, width)
    places = np.mgrid[:height, :width]
    solid_angle, direction = view.solid_angle(*places), view.direction(*places)
    assert solid_angle.sum() == pytest.approx(4 * math.pi, rel=1e-3)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=-1)[solid_angle > 0], 1, atol=1e-9)
    # Each texel's solid angle in the place that its direction says: moments of the sphere.
    weights = solid_angle[..., None] / (4 * math.pi)
    np.testing.assert_allclose((weights * direction).sum((0, 1)), 0, atol=1e-3)
    np.testing.assert_allclose((weights * direction**2).sum((0, 1)), 1 / 3, atol=1e-3)


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("direction", [SUN, (-1, 1e-3, 0.2), (0.01, 0.02, 1)], ids=["sun", "seam", "zenith"])
def test_a_round_light_has_its_direction_radius_and_irradiance(projection, direction):
    half_angle, radiance = 3.0, 900.0
    [spot], wide = bright_spots(picture(projection, [(direction, half_angle, radiance)]), projection, SOFT)
    assert wide == 0
    assert angle_to(spot, direction) < DRAWN_TEXELS * 360 / 1100
    assert spot.irradiance == pytest.approx(irradiance(half_angle, radiance), rel=POWER_TOLERANCE)
    assert math.degrees(spot.half_angle) == pytest.approx(half_angle, rel=RADIUS_TOLERANCE)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_a_single_texel_is_found_where_it_is_and_as_large_as_it_is(projection):
    pixels = picture(projection, [])
    row, column = 333, 444
    pixels[row, column] = 1e5
    [spot], _ = bright_spots(pixels, projection, SOFT)
    view = PROJECTIONS[projection](*SIZES[projection])
    place = np.array([row]), np.array([column])
    solid_angle = float(view.solid_angle(*place)[0])
    assert angle_to(spot, view.direction(*place)[0]) < TEXELS * math.degrees(math.sqrt(solid_angle))
    assert spot.irradiance == pytest.approx(1e5 * solid_angle, rel=POWER_TOLERANCE)
    assert 0.5 * math.sqrt(solid_angle) < spot.half_angle < math.sqrt(solid_angle)


def test_lights_are_told_apart_and_come_strongest_first():
    close = (0.4, -0.59, 0.5)  # four degrees from SUN
    lights = [(SUN, 1.0, 3000.0), (close, 1.0, 2000.0), ((-1, 0, 1), 2.0, 1500.0)]
    spots, _ = bright_spots(picture("EQUIRECTANGULAR", lights), "EQUIRECTANGULAR", SOFT)
    for spot, direction in zip(spots, ((-1, 0, 1), SUN, close), strict=True):
        assert angle_to(spot, direction) < 0.3


def test_the_glow_around_a_sun_is_no_light_of_its_own():
    glow = [(SUN, radius, 300.0 / radius**2) for radius in (9, 8, 7, 6, 5, 4, 3)]
    [spot], _ = bright_spots(picture("EQUIRECTANGULAR", [*glow, (SUN, 1.0, 20000.0)]), "EQUIRECTANGULAR", SOFT)
    assert angle_to(spot, SUN) < 0.1
    assert spot.irradiance == pytest.approx(irradiance(1.0, 20000.0), rel=0.15)
    assert math.degrees(spot.half_angle) < 1.5


def test_what_is_wide_is_counted_and_what_is_weak_or_even_is_nothing():
    wide = picture("EQUIRECTANGULAR", [(SUN, 20.0, 50.0)])
    assert bright_spots(wide, "EQUIRECTANGULAR", SOFT) == ([], 1)
    weak = SHARE * 4 * math.pi / irradiance(1.0, 1.0)
    assert bright_spots(picture("EQUIRECTANGULAR", [(SUN, 1.0, 0.9 * weak)]), "EQUIRECTANGULAR", SOFT) == ([], 0)
    assert len(bright_spots(picture("EQUIRECTANGULAR", [(SUN, 1.0, 1.2 * weak)]), "EQUIRECTANGULAR", SOFT)[0]) == 1
    assert bright_spots(np.random.default_rng(1).random((100, 200, 4)), "EQUIRECTANGULAR", SOFT) == ([], 0)
    assert bright_spots(np.zeros((4, 8, 3)), "EQUIRECTANGULAR", SOFT) == ([], 0)


def test_values_that_are_no_light_count_as_black_as_in_cycles():
    pixels = picture("EQUIRECTANGULAR", [(SUN, 2.0, 900.0)])
    clean = bright_spots(pixels, "EQUIRECTANGULAR", SOFT)
    pixels[0, :4] = np.array([np.nan, np.inf, -np.inf, -1e9])[:, None]
    [spot], _ = bright_spots(pixels, "EQUIRECTANGULAR", SOFT)
    assert spot.irradiance == pytest.approx(clean[0][0].irradiance, rel=1e-6)


def test_a_coloured_light_counts_by_its_strongest_channel():
    pixels = picture("EQUIRECTANGULAR", [(SUN, 2.0, 900.0)])
    pixels[..., 1:] = 0
    [spot], _ = bright_spots(pixels, "EQUIRECTANGULAR", SOFT)
    assert spot.irradiance == pytest.approx(irradiance(2.0, 900.0), rel=POWER_TOLERANCE)


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (3, 5), (8, 16)])
def test_tiny_pictures_are_read(size):
    pixels = np.ones((*size, 3))
    pixels[0, 0] = 100.0
    spots, wide = bright_spots(pixels, "EQUIRECTANGULAR", SOFT)
    assert len(spots) + wide <= 1
