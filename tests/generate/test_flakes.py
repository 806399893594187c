"""Flakes: how many, how large, which colours' numbers, and that coverage changes nothing but their number."""

import numpy as np
import pytest

from glint_addon.generate import Population, slopes_of
from glint_addon.generate.flakes import Flakes


def flakes(resolution=256, extent=0.0064, seed=1, coverage=1.0, **population):
    return Flakes(extent=extent, seed=seed, coverage=coverage,
                  populations=(Population(**{"size": 0.0001, **population}),)).microstructure(resolution)


@pytest.mark.parametrize("coverage", [0.0, 0.2, 0.7, 1.0])
def test_flakes_cover_the_part_of_the_surface_that_coverage_says(coverage):
    found = flakes(coverage=coverage).presence.mean()
    assert found == pytest.approx(coverage, abs=4 * np.sqrt(coverage * (1 - coverage) / 4700) + 1e-9)  # 4700 flakes


def test_less_coverage_takes_flakes_and_changes_none():
    full, half = flakes(), flakes(coverage=0.5)
    assert (half.normals[half.presence] == full.normals[half.presence]).all()
    assert (half.id[half.presence] == full.id[half.presence]).all()


@pytest.mark.parametrize("resolution", [256, 512])
@pytest.mark.parametrize("size", [0.0001, 0.0002])
def test_flakes_have_their_size_in_metres_at_every_resolution(resolution, size):
    # size^2 sqrt(3) / 2 is the area of a hexagon of that width.
    found = flakes(resolution, size=size, size_spread=0.0)
    count = len(np.unique(found.id))
    assert np.sqrt(0.0064**2 / count / (np.sqrt(3) / 2)) == pytest.approx(size, rel=0.02)  # whole rows and columns


def test_a_flake_is_one_flat_facet():
    found = flakes(512, extent=0.0016)  # few enough that no two have the same number
    _, first, number = np.unique(found.id, return_index=True, return_inverse=True)
    assert (found.normals.reshape(-1, 3)[first][number.reshape(512, 512)] == found.normals).all()


def test_flakes_smaller_than_a_texel_are_one_texel_each():
    found = flakes(256, size=1e-6, coverage=0.5)
    assert len(np.unique(found.id)) > 0.49 * 256**2
    slopes = slopes_of(found.normals[found.presence])
    # Beckmann of alpha 0.25: each axis has the variance alpha^2 / 2.
    assert slopes.std() == pytest.approx(0.25 / np.sqrt(2), rel=0.02)
    beside = np.corrcoef(found.normals[:, 1:, 0].ravel(), found.normals[:, :-1, 0].ravel())[0, 1]
    assert abs(beside) < 0.02


def test_a_coarse_map_shows_the_flakes_of_a_fine_one():
    fine, coarse = (flakes(resolution, extent=0.0256).id for resolution in (1024, 64))  # 4 flakes a coarse texel
    around = np.stack([fine[v::16, u::16] for v in (7, 8) for u in (7, 8)])
    assert (around == coarse).any(axis=0).mean() > 0.98  # an edge may run between the middles


def test_random_numbers_of_flakes_are_uniform():
    numbers = np.unique(flakes(512).id)
    shares = np.histogram(numbers, bins=10, range=(0, 1))[0] / len(numbers)
    np.testing.assert_allclose(shares, 0.1, atol=0.025)  # 5 deviations of 4700 flakes


def test_populations_cover_their_shares_with_their_own_numbers_and_tilts():
    small = Population(share=0.25, size=0.0001, roughness=0.2, id_low=0.0, id_high=0.4)
    large = Population(share=0.75, size=0.0003, roughness=0.7, id_low=0.6, id_high=1.0)
    found = Flakes(extent=0.0128, coverage=0.8, populations=(small, large)).microstructure(512)
    is_small, is_large = found.presence & (found.id <= 0.4), found.presence & (found.id >= 0.6)
    assert (is_small | is_large).sum() == found.presence.sum()
    assert found.presence.mean() == pytest.approx(0.8, abs=0.03)  # 2100 large flakes
    assert is_small.mean() == pytest.approx(0.2, abs=0.015)
    for part, population in ((is_small, small), (is_large, large)):
        deviation = slopes_of(found.normals[part]).std()
        assert deviation == pytest.approx(population.roughness**2 / np.sqrt(2), rel=0.06)


def test_populations_without_shares_leave_a_bare_surface():
    found = Flakes(populations=(Population(share=0.0),)).microstructure(64)
    assert not found.presence.any() and (found.normals == (0, 0, 1)).all()
