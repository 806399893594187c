"""Lights that are not looked for because a sample sees one texel, or because all that is seen of a light is large."""

import math

import bpy
import numpy as np
import pytest

from demo_scenes import stage
from glint_addon import create_glint_material, prepare_scene
from glint_addon.choice.close_views import CLOSE_UP, FEWEST_TEXELS
from glint_addon.lights.softness import SOFT_HALF_ANGLE, TOO_SOFT
from glint_addon.seen.cameras import all_camera_views
from glint_addon.seen.surface import is_closed, pixels_filled, surface_patches
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

MAP_SIDE = 64  # texels
SIDE = 2.0  # metres of the plane, the map once on it
# Texels a pixel for a footprint of FEWEST_TEXELS at four samples: its radius is 1.1 / 4^0.21 pixels.
LIMIT = FEWEST_TEXELS / (math.pi * (1.1 / 4**0.21) ** 2)


@pytest.fixture
def flake_map(scene, tmp_path):
    return write_flake_map(tmp_path / "flakes.png", MAP_SIDE)


def glinting_plane(scene, flake_map, **settings):
    plane = cycles.add_plane(scene, SIDE, material=create_glint_material("Sparkle", flake_map, **settings))
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    return plane


def view_width(scene, texels) -> float:
    """Width of an orthographic view [m] for so many texels a pixel."""
    return scene.render.resolution_x * math.sqrt(texels) * SIDE / MAP_SIDE


@pytest.mark.parametrize(("share", "is_close"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("tilt", [0.0, math.radians(60.0)])
def test_flakes_that_fill_a_sample_each_are_rendered_without_osl(scene, flake_map, share, is_close, tilt):
    glinting_plane(scene, flake_map, interpolation="CLOSEST")
    place = 3 * math.sin(tilt), 0, 3 * math.cos(tilt)
    cycles.add_camera(scene, place, width=view_width(scene, share * LIMIT * math.cos(tilt)))
    scene.cycles.shading_system = False
    report = prepare_scene(scene)
    assert report["hints"] == ([] if is_close else ["Sun"]) and report["osl"] != is_close
    assert report["left_by_material"] == {"Sparkle": [["Sun", CLOSE_UP]] * is_close}


def test_the_same_from_a_perspective_camera_at_any_frame(scene, flake_map):
    glinting_plane(scene, flake_map, interpolation="CLOSEST")
    width = view_width(scene, LIMIT)
    camera = cycles.add_camera(scene, (0, 0, 0.9), angle=2 * math.atan(width / 2))
    assert prepare_scene(scene)["hints"] == []
    for frame, height in ((1, 0.9), (10, 1.1)):
        camera.location.z = height
        camera.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    assert prepare_scene(scene)["hints"] == ["Sun"]


@pytest.mark.parametrize("change", ["linear", "mirror", "copies", "far object", "unseen"])
def test_in_doubt_lights_are_looked_for(scene, flake_map, change):
    plane = glinting_plane(scene, flake_map, interpolation="LINEAR" if change == "linear" else "CLOSEST")
    cycles.add_camera(scene, (0, 0, 3), width=view_width(scene, 0.5 * LIMIT))
    assert prepare_scene(scene)["hints"] == (["Sun"] if change == "linear" else [])
    if change == "mirror":
        mirror = cycles.add_plane(scene, material=bpy.data.materials.new("Mirror"))
        mirror.location.z = -1.0
        tree = mirror.data.materials[0].node_tree
        tree.nodes.clear()
        tree.nodes.new("ShaderNodeBsdfAnisotropic").inputs["Roughness"].default_value = 0.0
    elif change == "copies":
        plane.modifiers.new("Copies", "PARTICLE_SYSTEM")
    elif change == "far object":
        far = cycles.add_plane(scene, SIDE, material=plane.active_material, repeats=4.0)
        far.location.z = 0.1
    elif change == "unseen":
        plane.location.x = 50.0
    assert prepare_scene(scene, bake_unseen=True)["hints"] == ["Sun"]


# --- lights that look large ---


def lit_ball(scene, flake_map, distance, size):
    """A ball of a metre in front of the camera, and a lamp between them that far from the ball's front."""
    ball = cycles.add_sphere(scene, material=create_glint_material("Sparkle", flake_map, interpolation="CLOSEST"))
    cycles.add_camera(scene, (0, 0, 8), angle=0.3)
    lamp = stage.add_lamp(scene, "AREA", (0, 0, 1 + distance), (0, 0, 0), power=10.0, size=size)
    lamp.data.shape = "DISK"
    return ball, lamp


def test_a_lamp_that_every_visible_part_of_a_ball_sees_large_is_not_looked_for(scene, flake_map):
    """Whatever its back would see of it through the ball: the box around the ball is too long for the simple rule."""
    ball, lamp = lit_ball(scene, flake_map, 0.3, 0.9)
    assert math.atan(0.45 / 2.3) < SOFT_HALF_ANGLE
    assert prepare_scene(scene)["left_by_material"] == {"Sparkle": [["Area", TOO_SOFT]]}
    lamp.data.size = 0.1
    assert prepare_scene(scene)["hints"] == ["Area"]
    lamp.data.size = 0.9
    # Of an open ball the inside may be seen.
    open_ball(ball)
    assert prepare_scene(scene)["hints"] == ["Area"]


def test_a_large_lamp_that_comes_from_afar_is_looked_for(scene, flake_map):
    _, lamp = lit_ball(scene, flake_map, 0.3, 0.9)
    for frame, height in ((1, 1.3), (10, 6.0)):
        lamp.location.z = height
        lamp.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    assert prepare_scene(scene)["hints"] == ["Area"]


def open_ball(ball):
    """Take one face away."""
    import bmesh

    mesh = bmesh.new()
    mesh.from_mesh(ball.data)
    mesh.faces.ensure_lookup_table()
    bmesh.ops.delete(mesh, geom=[mesh.faces[0]], context="FACES")
    mesh.to_mesh(ball.data)
    mesh.free()


def test_a_mesh_is_closed_when_it_has_an_inside_and_faces_away_from_it(scene):
    ball, plane = cycles.add_sphere(scene, segments=8, rings=4), cycles.add_plane(scene)
    assert is_closed(ball.data) and not is_closed(plane.data)
    ball.data.flip_normals()
    assert not is_closed(ball.data)
    ball.data.flip_normals()
    open_ball(ball)
    assert not is_closed(ball.data)
    assert not is_closed(bpy.data.meshes.new("Empty"))


@pytest.mark.parametrize("where", ["a corner", "the object"])
def test_of_a_mesh_with_places_that_are_not_numbers_nothing_is_in_the_picture_there(scene, where):
    """And no warning is given: pytest makes an error of it."""
    cycles.add_camera(scene, (0, 0, 6), width=3.0)
    plane = cycles.add_plane(scene)
    matrix = np.eye(4)
    if where == "a corner":
        plane.data.vertices[0].co.x = math.nan
    else:
        matrix[:3, 3] = math.nan
    bpy.context.view_layer.update()
    patches = surface_patches(plane.data, matrix)
    view = all_camera_views(scene, [1])[0][0]
    _, is_in_picture = pixels_filled(view, patches)
    is_somewhere = np.isfinite(patches.centres).all(axis=1)
    assert not is_in_picture[~is_somewhere].any() and (~is_somewhere).any()


@pytest.mark.parametrize("width", [None, 3.0], ids=["perspective", "orthographic"])
def test_the_pixels_that_patches_fill_are_those_of_a_picture(scene, width):
    """Of a ball and a tilted plane, by the alpha of a render; from inside a ball everything is seen."""
    scene.render.film_transparent = True
    cycles.add_camera(scene, (0, 0, 6), width=width, angle=0.5)
    bpy.context.view_layer.update()
    view = all_camera_views(scene, [1])[0][0]
    for thing in (cycles.add_sphere(scene), cycles.add_plane(scene, 1.5)):
        thing.rotation_euler = (0.0, 0.9, 0.3)
        bpy.context.view_layer.update()
        pixels, is_in_frame = pixels_filled(view, surface_patches(thing.data, np.array(thing.matrix_world)))
        covered = cycles.rendered(scene)[..., 3].sum()
        assert is_in_frame.all() and pixels.sum() == pytest.approx(covered, rel=0.06)
        thing.hide_render = True
    ball = cycles.add_sphere(scene, 10.0)
    pixels, is_in_frame = pixels_filled(view, surface_patches(ball.data, np.array(ball.matrix_world)))
    assert (pixels[is_in_frame] > 0.0).all() and is_in_frame.any()
