"""The lobe against the truth: pictures that Blender's own nodes converge to, stored with their own noise."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import error, suite, truth
from demo_scenes import measure
from tests.helpers.stress_marks import stress

pytestmark = stress("the lobe against stored truths", fast=[
    "osl/test_lobe.py::test_every_setting_has_the_right_mean",
    "benchmarks/test_suite.py::test_every_truth_is_quiet_and_of_the_scene_as_it_is",
])

# One light each: Cycles samples one light per sample, and that choice is noise which no material can take away.
SCENES = ("flakes_middle", "eight_bit", "scratches_middle")
SPP = (4, 16)
NODES_SPP = 256
BIAS = 0.01  # the truths' own mean is known to about 0.1 %


def luminance(scene, spp, seed):
    """Linear luminance of a render, float64 (height, width)."""
    scene.cycles.samples, scene.cycles.seed = spp, seed
    return measure.luminance(measure.rendered(scene))


@pytest.fixture(scope="module", params=SCENES)
def errors(request):
    """({spp: error of the lobe}, error of Blender's nodes) of one scene."""
    stored = truth.stored(request.param)

    def of(picture):
        return error.picture_error(picture[np.newaxis], stored.mean, stored.variance)

    nodes = of(luminance(suite.nodes_scene(request.param), NODES_SPP, seed=5))
    scene = suite.lobe_scene(request.param)
    return {spp: of(luminance(scene, spp, seed=7)) for spp in SPP}, nodes


def test_four_samples_of_the_lobe_beat_hundreds_of_blenders_nodes(errors):
    lobe, nodes = errors
    assert lobe[4].rmse <= nodes.rmse


def test_energy_is_right_within_a_percent(errors):
    lobe, _ = errors
    assert abs(lobe[16].bias) <= BIAS


def test_error_keeps_falling_with_samples(errors):
    lobe, _ = errors
    assert lobe[4].rmse > lobe[16].rmse
