"""The lobe against the truth: pictures that Blender's own nodes converge to, stored with their own noise."""

from __future__ import annotations

import pytest

from .helpers import truth

BIAS = 0.01  # the issue's bound on energy; the truths' own mean is known to about 0.1 %


@pytest.fixture(scope="module", params=truth.SCENES)
def pictures(request):
    """(name, {spp: lobe picture}, picture of Blender's nodes at 1024 spp)."""
    name = request.param
    nodes = truth.luminance(truth.with_nodes(name), 1024, seed=5)
    scene = truth.with_lobe(name)
    return name, {spp: truth.luminance(scene, spp, seed=7) for spp in (4, 16, 64)}, nodes


def test_four_samples_of_the_lobe_beat_a_thousand_of_blenders_nodes(pictures):
    name, lobe, nodes = pictures
    mean, variance = truth.stored(name)
    assert truth.relative_rmse(lobe[4], mean, variance) <= truth.relative_rmse(nodes, mean, variance)


def test_energy_is_right_within_a_percent(pictures):
    name, lobe, _ = pictures
    mean, _ = truth.stored(name)
    assert abs(truth.energy_bias(lobe[16], mean)) <= BIAS


def test_error_keeps_falling_with_samples(pictures):
    name, lobe, _ = pictures
    mean, variance = truth.stored(name)
    errors = [truth.relative_rmse(lobe[spp], mean, variance) for spp in (4, 16, 64)]
    assert errors[0] > errors[1] > errors[2]
