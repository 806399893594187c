"""How many metres one unit of UV covers on an object, and how much that varies: meshes whose answer is known."""

import math

import bpy
import numpy as np
import pytest

from glint_addon.seen import uv_size as uv_size_module
from glint_addon.seen.uv_size import mean_scale, measured, size_of_triangles, uv_size
from tests.helpers import cycles

UNIT = np.float64([[0, 0], [1, 0], [0, 1]])  # UVs of a triangle that is half the map


@pytest.fixture
def scene():
    return cycles.empty_scene()


def size_of(thing, uv_map=""):
    bpy.context.view_layer.update()
    return measured(thing, bpy.context.evaluated_depsgraph_get(), uv_map)[0]


def triangles(*widths):
    """Right triangles with legs of these widths [m], each of which covers half the UV map."""
    return np.stack([np.column_stack([width * UNIT, np.zeros(3)]) for width in widths]), np.stack([UNIT] * len(widths))


def test_a_plane_of_two_metres_that_covers_the_map_once_has_two_metres_a_unit(scene):
    size = size_of(cycles.add_plane(scene, 2.0))
    assert size.metres == pytest.approx(2.0) and size.variation == pytest.approx(1.0)
    assert size_of(cycles.add_plane(scene, 2.0, repeats=8.0)).metres == pytest.approx(0.25)


def test_scale_negative_scale_parents_and_shear_count_by_the_area_in_the_scene(scene):
    plane = cycles.add_plane(scene, 1.0)
    plane.scale = (-2.0, 8.0, 1.0)
    assert size_of(plane).metres == pytest.approx(4.0)
    parent = bpy.data.objects.new("Parent", None)
    parent.scale = (0.5, 0.5, 0.5)
    parent.rotation_euler = (0.3, 0.2, 0.1)
    scene.collection.objects.link(parent)
    plane.parent = parent
    assert size_of(plane).metres == pytest.approx(2.0)
    shear = np.float64([[1, 3, 0], [0, 1, 0], [0, 0, 1]])  # keeps areas in the plane
    assert uv_size(plane.data, shear, "").metres == pytest.approx(1.0)


def test_modifiers_count(scene):
    plane = cycles.add_plane(scene, 1.0)
    plane.modifiers.new("Array", "ARRAY").count = 3  # no other size
    assert size_of(plane).metres == pytest.approx(1.0)
    modifier = plane.modifiers.new("Repeat", "UV_WARP")
    modifier.scale = (4.0, 4.0)
    assert size_of(plane).metres == pytest.approx(0.25)


def test_each_uv_map_has_its_own_size_and_the_active_one_is_that_of_renders(scene):
    plane = cycles.add_plane(scene, 1.0)
    other = plane.data.uv_layers.new(name="Other")
    other.uv.foreach_set("vector", np.float32([0, 0, 2, 0, 2, 2, 0, 2]))
    assert size_of(plane).metres == pytest.approx(1.0) and size_of(plane, "Other").metres == pytest.approx(0.5)
    other.active_render = True
    assert size_of(plane).metres == pytest.approx(0.5) and size_of(plane, "None of that name") is None


def test_a_sphere_has_the_mean_over_its_surface_and_varies_by_less_than_two(scene):
    """Metres a unit are sqrt(2 pi^2 sin(polar angle)) at a radius of 1 m: by area the mean of sqrt(sin) is 0.874, and
    between tenths of the area, at heights of 0 and 0.9 on either side, it varies by (1 / 0.436)^(1/2)."""
    size = size_of(cycles.add_sphere(scene, segments=128, rings=64))
    heights = (np.arange(100_000) + 0.5) / 100_000
    mean = np.sqrt(np.sqrt(1.0 - heights**2)).mean()
    assert size.metres == pytest.approx(math.sqrt(2.0) * math.pi * mean, rel=0.005)  # facets, and the clipped poles
    assert size.variation == pytest.approx((1.0 / math.sin(math.acos(0.9))) ** 0.5, rel=0.05)


def test_curves_and_text_are_measured_and_lamps_have_nothing(scene):
    data = bpy.data.curves.new("Curve", "CURVE")
    data.dimensions, data.extrude = "3D", 0.5
    spline = data.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (3.0, 0.0, 0.0, 1.0)
    curve = bpy.data.objects.new("Curve", data)
    scene.collection.objects.link(curve)
    assert size_of(curve).metres == pytest.approx(math.sqrt(3.0))  # one unit of UV over three metres by one
    assert size_of(cycles.add_sun(scene, (0, 0, 1))) is None


def test_a_cube_with_one_larger_island_varies_as_its_faces_do():
    size = size_of_triangles(*triangles(1.0, 1.0, 1.0, 1.0, 1.0, 3.0))
    assert size.variation == pytest.approx(3.0)
    assert size.metres == pytest.approx((5 * 1.0 + 9 * 3.0) / 14)  # by area


def test_a_sliver_of_a_hundredth_of_the_surface_changes_nothing():
    places, uvs = triangles(*[1.0] * 200)
    uvs[0] *= 1e-9
    uvs[1] *= 1e9
    size = size_of_triangles(places, uvs)
    assert size.metres == pytest.approx(1.0) and size.variation == pytest.approx(1.0)


def test_faces_without_area_in_uv_are_left_out_of_the_mean_and_named_where_they_are_a_tenth():
    places, uvs = triangles(2.0, 2.0, 2.0, 2.0, 2.0)
    uvs[0] = 0.5
    size = size_of_triangles(places, uvs)
    assert size.metres == pytest.approx(2.0) and math.isinf(size.variation)
    few = size_of_triangles(np.concatenate([places] * 4), np.concatenate([uvs, *[uvs[1:2]] * 15]))
    assert few.metres == pytest.approx(2.0) and few.variation == pytest.approx(1.0)


def test_faces_without_area_and_numbers_that_are_none_are_left_out():
    places, uvs = triangles(2.0, 0.0, 2.0, 2.0)
    places[2, 0, 0], uvs[3, 0, 0] = np.nan, np.inf
    size = size_of_triangles(places, uvs)
    assert size.metres == pytest.approx(2.0) and size.variation == pytest.approx(1.0)
    assert size_of_triangles(places[1:], uvs[1:]) is None
    assert size_of_triangles(places[:0], uvs[:0]) is None


def test_an_object_without_faces_or_uvs_has_no_size(scene):
    assert size_of(cycles.add_mesh(scene, [(0, 0, 0), (1, 0, 0)], [])) is None
    assert size_of(cycles.add_mesh(scene, [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])) is None


def test_the_mean_scale_of_an_even_scale_is_that_scale_and_a_flat_one_is_above_zero():
    assert mean_scale(-3.0 * np.eye(3)) == pytest.approx(3.0)
    assert mean_scale(np.diag([2.0, 0.0, 0.0])) == pytest.approx(2.0 / math.sqrt(3.0))


def test_triangles_at_random_stand_for_a_large_mesh_and_are_the_same_each_time(scene, monkeypatch):
    sphere = cycles.add_sphere(scene, segments=128, rings=64)
    exact = size_of(sphere)
    monkeypatch.setattr(uv_size_module, "JUDGED_TRIANGLES", 4000)
    sampled = size_of(sphere)
    assert sampled == size_of(sphere) != exact
    assert sampled.metres == pytest.approx(exact.metres, rel=0.02)  # 1 / sqrt(4000), at most
    assert sampled.variation == pytest.approx(exact.variation, rel=0.05)
