"""Stress of lights: distances, sizes, kinds, numbers, visibility, linking, motion, against Blender's own nodes."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

import glint_addon
from demo_scenes import maps
from demo_scenes.maps import blender_image
from tests.helpers import cycles
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import MIDDLE, SUN_ANGLE, add_lamp, add_sky, add_square, diffuse_material

pytestmark = stress("every light against Blender's nodes", fast=[
    "osl/test_lobe.py::test_every_kind_of_light_has_the_right_mean",
])

# What is lit or mirrored in a fraction of a pixel is found by many samples only, of the lobe too.
MANY = (2048, 2)
MANY_OF_THE_LOBE = (512, 2)
# Lobes as wide as this see a light that touches the surface from most of it.
BLURRED = {"roughness": 0.5}
FRAME = 20


def under(*lamps, sky=0.0, view=add_square):
    """A build function: the square under `lamps`, dictionaries of the arguments of `add_lamp`."""

    def build(scene, material):
        view(scene, material)
        if sky:
            add_sky(scene, sky)
        return [add_lamp(scene, **lamp) for lamp in lamps]

    return build


def lamp(kind="POINT", location=MIDDLE, **settings):
    return {"kind": kind, "location": location} | settings


FAR = (0, 7e5, 7e5)
PLACES = {
    "point a millimetre above the surface": lamp(location=(0, 0.3, 1e-3), power=1.0, shadow_soft_size=0.0),
    "point a centimetre above the surface": lamp(location=(0, 0.3, 1e-2), power=1.0, shadow_soft_size=0.0),
    "ball a millimetre above the surface": lamp(location=(0, 0.3, 1e-3), power=1.0, shadow_soft_size=5e-4),
    "point a decimetre above the surface": lamp(location=(0, 0.1, 0.1), power=1.0, shadow_soft_size=0.0),
    "point at a million metres": lamp(location=FAR, power=1e13, shadow_soft_size=0.0),
    "ball at a million metres": lamp(location=FAR, power=1e13, shadow_soft_size=2e4),
    "spot at a million metres": lamp("SPOT", FAR, power=1e13, shadow_soft_size=2e4, spot_size=0.1),
    "area at a million metres": lamp("AREA", FAR, power=1e13, size=5e4),
    "ball half in the surface": lamp(location=(0, 0.3, 0), shadow_soft_size=0.1),
}


@pytest.mark.parametrize("place", PLACES)
def test_place_of_a_light(stress_record, place):
    near = "above" in place or "in the" in place
    outcome = compare(stress_record, under(PLACES[place]), surface=BLURRED if near else None, nodes=MANY,
                      lobe=MANY_OF_THE_LOBE if near else (16, 2))
    assert outcome.report["hints"]


DARK = {
    "no light": [],
    "zero energy": [lamp("SUN", power=0.0)],
    "point on the surface": [lamp(location=(0, 0, 0), shadow_soft_size=0.0)],
    "behind the surface": [lamp(location=(0, 0.6, -1), shadow_soft_size=0.1)],
    "sun behind the surface": [lamp("SUN", (0, 1, -1), angle=SUN_ANGLE)],
    "area seen from behind": [lamp("AREA", target=(0, 9, 9), size=0.2)],
    "area without size": [lamp("AREA", size=0.0)],
    "camera in a ball": [lamp(location=(0, -2, 2), shadow_soft_size=0.5)],
}


@pytest.mark.parametrize("light", DARK)
def test_no_light_reaches_the_view(stress_record, light):
    outcome = compare(stress_record, under(*DARK[light]), nodes=(64, 2), lit=False)
    assert outcome.nodes.max() == 0 or light == "camera in a ball"
    assert outcome.lobe.max() == 0 or light == "camera in a ball"


def test_negative_energy(stress_record):
    # Less than the sky, so that no pixel is negative.
    shadow = lamp("SUN", power=-0.02, angle=SUN_ANGLE)
    compare(stress_record, under(shadow, lamp("SUN", power=0.05, angle=SUN_ANGLE), sky=1.0))


SHAPES = {
    "sun of no angle": lamp("SUN", power=1.0, angle=0.0),
    "sun of 30 degrees": lamp("SUN", power=1.0, angle=math.radians(29.9)),
    "sun of 180 degrees": lamp("SUN", power=1.0, angle=math.pi),
    "point of no radius": lamp(shadow_soft_size=0.0),
    "ball of half a metre": lamp(shadow_soft_size=0.5),
    "ball around the square": lamp(location=(0, 0, 0), shadow_soft_size=20.0, power=1e4),
    "spot of 1 degree": lamp("SPOT", spot_size=math.radians(1), shadow_soft_size=0.05, power=1000.0),
    "spot of 180 degrees": lamp("SPOT", spot_size=math.pi, spot_blend=0.0, shadow_soft_size=0.05),
    "spot without blend": lamp("SPOT", spot_size=0.4, spot_blend=0.0, shadow_soft_size=0.05),
    "spot all blend": lamp("SPOT", spot_size=0.7, spot_blend=1.0, shadow_soft_size=0.05),
    "thin rectangle": lamp("AREA", shape="RECTANGLE", size=1.0, size_y=1e-4),
    "ellipse": lamp("AREA", shape="ELLIPSE", size=0.4, size_y=0.05),
    "disk that shines straight ahead": lamp("AREA", shape="DISK", size=0.3, spread=math.radians(5)),
    "square of 3 metres": lamp("AREA", size=3.0),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shape_of_a_light(stress_record, shape):
    budget = {"nodes": MANY, "lobe": MANY_OF_THE_LOBE} if "1 degree" in shape else {"nodes": (1024, 2)}
    compare(stress_record, under(SHAPES[shape]), **budget)


def small_square(scene, material):
    """Two metres under a near camera: of a map of 512 texels 200 are in a pixel."""
    cycles.add_plane(scene, 2.0, material=material)
    cycles.add_camera(scene, (0, -1.2, 1.2), (0, 0, 0), angle=0.5)


def test_a_tube_over_flakes_that_are_merged(stress_record):
    """A narrow light in a wide region: flakes were 5 % too bright while their cells lay around its half vector."""
    tube = lamp("AREA", power=10.0, shape="RECTANGLE", size=1.2, size_y=0.02)
    surface = {"roughness": 0.12, "interpolation": "CLOSEST"}
    outcome = compare(stress_record, under(tube, view=small_square), surface=surface, size=(16, 16), nodes=(4096, 4),
                      lobe=(64, 8), normal_map=maps.flakes(512, std=0.15, seed=3))
    assert outcome.report["hints"] and abs(outcome.energy - 1) < 0.02


def test_light_inside_the_object_and_the_camera_too(stress_record):
    def build(scene, material):
        cycles.add_sphere(scene, 1.0, material=material)
        cycles.add_camera(scene, (0, 0, 0), (0, 1, 0), angle=1.2)
        add_lamp(scene, location=(0.3, 0, 0.2), shadow_soft_size=0.05)

    compare(stress_record, build)


@pytest.mark.parametrize("count", [1, 8, 9, 100])
def test_number_of_lights(stress_record, count):
    turns = [2 * math.pi * k / count for k in range(count)]
    suns = [lamp("SUN", (1.5 * math.sin(turn), 3 + math.cos(turn), 3), power=1 / count, angle=SUN_ANGLE)
            for turn in turns]
    outcome = compare(stress_record, under(*suns))
    assert len(outcome.report["hints"]) == min(count, 8)


def colour(lamp):
    lamp.data.color = (1.0, 0.2, 0.05)
    lamp.data.use_temperature, lamp.data.temperature = True, 3000.0


def texture(lamp):
    """A checkered light: its node tree gives the emission."""
    tree = lamp.data.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    checker = tree.nodes.new("ShaderNodeTexChecker")
    geometry = tree.nodes.new("ShaderNodeNewGeometry")
    tree.links.new(geometry.outputs["Position"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], emission.inputs["Color"])
    tree.links.new(checker.outputs["Fac"], emission.inputs["Strength"])


def cast_no_shadow(lamp):
    lamp.data.use_shadow = False


def bounce_nowhere(lamp):
    lamp.data.cycles.max_bounces = 0


def leave_mis(lamp):
    lamp.data.cycles.use_multiple_importance_sampling = False


def turn_from_the_camera(lamp):
    lamp.visible_camera = False


def follow_a_bent_parent(lamp):
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.location, parent.rotation_euler, parent.scale = (0.2, 0, 0.1), (0.1, 0, 0.2), (1, 1.2, 0.9)
    lamp.parent = parent


@pytest.mark.parametrize("kind", ["POINT", "AREA"])
@pytest.mark.parametrize("change", [colour, texture, cast_no_shadow, bounce_nowhere, leave_mis, turn_from_the_camera,
                                    follow_a_bent_parent])
def test_kind_of_light(stress_record, kind, change):
    def build(scene, material):
        add_square(scene, material)
        light = add_lamp(scene, kind, **({"shadow_soft_size": 0.15} if kind == "POINT" else {"size": 0.3}))
        # A ball in the light's way, so that there is a shadow.
        ball = cycles.add_sphere(scene, 0.1, material=diffuse_material(), segments=16, rings=8)
        ball.location = (0.3, 0.4, 0.4)
        change(light)

    outcome = compare(stress_record, build, nodes=(1024, 2))
    assert outcome.report["hints"]


@pytest.mark.parametrize("hidden", ["visible_glossy", "hide_render"])
def test_hidden_light(stress_record, hidden):
    def build(scene, material):
        add_square(scene, material)
        add_sky(scene, 0.3)
        setattr(add_lamp(scene, "SUN", angle=SUN_ANGLE), hidden, hidden == "hide_render")

    assert compare(stress_record, build).report["hints"] == []


@pytest.mark.parametrize("collection", ["receiver_collection", "blocker_collection"])
@pytest.mark.parametrize("state", ["INCLUDE", "EXCLUDE"])
def test_light_linking(stress_record, collection, state):
    def build(scene, material):
        add_square(scene, material)
        second = cycles.add_plane(scene, 1.0, material=material, repeats=1.0)
        second.location = (-0.4, 0.2, 0.2)
        light = add_lamp(scene, "SUN", power=1.0, angle=SUN_ANGLE)
        linked = bpy.data.collections.new("Linked")
        linked.objects.link(second)
        setattr(light.light_linking, collection, linked)
        linked.collection_objects[0].light_linking.link_state = state

    assert compare(stress_record, build).report["hints"]


def move_by_keys(light):
    for frame, x in ((1, -0.5), (2 * FRAME - 1, 0.7)):
        light.location = (x, 1.2, 1.2)
        light.keyframe_insert("location", frame=frame)
    light.data.energy = 5.0
    light.data.keyframe_insert("energy", frame=1)
    light.data.energy = 60.0
    light.data.keyframe_insert("energy", frame=FRAME)


def move_by_strip(light):
    move_by_keys(light)
    animation = light.animation_data
    action, slot = animation.action, animation.action_slot
    animation.action = None
    strip = animation.nla_tracks.new().strips.new("Strip", 1, action)
    strip.action_slot = slot


def move_by_driver(light):
    curve = light.driver_add("location", 0)
    curve.driver.expression = "0.02 * frame - 0.4"


def switch_on_by_keys(light):
    light.hide_render = True
    light.keyframe_insert("hide_render", frame=1)
    light.hide_render = False
    light.keyframe_insert("hide_render", frame=FRAME)


@pytest.mark.parametrize("move", [move_by_keys, move_by_strip, move_by_driver, switch_on_by_keys])
def test_light_prepared_at_another_frame(stress_record, move):
    def build(scene, material):
        add_square(scene, material)
        move(add_lamp(scene, shadow_soft_size=0.15))
        scene.frame_set(1)
        reports.append(glint_addon.prepare_scene(scene))
        scene.frame_set(FRAME)

    reports = []
    compare(stress_record, build, nodes=(1024, 2), prepare=False)
    assert reports[-1]["hints"] == ["Point"]


def emissive_ball(scene):
    material, _ = cycles.emission_material()
    emission = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeEmission")
    emission.inputs["Strength"].default_value = 20.0
    material.cycles.emission_sampling = "AUTO"
    ball = cycles.add_sphere(scene, 0.3, material=material, segments=16, rings=8)
    ball.location = MIDDLE


def hdri(scene):
    """A dim sky with a bright patch of 10 degrees, as an image."""
    pixels = np.full((36, 72, 3), 0.1, np.float32)
    pixels[22:24, 52:54] = 100.0
    add_world_texture(scene, "ShaderNodeTexEnvironment").image = blender_image("Sky", pixels)


def sky_with_sun(scene):
    sky = add_world_texture(scene, "ShaderNodeTexSky")
    sky.sky_type = "MULTIPLE_SCATTERING"
    sky.sun_disc, sky.sun_size, sky.sun_elevation, sky.sun_rotation = True, SUN_ANGLE, math.pi / 4, 0.0


def add_world_texture(scene, kind):
    background = add_sky(scene)
    tree = scene.world.node_tree
    texture = tree.nodes.new(kind)
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    return texture


@pytest.mark.parametrize("source", [emissive_ball, hdri, sky_with_sun])
def test_light_that_is_no_lamp(stress_record, source):
    def build(scene, material):
        add_square(scene, material)
        source(scene)

    assert compare(stress_record, build, nodes=(128, 2), lobe=(128, 2)).report["hints"]


def test_light_and_sky_together(stress_record):
    compare(stress_record, under(lamp("SUN", power=1.0, angle=SUN_ANGLE), lamp(shadow_soft_size=0.1), sky=0.5),
            lobe=(64, 2))
