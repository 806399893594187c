"""Open Shading Language is switched on where glints look for a light, and by nothing else: it slows all materials."""

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material, prepare_scene
from glint_addon.nodes import checker
from glint_addon.prepare.shading_system import LEFT_OFF, LEFT_ON
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

SMALL, LARGE = 0.01, 1.0  # angular diameters of suns [rad]
# Largest difference of one pixel, relative to the mean, between a picture with OSL and one without, seeds alike:
# rounding of another processor; here there is none. One sample's noise is 0.4 of the mean.
ROUNDING = 1e-5


@pytest.fixture
def glints(scene, tmp_path):
    """A scene with OSL off, in it a square with glints under an even sky, seen by a camera; no lamp."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene.cycles.shading_system = False
    cycles.add_camera(scene, (0, 0, 3), width=2.0)
    cycles.add_plane(scene, material=create_glint_material("Sparkle", write_flake_map(tmp_path / "flakes.png")))
    scene.world = bpy.data.worlds.new("Sky")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.5, 1.0, 1.0)
    return scene


def add_sun(scene, angle=SMALL):
    return cycles.add_sun(scene, (0.1, 0.2, 1), angle=angle)


def add_script(name="Users own"):
    """A Script node of the user's in a material."""
    return bpy.data.materials.new(name).node_tree.nodes.new("ShaderNodeScript")


def prepared(scene):
    """Whether OSL is on after preparing, as the report must say, and the notes."""
    report = prepare_scene(scene)
    assert report["osl"] is bool(scene.cycles.shading_system)
    return report["osl"], report["notes"]


@pytest.mark.parametrize("angle", [None, LARGE])
def test_it_stays_off_where_glints_have_no_small_light(glints, angle):
    if angle is not None:
        add_sun(glints, angle)
    assert prepared(glints) == (False, [LEFT_OFF])
    assert prepared(glints) == (False, [LEFT_OFF])


def test_it_is_switched_on_for_a_small_light_and_off_again_when_that_is_gone(glints):
    sun = add_sun(glints)
    assert prepared(glints) == (True, [])
    bpy.data.objects.remove(sun)
    assert prepared(glints) == (False, [LEFT_OFF])
    add_sun(glints)
    assert prepared(glints) == (True, [])


def test_where_the_user_had_it_on_it_stays_on_and_a_sentence_says_what_that_costs(glints):
    glints.cycles.shading_system = True
    sun = add_sun(glints)
    assert prepared(glints) == (True, [])
    bpy.data.objects.remove(sun)
    assert prepared(glints) == (True, [LEFT_ON])


def test_who_switches_it_off_and_on_again_keeps_it_on(glints):
    sun = add_sun(glints)
    prepare_scene(glints)
    bpy.data.objects.remove(sun)
    glints.cycles.shading_system = False
    assert prepared(glints) == (False, [LEFT_OFF])
    glints.cycles.shading_system = True
    assert prepared(glints) == (True, [LEFT_ON])


@pytest.mark.parametrize(("path", "dark", "bright"), [("energy", 0.0, 1.0), ("angle", LARGE, SMALL)])
def test_a_light_that_animation_makes_later_needs_it_now(glints, path, dark, bright):
    sun = add_sun(glints).data
    for frame, value in ((1, dark), (10, bright)):
        setattr(sun, path, value)
        sun.keyframe_insert(path, frame=frame)
    glints.frame_set(1)
    assert prepared(glints) == (True, [])


def test_a_light_hidden_until_later_needs_it_now(glints):
    sun = add_sun(glints)
    for frame, hidden in ((1, True), (10, False)):
        sun.hide_render = hidden
        sun.keyframe_insert("hide_render", frame=frame)
    glints.frame_set(1)
    assert prepared(glints) == (True, [])


@pytest.mark.parametrize("on", [False, True])
def test_where_others_have_script_nodes_it_stays_as_it_is(glints, on):
    add_script()
    glints.cycles.shading_system = on
    assert prepared(glints) == (on, [])


def test_a_script_node_inside_a_group_counts_too(glints):
    sun = add_sun(glints)
    prepare_scene(glints)
    bpy.data.objects.remove(sun)
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    inner.nodes.new("ShaderNodeScript")
    group = bpy.data.lights.new("Lamp", "POINT").node_tree.nodes.new("ShaderNodeGroup")
    group.node_tree = inner
    assert prepared(glints) == (True, [])


def test_glints_own_textures_need_it(glints):
    node = bpy.data.materials.new("Floor").node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = checker.build()
    assert prepared(glints) == (True, [])


def test_glints_that_no_camera_sees_do_not_need_it(glints):
    add_sun(glints)
    glints.camera.rotation_euler = (np.pi, 0, 0)
    assert prepared(glints) == (False, [LEFT_OFF])


def test_each_scene_has_its_own(glints):
    lit = glints.copy()
    add_sun(lit)
    assert prepared(lit)[0] and not glints.cycles.shading_system


def test_the_picture_is_the_same_with_and_without(glints):
    prepare_scene(glints)
    without = cycles.rendered(glints)[..., :3]
    glints.cycles.shading_system = True
    np.testing.assert_allclose(cycles.rendered(glints)[..., :3], without, atol=ROUNDING * without.mean())
    assert without.mean() > 0.1
