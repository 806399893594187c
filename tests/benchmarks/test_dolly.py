"""The dolly: steps that hold whole repeats of the map, a stored truth that the map itself confirms, and its table."""

import math

import numpy as np
import pytest

from benchmarks import dolly, dolly_scene, dolly_truth, query_scene
from benchmarks.dolly_scene import STEPS, VARIANTS, Step
from benchmarks.dolly_truth import Mean, Receding
from tests.helpers.stress_marks import stress

LARGEST_FILE = 50_000  # bytes: a clone must stay small
LARGEST_NOISE = 0.002  # of the stored means, relative: a fifth of what is asked of the lobe
LARGEST_Z = 4.0
LARGEST_ERROR = 0.03  # of the lobe's mean: that the dolly measures it at all; how exact it is, the benchmark says
# Of a sum over the map's texels and a few points of the sun: the difference of two point sets is 0.3 %.
QUADRATURE = 0.005
SUN_RINGS, SUN_SECTORS = 3, 8
MACHINE = {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "2000"}


def test_steps_go_from_one_texel_to_a_million_evenly():
    texels = [step.texels for step in STEPS]
    ratio = dolly_scene.LARGEST_TEXELS ** (1 / (len(STEPS) - 1))
    assert len(STEPS) == 24 and min(step.side for step in STEPS) >= dolly_scene.LEAST_SIDE
    assert texels[0] == 1.0 and texels[-1] == pytest.approx(1e6, rel=0.05)
    assert np.diff(np.log(texels)) / math.log(ratio) == pytest.approx(np.ones(len(STEPS) - 1), abs=0.2)
    assert max(step.repeats for step in STEPS) + 2 < dolly_scene.PLANE, "the plane must reach beyond the picture"


def test_near_steps_take_fewer_samples_a_pixel_than_far_ones():
    spp = [dolly.samples(step, "sharp") for step in STEPS]
    assert spp == sorted(spp) and 1 < spp[0] < spp[-1] == dolly.SPP
    assert dolly.samples(Step(10**4, 1), "soft") == 1


def sun_directions(direction, half_angle):
    """Directions (n, 3) spread evenly over a disc of the sky."""
    across = np.cross(direction, (0.0, 1.0, 0.0))
    axes = np.stack([across, np.cross(direction, across)]) / np.linalg.norm(across)
    sector = (np.arange(SUN_SECTORS) + 0.5) / SUN_SECTORS * 2.0 * np.pi
    points = [np.sqrt((ring + 0.5) / SUN_RINGS) * math.tan(half_angle) * np.array((np.cos(angle), np.sin(angle)))
              for ring in range(SUN_RINGS) for angle in sector]
    directions = direction + points @ axes
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def mean_over_map(normals, variant) -> float:
    """Mean radiance of facets of these unit normals (n, 3), seen from (0, 0, 1), under the dolly's sun.

    D / (4 n.v) for each direction of the sun, see query_truth.py.
    """
    total = 0.0
    sun = sun_directions(query_scene.light_direction(query_scene.HALF_VECTORS[0]), variant.sun_angle / 2)
    for light in sun:
        h = light + (0.0, 0.0, 1.0)
        cosine2 = (normals @ (h / np.linalg.norm(h))) ** 2
        ndf = np.exp((1.0 - 1.0 / cosine2) / variant.alpha**2) / (np.pi * variant.alpha**2 * cosine2**2)
        total += np.mean(ndf / (4.0 * normals[:, 2]))
    return total / len(sun)


@pytest.fixture(scope="module")
def flakes():
    """Unit normals of all flakes, (n, 3)."""
    return 2.0 * query_scene.query_map("flakes").encoded.reshape(-1, 3).astype(np.float64) - 1.0


@pytest.mark.parametrize("key", VARIANTS)
def test_the_stored_mean_is_that_of_the_maps_own_normals(flakes, key):
    truth = dolly_truth.stored_mean("flakes", key)
    assert 0.0 < truth.deviation / truth.value < LARGEST_NOISE
    wanted = mean_over_map(flakes, VARIANTS[key])
    assert abs(truth.value - wanted) < QUADRATURE * wanted + LARGEST_Z * truth.deviation


def test_the_stored_truth_is_small_and_its_bands_are_those_of_its_picture():
    assert dolly_truth.FILE.stat().st_size < LARGEST_FILE
    for name in query_scene.MAPS:
        truth = dolly_truth.stored_receding(name)
        assert truth.picture.shape == dolly_scene.SIZE[::-1]
        means = [band.mean() for band in np.array_split(truth.picture, dolly_truth.BANDS)]
        np.testing.assert_allclose(truth.bands.value, means, rtol=1e-3)  # pixels are stored rounded
        assert (truth.bands.deviation / truth.bands.value).max() < dolly.GOAL


def test_texels_of_the_receding_rows_are_those_between_the_rows_on_the_ground():
    rows = dolly_scene.row_elevations()
    assert np.rad2deg(rows[[-1, 0]]) == pytest.approx(np.rad2deg(dolly_scene.ELEVATIONS), abs=0.15)
    height = dolly_scene.TEXELS_A_METRE * np.gradient(1.0 / np.tan(rows))
    middle = sum(dolly_scene.ELEVATIONS) / 2
    depth = np.cos(rows - middle) / np.sin(rows)  # along the camera's axis
    half = math.tan((dolly_scene.ELEVATIONS[1] - dolly_scene.ELEVATIONS[0]) / 2)
    width = dolly_scene.TEXELS_A_METRE * depth * 2.0 * half / dolly_scene.SIZE[1]
    np.testing.assert_allclose(dolly_scene.row_texels()[1:-1], (height * width)[1:-1], rtol=0.02)


@stress("means of a percent", fast=["osl/test_lobe.py::test_every_geometry_has_the_right_mean"])
def test_the_lobe_is_as_bright_as_the_nodes_near_and_far():
    found = dolly.curve("flakes", "soft", (Step(64, 1), Step(24, 4)))
    assert abs(found["summary"]["error"]) < LARGEST_ERROR
    assert [row["texels"] for row in found["rows"]] == pytest.approx([256.0, (1024 / 6) ** 2])
    assert 0 < max(row["deviation"] for row in found["rows"]) < dolly.GOAL


def test_the_mean_of_pictures_has_the_noise_of_pixels_from_seed_to_seed():
    rng = np.random.default_rng(3)
    pattern = rng.uniform(1.0, 3.0, (40, 50))
    found = dolly_truth.picture_mean(pattern + rng.normal(0.0, 0.2, (4, 40, 50)))
    assert found.deviation == pytest.approx(0.2 / math.sqrt(4 * 2000), rel=0.1)
    assert abs(found.value - pattern.mean()) < LARGEST_Z * found.deviation


def rows(*errors):
    return [{"texels": 4.0**index, "error": error, "deviation": 0.001} for index, error in enumerate(errors)]


def test_the_summary_has_the_largest_error_and_the_largest_step():
    found = dolly.summary(rows(0.002, -0.009, 0.0), 0.0)
    assert (found["error"], found["step"]) == pytest.approx((-0.009, -0.011))
    assert found["step_deviation"] == pytest.approx(0.001 * math.sqrt(2.0))
    assert found["within"] and found["steady"]


@pytest.mark.parametrize(("errors", "within", "steady"), [
    ((0.008, -0.008), True, False), ((0.016, 0.016), False, True), ((-0.016, 0.0), False, False),
])
def test_errors_and_steps_beyond_the_goal_and_their_noise_are_told(errors, within, steady):
    found = dolly.summary(rows(*errors), 0.0)
    assert (found["within"], found["steady"]) == (within, steady)


def test_a_band_that_is_too_bright_is_told():
    picture = np.tile(np.linspace(1.0, 2.0, dolly_scene.SIZE[1])[:, None], (1, dolly_scene.SIZE[0]))
    bands = dolly_truth.band_means(np.stack([picture, picture]))
    shown = np.stack([picture, picture])
    shown[:, :8] *= 1.05
    found = dolly.receding(shown, Receding(picture, Mean(bands.value, 0.01 * bands.value), 64))
    assert [row["error"] for row in found] == pytest.approx([0.05] + [0.0] * 19, abs=1e-9)
    assert [row["deviation"] for row in found] == pytest.approx([0.01] * 20)


def test_the_table_says_what_was_measured():
    curve = {"map": "flakes", "variant": "sharp", "alpha": 0.01, "sun_degrees": 0.5, "truth_noise": 0.0015,
             "rows": rows(0.002, -0.021), "summary": dolly.summary(rows(0.002, -0.021), 0.0)}
    results = {"machine": MACHINE, "spp": 16, "curves": [curve], "receding": {"flakes": rows(0.004)}}
    text = dolly.table(results)
    assert "| flakes | 0.01 | 0.5° | -2.10% ± 0.10% | -2.30% ± 0.14% | 0.15% | **no** | **no** |" in text
    assert "| 4 | -2.10% ± 0.10% |" in text and "| 1 | +0.40% ± 0.10% |" in text and "Abacus" in text
