"""Bumps, brushed metal, dents and scratches: slopes, wavelengths, widths and directions in real units."""

import numpy as np
import pytest

from glint_addon.generate import slopes_of
from glint_addon.generate.brushed import Brushed
from glint_addon.generate.bumps import Bumps
from glint_addon.generate.dents import Dents
from glint_addon.generate.fields import random_slopes
from glint_addon.generate.grooves import Grooves, carved, coordinates, position
from glint_addon.generate.scratches import Scratches


def slopes(generator, resolution=512):
    return slopes_of(generator.microstructure(resolution).normals).astype(float)


@pytest.mark.parametrize("resolution", [256, 512])
@pytest.mark.parametrize("slope", [0.02, 0.3])
def test_bumps_have_the_slope_that_was_asked_for_exactly(resolution, slope):
    found = slopes(Bumps(extent=0.01, slope=slope), resolution)
    assert np.sqrt((found**2).sum(axis=-1).mean()) == pytest.approx(slope, rel=1e-4)  # float32


@pytest.mark.parametrize("wavelength", [0.0005, 0.001])
def test_bumps_repeat_at_their_wavelength(wavelength):
    found = slopes(Bumps(extent=0.02, wavelength=wavelength))
    power = (np.abs(np.fft.fft2(found[..., 0] + 1j * found[..., 1])) ** 2).ravel()
    frequency = np.fft.fftfreq(512, 0.02 / 512)
    radius = np.hypot(frequency[None, :], frequency[:, None]).ravel()
    assert (power * radius).sum() / power.sum() == pytest.approx(1 / wavelength, rel=0.06)  # 1 + BAND^2, and chance


def test_finer_bumps_add_their_slope():
    found = slopes(Bumps(extent=0.01, slope=0.03, fine_slope=0.04))
    assert np.sqrt((found**2).sum(axis=-1).mean()) == pytest.approx(0.05, rel=1e-3)


def test_slopes_are_minus_the_derivatives_of_one_height():
    # Then the mixed derivatives agree: spectra of p and q are i j and i k times the same.
    found, _ = random_slopes(lambda j, k: np.exp(-(j**2 + k**2) / 50), (16, 16), 64, np.random.default_rng(1))
    p, q = (np.fft.fft2(found[..., axis]) for axis in (0, 1))
    frequency = np.fft.fftfreq(64, 1 / 64)
    np.testing.assert_allclose(p * frequency[:, None], q * frequency[None, :], atol=2e-4 * np.abs(p).max() * 8)


def test_waves_are_where_they_are_at_every_resolution():
    coarse, fine = (random_slopes(lambda j, k: np.exp(-(j**2 + k**2) / 50), (16, 16), resolution,
                                  np.random.default_rng(1))[0] for resolution in (64, 192))
    # The middle one of three fine texels has the centre of a coarse one.
    np.testing.assert_allclose(fine[1::3, 1::3], coarse, atol=1e-5 * np.abs(coarse).max())


def test_the_streaks_of_brushed_metal_have_length_width_and_strength():
    generator = Brushed(extent=0.01, length=0.0008, width=0.0001, slope=0.15)
    found = slopes(generator)
    assert np.sqrt((found[..., 1] ** 2).mean()) == pytest.approx(0.15, rel=1e-4)
    # Both are derivatives of one height: along the streaks less by the ratio of the lengths.
    assert found[..., 0].std() / found[..., 1].std() == pytest.approx(0.125, rel=0.1)
    for axis, size in ((0, 0.0008), (1, 0.0001)):
        # Moved by l, along u, what varies across has the correlation exp(-1/2); across, (1 - 1) exp(-1/2) = 0.
        moved = np.roll(found[..., 1], round(size / 0.01 * 512), axis=1 - axis)
        correlation = np.corrcoef(moved.ravel(), found[..., 1].ravel())[0, 1]
        assert correlation == pytest.approx((np.exp(-0.5), 0.0)[axis], abs=0.06)


def test_dents_are_paraboloids_of_their_depth():
    generator = Dents(extent=0.1, size=0.01, size_spread=0.0, depth=0.0003)
    found = slopes(generator)
    # The curvature is 8 d / w^2 everywhere but at ridges.
    step = 0.1 / 512
    curvature = -(found[:, 1:, 0] - found[:, :-1, 0]) / step
    assert np.median(curvature) == pytest.approx(8 * 0.0003 / 0.01**2, rel=1e-3)
    assert np.abs(found[..., 0]).max() == pytest.approx(4 * 0.0003 / 0.01, rel=0.05)  # at half of the width


def groove(**more) -> Grooves:
    values = {"x": 0.1, "y": 0.1, "angle": 0.0, "across": 0.0, "along": 0.0, "length": 0.7, "width": 0.1,
              "depth": 0.01, **more}
    return Grooves(**{name: np.array([float(value)]) for name, value in values.items()})


def test_a_groove_has_a_cosine_profile():
    found, owner = carved(groove(), 1.0, 256)
    v = (np.arange(256) + 0.5) / 256 - 0.1
    inside = np.abs(v) < 0.05
    expected = np.where(inside, -np.pi * 0.1 * np.sin(2 * np.pi * v / 0.1), 0)
    column = int(0.45 * 256)
    np.testing.assert_allclose(found[:, column, 1], expected, atol=1e-6)
    assert (found[:, column, 0] == 0).all() and (owner[:, column] == np.where(inside, 0, -1)).all()
    # At its ends it rises by its depth over one width.
    assert found[int(0.1 * 256), int(0.15 * 256), 0] == pytest.approx(0.01 / 0.1, rel=0.02)
    assert found[int(0.1 * 256), int(0.75 * 256), 0] == pytest.approx(-0.01 / 0.1, rel=0.02)
    assert (owner[:, int(0.82 * 256)] == -1).all()


def test_every_texel_with_its_centre_in_a_turned_groove_is_carved():
    for angle in (0.3, 1.0, 2.5):
        one = groove(x=0.5, y=0.5, angle=angle, along=-0.2, length=0.4, width=0.02)
        _, owner = carved(one, 1.0, 256)
        centre = (np.arange(256) + 0.5) / 256
        along, across, _ = coordinates(one, centre[None, :], centre[:, None])
        inside = (np.abs(across) < 0.0099) & (along > 0.001) & (along < 0.399)  # the profile is 0 at the very edge
        assert inside.sum() > 400 and (owner[inside] == 0).all()


@pytest.mark.parametrize("radius", [None, 0.3, -0.3])
def test_moving_a_groove_by_texels_over_the_seam_moves_the_map(radius):
    more = {} if radius is None else {"radius": radius}
    first, _ = carved(groove(angle=0.5, **more), 1.0, 128)
    moved, _ = carved(groove(angle=0.5, x=0.1 + 96 / 128, y=0.1 + 80 / 128, **more), 1.0, 128)
    np.testing.assert_allclose(np.roll(first, (80, 96), axis=(0, 1)), moved, atol=1e-6)


@pytest.mark.parametrize("radius", [0.5, -0.5])
def test_places_on_an_arc_are_found_again(radius):
    arc = groove(angle=0.7, along=0.3, across=0.02, radius=radius, length=2.0)
    s, t = np.linspace(0, 2.0, 30)[None, :], np.linspace(-0.05, 0.05, 5)[:, None]
    x, y = position(arc, s, t)
    along, across, direction = coordinates(arc, x, y)
    np.testing.assert_allclose(along, np.broadcast_to(s, along.shape), atol=1e-9)
    np.testing.assert_allclose(across, np.broadcast_to(t, across.shape), atol=1e-9)
    ahead = position(arc, s + 1e-6, t)
    np.testing.assert_allclose(np.cos(np.arctan2(ahead[1] - y, ahead[0] - x) - direction), 1, atol=1e-6)


def test_the_deeper_of_two_grooves_is_seen():
    both = Grooves(*(None if first is None else np.concatenate([first, second])
                     for first, second in zip(groove(depth=0.01), groove(depth=0.02), strict=True)))
    found, owner = carved(both, 1.0, 128)
    assert set(np.unique(owner)) == {-1, 1}
    assert (found == carved(groove(depth=0.02), 1.0, 128)[0]).all()


def test_scratches_are_as_many_and_as_long_as_wanted():
    generator = Scratches(extent=0.02, density=20.0, length=0.002, width=0.0001, variation=0.0)
    found = generator.microstructure(1024)
    assert len(np.unique(found.id[found.presence])) == 80  # 20 a square centimetre on four of them
    assert found.presence.mean() == pytest.approx(80 * 0.002 * 0.0001 / 0.02**2, rel=0.1)  # less where they cross


@pytest.mark.parametrize("shape", ["STRAIGHT", "SWIRLS"])
def test_a_larger_density_adds_scratches_and_moves_none(shape):
    few, many = (Scratches(shape=shape, density=density, bundle=2).microstructure(256) for density in (40.0, 80.0))
    numbers = set(np.unique(few.id[few.presence]))
    assert len(numbers) == 160 and numbers < set(np.unique(many.id))
    assert many.presence[few.presence].all() and many.presence.mean() > 1.5 * few.presence.mean()


@pytest.mark.parametrize(("directions", "axes"), [(1, (1,)), (2, (0, 1))])
def test_scratches_lie_across_their_slopes(directions, axes):
    found = slopes(Scratches(directions=directions, direction_spread=0.0, density=100.0))
    strong = [np.abs(found[..., axis]).mean() for axis in (0, 1)]
    assert strong[1] > 0.01
    assert (strong[0] > 0.5 * strong[1]) == (axes == (0, 1)) and strong[0] < 1.5 * strong[1]


def test_thin_scratches_are_two_texels_wide_and_as_steep():
    thin = Scratches(width=1e-6, depth=1e-7, variation=0.0, direction_spread=0.0, density=30.0).microstructure(128)
    assert np.abs(slopes_of(thin.normals)[..., 1]).max() == pytest.approx(np.pi * 0.1, rel=0.05)
    assert thin.presence.mean() > 0.05


def test_no_scratches_are_a_bare_surface():
    found = Scratches(density=0.0).microstructure(64)
    assert not found.presence.any() and (found.normals == (0, 0, 1)).all()
