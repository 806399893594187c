"""Grains and sequins: their facets, sizes, gaps and domes."""

import numpy as np
import pytest

from glint_addon.generate import slopes_of
from glint_addon.generate.grains import Grains
from glint_addon.generate.sequins import Sequins


def test_a_grain_has_as_many_facets_as_wanted():
    found = Grains(extent=0.01, size=0.001, size_spread=0.1, facets=3).microstructure(512)
    facets = [len(np.unique(found.normals[found.id == number], axis=0)) for number in np.unique(found.id)]
    assert max(facets) == 3 and np.mean(facets) > 2.8


def test_facets_without_a_dome_lean_as_their_distribution_says():
    found = Grains(extent=0.05, size=0.0005, facets=4, roughness=0.5, dome=0.0).microstructure(1024)
    # Beckmann of alpha 0.25, over 46,000 facets of unequal size.
    assert slopes_of(found.normals).std() == pytest.approx(0.25 / np.sqrt(2), rel=0.03)


@pytest.mark.parametrize("resolution", [256, 512])
def test_grains_have_their_size_in_metres(resolution):
    found = Grains(extent=0.01, size=0.0005, size_spread=0.1).microstructure(resolution)
    count = len(np.unique(found.id))
    assert np.sqrt(0.01**2 / count / (np.sqrt(3) / 2)) == pytest.approx(0.0005, rel=0.03)  # whole rows and columns


def test_a_worn_grain_is_a_smooth_dome():
    found = Grains(extent=0.01, size=0.001, size_spread=0.0, worn=1.0, dome=0.5, roughness=0.8).microstructure(512)
    slopes = slopes_of(found.normals)
    # From 0 in the middle to 0.5 at half of the width, outwards.
    step = 0.01 / 512 / 0.0005 * 0.5
    assert np.median(slopes[:, 1:, 0] - slopes[:, :-1, 0]) == pytest.approx(step, rel=0.01)
    assert np.abs(slopes[..., 0]).max() == pytest.approx(0.5, rel=0.05)


def test_facets_follow_their_dome():
    flat, round_ = (Grains(dome=dome, roughness=0.0, facets=6).microstructure(256) for dome in (0.0, 1.0))
    assert (flat.normals == (0, 0, 1)).all()
    assert 0.1 < slopes_of(round_.normals).std() < 0.6


def test_sequins_that_do_not_touch_cover_the_area_of_their_discs():
    found = Sequins(extent=0.1, size=0.004, spacing=0.005, hole=0.25, disorder=0.0).microstructure(1024)
    discs = len(np.unique(found.id[found.presence]))
    assert discs == 20 * 24  # 20 columns, and the even number of rows nearest to 20 / 0.866
    area = discs * np.pi * (0.002**2 - 0.0005**2)
    assert found.presence.mean() == pytest.approx(area / 0.1**2, rel=0.005)  # texels at edges


def test_sequins_that_overlap_leave_only_holes():
    found = Sequins(size=0.0062, spacing=0.005, hole=0.0, disorder=0.0).microstructure(256)
    assert found.presence.all()
    assert not Sequins(size=0.0062, spacing=0.005, hole=0.3, disorder=0.0).microstructure(256).presence.all()


def test_each_sequin_is_flat_and_has_a_tilt_of_its_own():
    found = Sequins().microstructure(256)
    for number in np.unique(found.id[found.presence])[:50]:
        assert len(np.unique(found.normals[found.id == number], axis=0)) == 1
    assert len(np.unique(found.normals[found.presence], axis=0)) > 300
