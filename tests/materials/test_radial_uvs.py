"""UVs around an axis: circles along u, metres, and no seam where a whole number of repeats goes around."""

import math

import bpy
import numpy as np
import pytest

import glint_addon
from tests.helpers.extension import refused

FLOAT_ERROR = 1e-5  # UVs are 32-bit floats of about 1


def disc(scene, radius=0.5, segments=64):
    """A fan around the origin, and the UVs of its corners with their angle and distance."""
    bpy.ops.mesh.primitive_circle_add(vertices=segments, radius=radius, fill_type="TRIFAN")
    return bpy.context.object.data


def corners(mesh, layer):
    uvs, places = np.empty(2 * len(mesh.loops), np.float32), np.empty(3 * len(mesh.vertices))
    layer.uv.foreach_get("vector", uvs)
    mesh.vertices.foreach_get("co", places)
    return uvs.reshape(-1, 2), places.reshape(-1, 3)[[loop.vertex_index for loop in mesh.loops]]


def test_u_runs_around_and_v_is_the_distance_from_the_axis(scene):
    mesh = disc(scene)
    layer = glint_addon.add_radial_uvs(mesh)
    uvs, places = corners(mesh, layer)
    distance = np.hypot(places[:, 0], places[:, 1])
    np.testing.assert_allclose(uvs[:, 1], distance, atol=FLOAT_ERROR)
    around = 2 * math.pi * distance.mean()
    rim = distance > 0.4
    turn = (uvs[rim, 0] / around - np.arctan2(places[rim, 1], places[rim, 0]) / (2 * math.pi)) % 1.0
    np.testing.assert_allclose(np.minimum(turn, 1 - turn), 0, atol=FLOAT_ERROR)
    assert mesh.uv_layers.active == layer and layer.active_render


def test_no_face_spans_the_circle(scene):
    mesh = disc(scene)
    uvs, _ = corners(mesh, glint_addon.add_radial_uvs(mesh))
    widths = np.ptp(uvs[:, 0].reshape(-1, 3), axis=1)
    # A 64th of the way around at the mean distance, 1/3 m.
    np.testing.assert_allclose(widths, 2 * math.pi * (2 / 3 * 0.5) / 64, rtol=1e-3)


@pytest.mark.parametrize("repeat", [0.02, 0.3, 5.0])
def test_a_whole_number_of_repeats_goes_around(scene, repeat):
    mesh = disc(scene)
    uvs, _ = corners(mesh, glint_addon.add_radial_uvs(mesh, repeat=repeat))
    repeats = np.ptp(uvs[:, 0].reshape(-1, 3), axis=1).mean() * 64 / repeat
    assert repeats == pytest.approx(round(repeats), rel=1e-4) and round(repeats) >= 1


def test_on_a_cylinder_v_is_the_height(scene):
    bpy.ops.mesh.primitive_cylinder_add(radius=0.1, depth=0.6, end_fill_type="NOTHING")
    mesh = bpy.context.object.data
    uvs, places = corners(mesh, glint_addon.add_radial_uvs(mesh, name="Turned"))
    np.testing.assert_allclose(uvs[:, 1], places[:, 2], atol=FLOAT_ERROR)
    assert mesh.uv_layers.active.name == "Turned"


def test_the_operator_serves_each_selected_mesh_once(registered, scene):
    mesh = disc(scene)
    other = bpy.data.objects.new("Other", mesh)
    scene.collection.objects.link(other)
    other.select_set(True)
    assert bpy.ops.glint.add_radial_uvs(repeat=0.1) == {"FINISHED"}
    assert [layer.name for layer in mesh.uv_layers].count("Radial") == 1
    bpy.ops.object.select_all(action="DESELECT")
    assert not bpy.ops.glint.add_radial_uvs.poll()


def test_a_mesh_full_of_uv_maps_is_refused_in_a_sentence(registered, scene):
    mesh = disc(scene)
    while mesh.uv_layers.new():
        pass
    names = [layer.name for layer in mesh.uv_layers]
    assert "Blender takes no more: remove one" in refused(bpy.ops.glint.add_radial_uvs)
    assert [layer.name for layer in mesh.uv_layers] == names
