"""The demo's normal maps: what their docstrings promise, measured."""

import numpy as np
import pytest

from demo_scenes import maps

MAPS = {
    "flakes": lambda **options: maps.flakes(256, std=0.2, **options),
    "Voronoi flakes": lambda **options: maps.flakes(256, std=0.2, cell=8, **options),
    "bumps": lambda **options: maps.bumps(256, std=0.2, **options),
    "brushed": lambda **options: maps.brushed(256, std=0.2, **options),
    "scratches": lambda **options: maps.scratches(256, count=40, length=100.0, std=0.2, **options),
}
HEIGHT_FIELDS = ("bumps", "brushed", "scratches")
# Encoded values are float32, slopes are ratios of them.
FLOAT_ERROR = 1e-5


@pytest.mark.parametrize("name", MAPS)
def test_a_map_holds_encoded_unit_normals_that_face_up(name):
    encoded = MAPS[name]()
    normals = encoded.astype(np.float64) * 2 - 1
    assert encoded.shape == (256, 256, 3) and encoded.dtype == np.float32
    assert np.allclose(np.linalg.norm(normals, axis=-1), 1, atol=FLOAT_ERROR)
    assert normals[..., 2].min() > 0


@pytest.mark.parametrize("name", MAPS)
def test_a_seed_gives_the_same_map_again_and_another_seed_another(name):
    assert np.array_equal(MAPS[name](seed=7), MAPS[name](seed=7))
    assert not np.array_equal(MAPS[name](seed=7), MAPS[name](seed=8))


@pytest.mark.parametrize("name", HEIGHT_FIELDS)
def test_the_slopes_are_those_of_a_height_that_repeats_without_a_seam(name):
    """The slopes are derivatives of one periodic height: their curl is zero and each row's mean along u too.

    Derivatives are spectral for the Fourier maps and central differences for the scratches, which commute exactly.
    """
    slopes = maps.decoded_slopes(MAPS[name]())
    if name == "scratches":

        def derivative(values, axis):
            return (np.roll(values, -1, axis) - np.roll(values, 1, axis)) / 2
    else:

        def derivative(values, axis):
            k = 2 * np.pi * np.fft.fftfreq(values.shape[axis])
            k[len(k) // 2] = 0  # the sign of the highest frequency is not defined
            k = k[:, None] if axis == 0 else k[None, :]
            return np.fft.ifft2(1j * k * np.fft.fft2(values)).real

    cross_u, cross_v = derivative(slopes[..., 0], 0), derivative(slopes[..., 1], 1)
    curl = derivative(slopes[..., 0], 0) - derivative(slopes[..., 1], 1)
    assert max(cross_u.std(), cross_v.std()) > 100 * FLOAT_ERROR
    # The axes of bumps are scaled apart, by 1 / sqrt(2 n) of their number: (256 / 8)^2.
    allowed = 5 * max(cross_u.std(), cross_v.std()) / np.sqrt(2 * 32**2) if name == "bumps" else 10 * FLOAT_ERROR
    assert curl.std() < allowed
    assert np.abs(slopes[..., 0].mean(axis=1)).max() < FLOAT_ERROR
    assert np.abs(slopes[..., 1].mean(axis=0)).max() < FLOAT_ERROR


@pytest.mark.parametrize("cell", [1, 4])
def test_flakes_have_the_asked_slope_distribution(cell):
    """Independent normal slopes: their std within 5 standard errors (1 / sqrt(2 n)), their kurtosis 3."""
    slopes = maps.decoded_slopes(maps.flakes(512, std=0.25, cell=cell, seed=2))
    count = (512 // cell) ** 2
    # A flake's area varies, so the effective count is about half of the number of flakes.
    margin = 5 / np.sqrt(count)
    assert np.abs(slopes.std(axis=(0, 1)) / 0.25 - 1).max() < margin
    assert np.abs((slopes**4).mean(axis=(0, 1)) / 0.25**4 / 3 - 1).max() < 10 * margin
    assert abs(np.corrcoef(slopes[..., 0].ravel(), slopes[..., 1].ravel())[0, 1]) < margin


def test_a_voronoi_flake_is_flat_and_as_wide_as_asked():
    slopes = maps.decoded_slopes(maps.flakes(256, std=0.2, cell=8, seed=3))
    count = len(np.unique(np.round(slopes.reshape(-1, 2), 4), axis=0))
    assert 0.97 * (256 // 8) ** 2 <= count <= (256 // 8) ** 2


def test_flakes_that_do_not_fit_the_map_are_refused():
    with pytest.raises(ValueError, match="choose a divisor"):
        maps.flakes(256, cell=7)


def test_bumps_have_the_asked_slope_and_correlation_length():
    """A height of autocorrelation exp(-d^2 / (2 w^2)) has slopes of autocorrelation (1 - d^2 / w^2) times that."""
    width = 6.0
    slopes = maps.decoded_slopes(maps.bumps(512, std=0.15, width=width, seed=4))[..., 0]
    # (512 / 6)^2 independent bumps: the std of one axis is known to 1 / sqrt(2 n).
    assert slopes.std() == pytest.approx(0.15, rel=5 * width / 512)
    for shift in (2, 4, 6, 9):
        measured = (slopes * np.roll(slopes, shift, axis=1)).mean() / 0.15**2
        expected = (1 - shift**2 / width**2) * np.exp(-(shift**2) / (2 * width**2))
        # (512 / 6)^2 independent bumps: five standard errors.
        assert measured == pytest.approx(expected, abs=5 / (512 / width))


def test_brushed_streaks_run_along_u():
    slopes = maps.decoded_slopes(maps.brushed(256, std=0.2, width=2.0, length=20.0, seed=5))
    along, across = slopes.std(axis=(0, 1))
    assert across == pytest.approx(0.2, rel=1e-4)
    # 1600 independent streaks: five standard errors of 1 / sqrt(2 n).
    assert along == pytest.approx(0.02, rel=0.09)
    v = slopes[..., 1]
    assert (v * np.roll(v, 5, axis=1)).mean() > 0.9 * v.var() > 2 * (v * np.roll(v, 5, axis=0)).mean()


def test_a_scratch_has_the_asked_slope_across_and_none_along():
    """One groove along u of depth between half and one and a half of the mean, flat everywhere else."""
    slopes = maps.decoded_slopes(maps.scratches(256, count=1, width=16.0, length=120.0, std=0.2, spread=0.0, seed=6))
    inside = slopes[np.abs(slopes[..., 1]).max(axis=1) > 1e-4]
    middle = inside[:, np.abs(inside[..., 0]).max(axis=0) < 1e-6]
    groove = middle[:, np.abs(middle[..., 1]).max(axis=0) > 1e-4]
    assert 14 <= len(inside) <= 18
    assert 0.5 * 0.2 * 0.9 < np.sqrt((groove[..., 1] ** 2).mean()) < 1.5 * 0.2 * 1.1
    assert np.abs(slopes).max(axis=-1).astype(bool).mean() < 0.25


def test_slopes_survive_encoding():
    slopes = np.random.default_rng(1).normal(0, 0.5, (16, 8, 2))
    assert np.allclose(maps.decoded_slopes(maps.encoded_normals(slopes)), slopes, atol=FLOAT_ERROR)


def test_a_blender_image_holds_the_pixels_as_data(scene):
    pixels = MAPS["flakes"]()
    image = maps.blender_image("Map", pixels)
    stored = np.empty(256 * 256 * 4, np.float32)
    image.pixels.foreach_get(stored)
    assert image.colorspace_settings.is_data and image.is_float
    assert np.array_equal(stored.reshape(256, 256, 4)[..., :3], pixels)
