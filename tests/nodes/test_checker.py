"""Glint Checker against numpy: pixel by pixel where it is plain, against brute force where it is filtered."""

import math

import numpy as np
import pytest

from glint_addon.nodes import checker
from tests.helpers import cycles
from tests.helpers.osl_functions import evaluate
from tests.helpers.stress_marks import thinned
from tests.reference import checker as reference

SIZE = 48
COLOR_1 = (0.9, 0.4, 0.1)
COLOR_2 = (0.05, 0.2, 0.6)
ROUNDING = 1e-5  # of hit points and sines in float32, scaled coordinates below 100
EDGE = 1e-3  # radians; hit points in float32 and the pixel filter's 0.01 pixels reach no further
POINTS_ERROR = 0.08  # 64 points of a Gaussian cut by edges: a few points of 64 at worst
SERIES_ERROR = 0.03  # harmonics left out, and brute force's own 1e-3


def checker_scene(*, size=(SIZE, SIZE), scale=5.0, filtered=False, osl=True, colors=(COLOR_1, COLOR_2)):
    """(scene, material, group node) of a material that shows the checker unlit."""
    scene = cycles.empty_scene(size=size, osl=osl)
    material, shown = cycles.emission_material()
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = checker.build()
    for name, color in zip(("Color 1", "Color 2"), colors, strict=True):
        node.inputs[name].default_value = (*color, 1)
    node.inputs["Scale"].default_value = scale
    node.inputs["Filter"].default_value = filtered
    material.node_tree.links.new(node.outputs["Color"], shown)
    return scene, material, node


def tilted_plane_points(width, tilt, height):
    """World positions (SIZE, SIZE, 3) that an orthographic camera above sees of a plane turned by `tilt` about x."""
    across = ((np.arange(SIZE) + 0.5) / SIZE - 0.5) * width
    x, y = np.meshgrid(across, across)
    return np.stack([x, y, height + y * math.tan(tilt)], axis=-1)


@pytest.mark.parametrize("osl", [True, False], ids=["osl", "svm"])
@pytest.mark.parametrize("scale", [1.0, 5.0, -3.3])
def test_every_pixel_away_from_edges_is_that_of_numpy(osl, scale):
    scene, material, _ = checker_scene(scale=scale, osl=osl)
    cycles.box_filter(scene, 0.01)
    plane = cycles.add_plane(scene, 30, material=material)
    plane.rotation_euler.x, plane.location.z = 0.6, 0.37
    cycles.add_camera(scene, (0, 0, 20), width=6.0)
    picture = cycles.rendered(scene)[..., :3]

    points = scale * tilted_plane_points(6.0, 0.6, 0.37)
    first = reference.checker_is_first(points)
    # A hit may lie 0.01 pixels beside the centre.
    clear = reference.edge_distance(points) > EDGE + 0.01 * abs(scale) * 6.0 / SIZE * 1.5
    assert clear.mean() > 0.97 and 0.2 < first[clear].mean() < 0.8
    expected = np.where(first[..., None], COLOR_1, COLOR_2)
    np.testing.assert_allclose(picture[clear], expected[clear], atol=ROUNDING)


def test_the_hit_point_is_in_world_space_whatever_the_object_does():
    scene, material, _ = checker_scene()
    cycles.box_filter(scene, 0.01)
    plane = cycles.add_plane(scene, 3, material=material)
    plane.location.z = 0.2
    cycles.add_camera(scene, (0, 0, 5), width=2.0)
    straight = cycles.rendered(scene)
    plane.rotation_euler.z, plane.scale = 0.5, (1.7, 1.2, 3.0)
    turned = cycles.rendered(scene)
    assert straight.std() > 0.1
    assert (np.abs(straight - turned).max(axis=2) > ROUNDING).mean() < 0.01


def test_where_the_product_is_zero_color_2_shows():
    scene, material, node = checker_scene()
    cycles.add_plane(scene, 3, material=material)
    cycles.add_camera(scene, (0, 0, 5), width=2.0)
    for filtered in (False, True):
        node.inputs["Filter"].default_value = filtered
        np.testing.assert_allclose(cycles.rendered(scene)[..., :3] - COLOR_2, 0, atol=ROUNDING)


def footprints(random, count):
    """Rows (point, long axis, short axis) of all sizes, a third of them on axis-aligned or diagonal planes."""
    points = random.uniform(-20, 20, (count, 3))
    axes = random.normal(size=(2, count, 3))
    axes[1] = np.cross(axes[0], axes[1])
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    short = 10 ** random.uniform(-2, 1.3, (count, 1))
    long = short * 10 ** random.uniform(0, 1.5, (count, 1))
    axes *= np.stack([long, short])
    flat, diagonal = slice(0, count // 6), slice(count // 6, count // 3)
    axes[:, flat, 2] = 0
    # On the plane x = y + const two waves are in step, and the mean of the product is not the product of the means.
    axes[0, diagonal] = long[diagonal] * np.array([1, 1, 0]) / math.sqrt(2)
    axes[1, diagonal] = short[diagonal] * np.array([0, 0, 1])
    points[diagonal, 1] = points[diagonal, 0] + random.uniform(-0.5, 0.5, count // 3 - count // 6)
    return np.concatenate([points, *axes], axis=1).astype(np.float32)


def test_the_filter_is_the_mean_over_the_footprint():
    """Slow: the twin in numpy samples each of 300 footprints by the thousand."""
    random = np.random.default_rng(1)
    rows = footprints(random, 300)
    body = """
      out[0] = checker_share(point(in[0], in[1], in[2]), vector(in[3], in[4], in[5]), vector(in[6], in[7], in[8]));
    """
    share = evaluate(("checker.h",), body, rows, 1)[:, 0]
    expected = np.array([reference.checker_share(row[:3], row[3:6], row[6:], random) for row in rows.astype(float)])
    by_series = np.hypot(rows[:, 3:6], rows[:, 6:]).max(axis=1) >= 1.25
    assert 0.3 < by_series.mean() < 0.9 and (expected[by_series] - 0.5).std() > 0.02
    np.testing.assert_allclose(share[by_series], expected[by_series], atol=SERIES_ERROR)
    np.testing.assert_allclose(share[~by_series], expected[~by_series], atol=POINTS_ERROR)


PLANES = {
    "floor": ((0, 0, 0), (0, 0, 0.3)),
    "slope in general position": ((0.1, 0.05, 0.3), (0, 0, -3)),
    "diagonal plane, two waves in step": ((math.pi / 4, 0, 0), (0, 0, -10)),
}


@pytest.mark.parametrize("plane", thinned(PLANES, ("slope in general position",), "2,048 samples of the truth"))
def test_far_away_it_fades_to_what_supersampling_finds(plane):
    scene, material, node = checker_scene(size=(48, 36), scale=3.0, colors=((1, 1, 1), (0, 0, 0)))
    thing = cycles.add_plane(scene, 200, material=material)
    thing.rotation_euler, thing.location = PLANES[plane]
    cycles.add_camera(scene, (0, -20, 4), (0, 0, 1), angle=0.9)

    def picture(filtered, spp, seed):
        node.inputs["Filter"].default_value = filtered
        scene.cycles.samples, scene.cycles.seed = spp, seed
        return cycles.rendered(scene)[..., 0]

    truth = picture(False, 2048, 9)
    for spp, gain in ((1, 5.0), (4, 2.0), (16, 1.5)):  # measured: 10, 2.3 to 3.2 and 2.0 to 3.2
        errors = {filtered: picture(filtered, spp, 3) - truth for filtered in (False, True)}
        rmse = {filtered: math.sqrt((error**2).mean()) for filtered, error in errors.items()}
        assert rmse[True] < rmse[False] / gain, (spp, rmse)
        assert abs(errors[True].mean()) < 0.006, "the mean drifts"  # measured: 0.003


def test_without_osl_the_filter_is_left_out():
    scene, material, node = checker_scene(osl=False)
    cycles.add_plane(scene, 30, material=material).location.z = 0.3
    cycles.add_camera(scene, (0, -5, 2), angle=0.9)
    plain = cycles.rendered(scene)
    node.inputs["Filter"].default_value = True
    np.testing.assert_array_equal(cycles.rendered(scene), plain)
