"""The query table's truth, its errors and its cost; the numpy experiments behind the shader's constants."""

import re

import numpy as np
import pytest

from benchmarks import footprint_law, query, query_scene, query_truth
from demo_scenes import measure
from glint_addon import paths
from tests.helpers.stress_marks import stress
from tests.reference import footprint as footprint_twin

HALF_WIDTH = 6  # texels: all elements are visited, and a render takes milliseconds
LARGEST_ERROR = 0.15  # relative RMSE of the query alone at this width, about twice what is measured
RESULTS = {
    "machine": {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "2000"},
    "alpha": 0.01, "slope": 0.15, "bump_width": 8.0, "texels": 1024, "footprints": 576, "half_vectors": [[0, 0]],
    "truth_samples": 10**8,
    "maps": {"flakes": {
        "interpolation": "CLOSEST", "plain_microseconds": 0.5, "bytes_a_texel": 16.0, "bake_seconds": 0.25,
        "rows": [{"half_width": 6, "microseconds": 5.125, "visited": 113.0, "rmse": 0.031, "sample_rmse": 0.052,
                  "contrast": 1.5, "noise": 0.01}],
    }},
}


def flat_map(interpolation):
    """A map of normals (0, 0, 1)."""
    encoded = np.broadcast_to(np.float32([0.5, 0.5, 1.0]), (8, 8, 3))
    return query_scene.QueryMap(encoded, interpolation)


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
def test_binning_a_flat_map_gives_one_lobe(interpolation):
    truth = query_truth.binned(flat_map(interpolation), 3, samples=5000)
    for found, (x, y) in zip(truth.mean, query_scene.HALF_VECTORS, strict=True):
        square = x * x + y * y  # tangent squared of the half vector's angle
        ndf = np.exp(-square / query_scene.ALPHA**2) * (1 + square) ** 2 / (np.pi * query_scene.ALPHA**2)
        np.testing.assert_allclose(found, ndf / 4)
    assert truth.variance == pytest.approx(0.0, abs=1e-18)


def test_the_points_of_the_footprint_have_the_kernels_moments():
    points = query_truth.kernel_points(200, np.random.default_rng(1))
    assert (np.hypot(*points.T) <= 1.0).all()
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(np.cov(points.T), footprint_twin.KERNEL_VARIANCE * np.eye(2), atol=1e-3)


def test_interpolated_normals_are_the_texels_at_their_centres_and_wrap():
    rng = np.random.default_rng(2)
    normals = rng.normal(size=(8, 8, 3)) * 0.2 + (0, 0, 1)
    unit = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    centres = np.array([(0.5, 0.5), (7.5, 3.5), (8.5, -0.5)])  # (column, row)
    wanted = unit[[0, 3, 7], [0, 7, 0]]
    for interpolation in ("LINEAR", "CLOSEST"):
        np.testing.assert_allclose(query_truth.shown_normals(normals, centres, interpolation), wanted)
    middle = query_truth.shown_normals(normals, np.array([(8.0, 1.5)]), "LINEAR")[0]
    np.testing.assert_allclose(middle, (mean := normals[1, 7] + normals[1, 0]) / np.linalg.norm(mean))


def test_the_systematic_error_is_what_is_left_of_the_mean_of_all_draws():
    """An answer 5 % off at each footprint, noise of 20 % a group and a truth of 3 %."""
    rng = np.random.default_rng(4)
    right = rng.uniform(1.0, 3.0, (2, 576))
    scale = right.mean()
    for off in (0.05, 0.0):
        answer = right + off * scale * rng.choice([-1.0, 1.0], right.shape)
        means = answer + 0.2 * scale * rng.standard_normal((query.GROUPS, *right.shape))
        truth = query_truth.NdfTruth(right + 0.03 * scale * rng.standard_normal(right.shape), (0.03 * scale) ** 2, 1)
        found, deviation = query.systematic_error(means, truth)
        assert query.relative_rmse(means[0], truth) > 0.15
        square_deviation = deviation * max(2.0 * found, deviation)
        assert abs(found**2 - off**2) < 4.0 * square_deviation
        assert 0.0 < square_deviation < 0.001


TRUTH = stress("a million binned samples a footprint", fast=[
    "benchmarks/test_query_table.py::test_binning_a_flat_map_gives_one_lobe",
    "benchmarks/test_query_table.py::test_without_hints_the_wall_is_one_closure_of_the_pixels_own_normal",
])


@pytest.fixture(scope="module", params=query_scene.MAPS)
def measured(request):
    """(stored truth, a fresh truth of few samples, elements visited, error) of one map."""
    kind = query_scene.query_map(request.param)
    truth = query_truth.stored(request.param, HALF_WIDTH)
    fresh = query_truth.binned(kind, HALF_WIDTH, samples=10**6)
    return truth, fresh, query.visited(kind, HALF_WIDTH), query.ndf_error(kind, HALF_WIDTH, truth)


@TRUTH
def test_the_stored_truth_is_what_binning_gives_today(measured):
    truth, fresh, _, _ = measured
    square = np.mean((truth.mean - fresh.mean) ** 2)
    assert square == pytest.approx(truth.variance + fresh.variance, rel=0.5)
    assert 0 < truth.noise < 0.05
    assert truth.samples == query_truth.SAMPLES


@TRUTH
def test_each_pixel_of_the_query_scene_visits_a_footprint_of_the_half_width(measured):
    assert measured[2] == pytest.approx(np.pi * HALF_WIDTH**2, rel=0.02)


@TRUTH
def test_the_query_alone_agrees_with_binning_and_the_remainder_only_adds_noise(measured):
    error = measured[3]
    assert 0 < error["rmse"] < LARGEST_ERROR
    assert abs(error["bias"]) < 0.03
    assert error["rmse"] < error["sample_rmse"]


def test_groups_of_draws_have_random_numbers_of_their_own(monkeypatch):
    """At a far footprint, whose blocks are drawn: differences of groups know nothing of those of other groups."""
    monkeypatch.setattr(query, "DRAWS", 4 * query.GROUPS)
    scene, _ = query_scene.query_scene(query_scene.query_map("flakes"), 96, query_scene.HALF_VECTORS[0])
    first, second, third, fourth = query.independent_means(scene)
    assert (first - second).std() > 0.01 * first.mean()
    # A correlation of n pairs that are independent has a deviation of 1 / sqrt(n), here of 1 / SIDE.
    assert abs(np.corrcoef(first - second, third - fourth)[0, 1]) < 4.0 / query_scene.SIDE


def test_without_hints_the_wall_is_one_closure_of_the_pixels_own_normal():
    """Its brightness is known: the unit of the query scene's radiance is that of the binned truth."""
    kind = query_scene.query_map("flakes")
    scene, _ = query_scene.query_scene(kind, 0.25, query_scene.HALF_VECTORS[0])
    query_scene.drop_hints(scene)
    shown = measure.luminance(measure.rendered(scene)).ravel()
    normals = 2.0 * kind.encoded.astype(np.float64) - 1.0
    size = query_scene.TEXELS
    wanted = [query_truth.brightness(query_truth.shown_normals(normals, place[None] * size, "CLOSEST"))[0]
              for place in query_scene.places()]
    np.testing.assert_allclose(shown, wanted, rtol=0.01, atol=1e-4)


def test_the_table_of_a_query_says_what_was_measured():
    text = query.table(RESULTS)
    assert "| flakes | 6 | 5.12 | 113 | 3.1% | - | 5.2% | 150.0% | 1.0% |" in text
    assert "| flakes | Closest | 0.50 | 16.0 | 0.25 |" in text
    assert "1e+08 binned samples" in text and "Abacus" in text
    row = RESULTS["maps"]["flakes"]["rows"][0] | {"systematic_rmse": 0.0246, "systematic_noise": 0.0012}
    newer = RESULTS | {"maps": {"flakes": RESULTS["maps"]["flakes"] | {"rows": [row]}}}
    assert "| 3.1% | 2.5% ± 0.1% | 5.2% |" in query.table(newer)


def test_bytes_and_seconds_of_a_bake_are_measured():
    cost = query.bake_cost(flat_map("LINEAR"))
    assert cost["bytes_a_texel"] == 16.0
    assert cost["bake_seconds"] > 0


def constants(header):
    """The #define numbers of an OSL header."""
    text = paths.shader_file(header).read_text(encoding="utf-8")
    return {name: float(value) for name, value in re.findall(r"^#define (\w+) ([\d.]+)$", text, re.MULTILINE)}


def test_the_experiments_have_the_shaders_constants():
    law = constants("footprint.h")
    assert law["FOOTPRINT_SCALE"] == footprint_law.SCALE == query_scene.FOOTPRINT_RADIUS
    assert law["FOOTPRINT_EXPONENT"] == footprint_law.EXPONENT
    grid = constants("pixel_grid.h")
    names = ("GRID_FIRST", "GRID_ROUND", "GRID_MEAN_2", "GRID_MEAN_4")
    assert [grid[name] for name in names] == [getattr(footprint_law, name) for name in names]
    assert footprint_law.grid_numbers().shape == (5, grid["GRID_COUNTS"])


@pytest.mark.parametrize("spp", [1, 16, 64])
def test_the_footprint_law_is_close_to_the_radius_of_least_error(spp):
    """Within a tenth of the least error that any radius has."""
    law = footprint_law.SCALE * spp**-footprint_law.EXPONENT
    found = footprint_law.errors(spp, (*footprint_law.RADII, law), scrambles=8)
    assert found[-1] < 1.1 * found.min()
    assert found[0] > 1.5 * found.min(), "narrow footprints leave holes"


def test_sobol_points_are_one_in_each_stratum_and_scrambling_keeps_that():
    points = footprint_law.sobol_points(16)
    rng = np.random.default_rng(3)
    for axis in (0, 1):
        numbers = footprint_law.scrambled(points[:, axis], rng)
        assert sorted(np.floor(numbers * 16)) == list(range(16))
    columns, rows = (points >> (footprint_law.BITS - 2)).T
    assert sorted(4 * columns + rows) == list(range(16))
