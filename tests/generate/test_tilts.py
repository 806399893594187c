"""Tilts follow their distributions: the shares of slopes below a bound are those that the formulas say."""

from math import erf
from types import SimpleNamespace

import numpy as np
import pytest

from glint_addon.generate.microstructure import STEEPEST
from glint_addon.generate.tilts import TAIL_LENGTH, random_slopes

COUNT = 200_000
# Kolmogorov and Smirnov: a right sample exceeds 1.95 / sqrt(n) once in a thousand seeds.
LARGEST_DISTANCE = 1.95 / np.sqrt(COUNT)


def slopes(**more):
    settings = {"distribution": "BECKMANN", "roughness": 0.5, "cone": 0.3, "tail": 0.0, **more}
    return random_slopes(SimpleNamespace(**settings), COUNT, np.random.default_rng(8))


def distance(values, below) -> float:
    """Largest difference between the share of values up to a bound and `below(bound)`."""
    ordered = np.sort(values.astype(float))
    share = np.arange(1, len(ordered) + 1) / len(ordered)
    return float(np.abs(share - below(ordered)).max())


@pytest.mark.parametrize("roughness", [0.1, 0.5, 0.8])
@pytest.mark.parametrize("axis", [0, 1])
def test_beckmann_slopes_are_normal_along_each_axis(roughness, axis):
    alpha = roughness**2
    found = slopes(roughness=roughness)[:, axis]
    assert distance(found, lambda p: 0.5 * (1 + np.vectorize(erf)(p / alpha))) < LARGEST_DISTANCE


@pytest.mark.parametrize("roughness", [0.1, 0.4])
@pytest.mark.parametrize("axis", [0, 1])
def test_ggx_slopes_have_its_marginal_distribution(roughness, axis):
    # The integral of alpha^2 / (pi (alpha^2 + p^2 + q^2)^2) over q is alpha^2 / (2 (alpha^2 + p^2)^1.5).
    alpha = roughness**2
    found = slopes(distribution="GGX", roughness=roughness)[:, axis]
    assert distance(found, lambda p: 0.5 * (1 + p / np.hypot(alpha, p))) < LARGEST_DISTANCE


def test_a_wide_ggx_ends_at_the_steepest_slope_and_keeps_its_shape():
    radius = np.linalg.norm(slopes(distribution="GGX", roughness=1.0), axis=-1)
    whole = STEEPEST**2 / (1 + STEEPEST**2)
    assert 0.9 * STEEPEST < radius.max() <= STEEPEST * (1 + 1e-5)
    assert distance(radius, lambda p: p**2 / (1 + p**2) / whole) < LARGEST_DISTANCE


def test_directions_within_the_cone_are_equally_frequent():
    radius = np.linalg.norm(slopes(distribution="CONE"), axis=-1)
    assert distance(np.arctan(radius), lambda t: (1 - np.cos(t)) / (1 - np.cos(0.3))) < LARGEST_DISTANCE


def test_the_tail_goes_on_beyond_the_cone_by_half_its_angle():
    angle = np.arctan(np.linalg.norm(slopes(distribution="CONE", tail=0.25), axis=-1))
    beyond = angle[angle > 0.3]
    assert len(beyond) / COUNT == pytest.approx(0.25, abs=5 * np.sqrt(0.25 * 0.75 / COUNT))
    assert (beyond - 0.3).mean() == pytest.approx(TAIL_LENGTH * 0.3, rel=0.02)  # the end at 85 degrees takes 0.3 %


@pytest.mark.parametrize("distribution", ["BECKMANN", "GGX", "CONE"])
def test_facets_without_spread_lie_flat(distribution):
    assert (slopes(distribution=distribution, roughness=0.0, cone=0.0) == 0).all()


def test_tilts_have_no_direction():
    found = slopes(distribution="GGX")
    turn = np.arctan2(found[:, 1], found[:, 0]) / (2 * np.pi) % 1
    assert distance(turn, lambda t: t) < LARGEST_DISTANCE
