"""Exact truths: the sum over texels is what Blender's nodes converge to, in stored truths and in quick renders."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import exact, exact_lobe, suite, truth
from benchmarks.error import truth_bias_noise
from demo_scenes import maps, measure, stage
from demo_scenes.truth import truth_material

LARGEST_Z = 4.0  # standard deviations that a mean of noise may be off
SIZE = (12, 12)  # pixels of the quick renders
SEEDS, SPP = 6, 512  # of many samples, because Cycles puts the first of each pixel in its middle


def test_the_filters_density_is_the_window_that_cycles_samples():
    density = exact_lobe.filter_density()
    place = (np.arange(len(density)) + 0.5) / exact_lobe.STEPS - 1.5
    assert density.mean() * 3 == pytest.approx(1.0, abs=1e-3)
    phase = 2 * np.pi * (place / 3 + 0.5)
    window = 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    # One sample in 1023 strays, and the table's steps are as wide as the rim's weight.
    assert np.abs(density - window / window.mean() / 3).max() < 0.01


@pytest.mark.parametrize("rings", [1, 2, 3])
def test_points_of_a_disc_integrate_polynomials(rings):
    x, y, weight = exact_lobe.disc_points(rings).T
    assert (weight * (x * x + y * y)).sum() == pytest.approx(0.5)
    assert (weight * x**3 * y**2).sum() == pytest.approx(0.0, abs=1e-12)
    if rings > 1:
        assert (weight * x**4).sum() == pytest.approx(1 / 8)


@pytest.mark.parametrize("distribution", ["BECKMANN", "GGX"])
def test_a_lobe_reflects_at_most_all_light_and_nearly_all_if_sharp(distribution):
    rng = np.random.default_rng(1)
    light = rng.normal(size=(1_000_000, 3))
    light /= np.linalg.norm(light, axis=1, keepdims=True)
    view = np.array([[0.6, 0.0, 0.8]])
    value = exact_lobe.lobe(distribution, 0.1, np.array([[0.0, 0.0, 1.0]]), view, light)
    reflected = value.mean() * 4 * np.pi
    assert 0.95 < reflected < 1.0 + LARGEST_Z * value.std() * 4 * np.pi / np.sqrt(len(value))


def test_valid_normals_mirror_the_view_above_the_surface():
    rng = np.random.default_rng(2)
    up = np.array([0.0, 0.0, 1.0])
    view = rng.normal(size=(1000, 3))
    view[:, 2] = np.abs(view[:, 2])
    normals = rng.normal(size=(1000, 3)) * 0.4 + up
    normals[:, 2] = np.abs(normals[:, 2])
    view, normals = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (view, normals))
    found = exact_lobe.valid_normals(normals, up, view)
    mirrored = 2 * exact_lobe.dot(found, view) * found[:, 2] - view[:, 2]
    threshold = np.minimum(0.9 * view[:, 2], 0.01)
    moved = (found != normals).any(axis=1)
    assert 0 < moved.sum() < len(moved)
    assert (mirrored >= threshold - 1e-9).all()
    assert mirrored[moved] == pytest.approx(threshold[moved])


def test_the_sum_is_the_stored_truth_but_for_its_noise():
    name = "flakes_middle"
    stored, found = truth.stored(name), truth.summed(name)
    bias = found.mean() / stored.mean.mean() - 1.0
    assert abs(bias) < LARGEST_Z * truth_bias_noise(stored.mean, stored.variance)
    left = (found - stored.mean) ** 2 - stored.variance
    assert abs(left.mean()) < LARGEST_Z * left.std() / np.sqrt(left.size)


def plane(scene, material):
    """Seen at a grazing angle, where masking counts and normals are raised; texels of many pixels and of few."""
    stage.add_sheet(scene, "Sheet", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], material, repeats=0.6)
    stage.add_camera(scene, (0, -3, 0.8), (0, 0, 0), angle=0.5)


def ball(scene, material):
    """With UVs that shrink to the poles, and tangents that differ from corner to corner."""
    stage.add_sphere(scene, material, centre=(0, 0, 0), radius=1.0, repeats=(3.0, 1.5))
    stage.add_camera(scene, (0, -6, 3), (0, 0, 0.1), angle=0.4)


def sheet_from_above(scene, material):
    stage.add_sheet(scene, "Sheet", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], material, repeats=1.3)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), width=1.5)


def sun(scene):
    stage.add_sun(scene, (0.3, 1.0, 0.5), strength=2.0, angle=0.15, color=(1.0, 0.8, 0.3))


def lamp(scene):
    stage.add_lamp(scene, "POINT", (0.5, -2.0, 2.5), power=80.0, shadow_soft_size=0.3)


def both(scene):
    sun(scene)
    lamp(scene)


@pytest.mark.parametrize(
    ("build", "light", "distribution"),
    [(plane, sun, "BECKMANN"), (plane, lamp, "GGX"), (ball, lamp, "BECKMANN"), (ball, both, "GGX"),
     (sheet_from_above, both, "BECKMANN")],
    ids=lambda value: getattr(value, "__name__", value),
)
def test_the_sum_is_what_rendered_nodes_scatter_around(build, light, distribution):
    normal_map = maps.flakes(32, std=0.3, seed=5)
    scene = stage.empty_scene(SIZE, SPP)
    surface = {"roughness": 0.4, "interpolation": "CLOSEST", "distribution": distribution}
    build(scene, truth_material("Nodes", maps.blender_image("Normal map", normal_map), **surface))
    light(scene)
    scene.cycles.max_bounces = 0
    found = exact.exact_picture(scene, exact.closest_facets(normal_map, **surface))

    pictures = []
    for seed in range(1, SEEDS + 1):
        scene.cycles.seed = seed
        pictures.append(measure.luminance(measure.rendered(scene)))
    means = np.mean(pictures, axis=(1, 2))
    assert abs(means.mean() - found.mean()) < LARGEST_Z * means.std(ddof=1) / np.sqrt(SEEDS)
    # Pixel by pixel too: their mean differs from the sum by no more than its own noise.
    noise = np.mean(np.var(pictures, axis=0, ddof=1)) / SEEDS
    assert np.mean((np.mean(pictures, axis=0) - found) ** 2) < 1.5 * noise


# Refusals


def add_room_light(scene):
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)


def add_point(scene):
    stage.add_lamp(scene, "POINT", (0, 0, 3), power=1.0, shadow_soft_size=0.0)


def add_second_sheet(scene):
    stage.add_sheet(scene, "Other", [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], None)


def open_lens(scene):
    scene.camera.data.dof.use_dof = True


def scale(scene):
    scene.objects["Sheet"].scale = (2, 1, 1)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [(add_room_light, "black world"), (add_point, "neither a sun nor a soft point lamp"),
     (add_second_sheet, "one mesh"), (open_lens, "pinhole or orthographic"), (scale, "apply its scale")],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_scene_that_cannot_be_summed_is_refused(spoil, words):
    scene = stage.empty_scene(SIZE, 1)
    sheet_from_above(scene, stage.glossy_material("Facets"))
    spoil(scene)
    normal_map = np.full((4, 4, 3), 0.5, np.float32)
    with pytest.raises(ValueError, match=words):
        exact.exact_picture(scene, exact.closest_facets(normal_map, roughness=0.1, interpolation="CLOSEST"))


def test_a_map_read_between_texels_is_refused():
    with pytest.raises(ValueError, match="Closest texel"):
        exact.closest_facets(np.zeros((4, 4, 3)), roughness=0.1, interpolation="LINEAR")


def test_exact_truths_of_the_suite_have_no_noise_and_say_so():
    for name in filter(truth.is_exact, suite.NAMES):
        stored = truth.stored(name)
        assert (stored.spp, stored.seeds, stored.noise) == (0, 0, 0.0)
        assert stored.mean.min() >= 0.0 and stored.mean.mean() > 0.0
