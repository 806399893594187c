"""The temporal table: its stored truth, its errors on known sequences, and what moves in the two sequences."""

import numpy as np
import pytest

from benchmarks import temporal, temporal_scenes, temporal_truth
from benchmarks.temporal_truth import SequenceTruth
from demo_scenes import measure
from tests.helpers.stress_marks import thinned

FRESH_SPP = 256  # noise is then less than what a frame differs from the next
LARGEST_FILE = 100_000  # bytes: a clone must stay small
LARGEST_NOISE = 0.03
FRAMES = (1, 17, 32)
LARGEST_Z = 5.0
STD_NOISE = 0.2  # relative; measured within 8 %; the next frame would be off by 40 % and more
ROUNDING = 2**-8  # half a unit of the mantissa bits that are kept


def constant_truth(variance=0.0):
    """A truth of brightness 2 everywhere, 6 frames of 4 x 5 pixels."""
    return SequenceTruth(np.full((6, 4, 5), 2.0), np.full((4, 5), variance), 1, 1, "")


def test_an_offset_is_an_error_of_the_curve_and_no_flicker():
    found = temporal.errors(np.full((2, 6, 4, 5), 2.2), constant_truth())
    assert [found[key] for key in ("curve", "median_pixel", "worst_pixel")] == pytest.approx([0.1, 0.1, 0.1])
    assert found["flicker"] == pytest.approx(0.0)
    assert found["bias"] == pytest.approx(0.1)


def test_alternating_frames_flicker_by_twice_their_error():
    signs = np.array([1, -1, 1, -1, 1, -1])[:, None, None]
    found = temporal.errors(2.0 + 0.2 * signs * np.ones((1, 6, 4, 5)), constant_truth())
    assert found["curve"] == pytest.approx(0.1)
    assert found["flicker"] == pytest.approx(0.2)
    assert found["bias"] == pytest.approx(0.0)


def test_one_wrong_pixel_is_the_worst_and_not_the_median():
    sequence = np.full((1, 6, 4, 5), 2.0)
    sequence[:, :, 1, 2] = 3.0
    found = temporal.errors(sequence, constant_truth())
    assert (found["worst_pixel"], found["median_pixel"]) == (pytest.approx(0.5), 0.0)
    assert found["curve"] == pytest.approx(0.5 / np.sqrt(20))


def test_the_truths_own_noise_is_taken_out():
    """A noisy truth against a noiseless picture: no error is left, of the curve or of the differences."""
    rng = np.random.default_rng(1)
    mean = 2.0 + rng.normal(0.0, 0.1, (2000, 4, 5))
    truth = SequenceTruth(mean, np.full((4, 5), 0.01), 1, 1, "")
    found = temporal.errors(np.full((1, 2000, 4, 5), 2.0), truth)
    assert found["curve"] < 0.01
    assert found["flicker"] < 0.015
    assert truth.noise == pytest.approx(0.05, rel=0.01)
    own = temporal.change(truth)
    assert own["curve"] < 0.01
    assert own["flicker"] < 0.015


def test_a_changing_truth_has_its_change():
    wave = np.array([1, -1] * 500)[:, None, None] * np.ones((1000, 4, 5))
    own = temporal.change(SequenceTruth(2.0 + wave, np.zeros((4, 5)), 1, 1, ""))
    assert own["curve"] == pytest.approx(0.5)
    assert own["flicker"] == pytest.approx(1.0)


def test_stored_numbers_are_rounded_to_nearest():
    values = np.random.default_rng(2).uniform(0.1, 30.0, 1000)
    stored = temporal_truth.rounded(values).astype(float)
    np.testing.assert_allclose(stored, values, rtol=1.1 * ROUNDING)
    assert abs(np.mean(stored / values - 1.0)) < ROUNDING / 20


@pytest.mark.parametrize("name", thinned(temporal_scenes.NAMES, temporal_scenes.NAMES[:1], "stored truths"))
def test_the_stored_truth_is_the_mean_of_blenders_nodes_on_todays_scene(name):
    """A fresh frame differs from it as from one of another seed, and has its mean."""
    truth = temporal_truth.stored(name)
    scene = temporal_truth.nodes_scene(name)
    scene.cycles.samples = FRESH_SPP
    for frame in FRAMES:
        scene.frame_set(frame)
        shown = []
        for scene.cycles.seed in (3, 4):
            shown.append(measure.luminance(measure.rendered(scene)))
        difference = shown[0] - truth.mean[frame - 1]
        assert abs(difference.mean()) < LARGEST_Z * difference.std() / np.sqrt(difference.size)
        assert difference.std() == pytest.approx((shown[0] - shown[1]).std() / np.sqrt(2.0), rel=STD_NOISE)
    assert truth.noise < LARGEST_NOISE
    assert temporal.change(truth)["flicker"] > 3 * truth.noise, "glints must twinkle"


def test_the_stored_truths_are_small():
    assert temporal_truth.FILE.stat().st_size < LARGEST_FILE


def test_the_lobe_follows_the_truth_frame_by_frame():
    truth = temporal_truth.stored("light")
    scene = temporal.lobe_scene("light")
    scene.cycles.samples = 16
    errors = {}
    for frame in (1, 32):
        scene.frame_set(frame)
        shown = measure.luminance(measure.rendered(scene))
        for other in (1, 32):
            errors[frame, other] = measure.relative_rmse(
                np.repeat(shown[..., None], 3, -1), np.repeat(truth.mean[other - 1][..., None], 3, -1)
            )
    for frame, other in ((1, 32), (32, 1)):
        assert errors[frame, frame] < errors[frame, other] / 2


def test_the_table_says_what_was_measured():
    row = {"spp": 4, "seeds": 2, "frame_seconds": 0.0254, "curve": 0.2, "median_pixel": 0.21, "worst_pixel": 0.9,
           "flicker": 0.3, "bias": -0.001}
    results = {
        "machine": {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "1"},
        "size": [32, 32], "frames": 32,
        "sequences": {"light": {"truth": {"spp": 8, "noise": 0.01, "curve": 0.7, "flicker": 0.25},
                                "methods": {"nodes": row, "lobe": row}}},
    }
    text = temporal.table(results)
    assert "| light | lobe | 4 | 25.4 | 20.0% | 21.0% | 90.0% | 30.0% | -0.1% |" in text
    assert "| light | truth (its own noise) | 8 | | 1.0% |" in text
    assert "Abacus" in text
