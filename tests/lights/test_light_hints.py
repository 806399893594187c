"""Which lights become hints, which do not and why, and the irradiance they are ranked by (against Cycles)."""

import math

import bpy
import numpy as np
import pytest

from glint_addon.choice.ranking import TOO_MANY
from glint_addon.lights.irradiance import irradiance
from glint_addon.lights.lamps import MISSES
from glint_addon.lights.receivers import glint_objects, lit_objects, world_bounds
from glint_addon.lights.softness import SOFT_HALF_ANGLE, TOO_SOFT
from glint_addon.nodes import glint_bsdf, glint_lights
from tests.helpers import cycles
from tests.helpers.scene_hints import scene_hints

# A light of 1/20 of its distance is seen under cosines that differ from 1 by 0.1 %; 256 samples leave less noise.
IRRADIANCE_TOLERANCE = 0.01


def add_lamp(scene, name, kind="POINT", location=(0, 0, 5), **settings):
    light = bpy.data.lights.new(name, kind)
    for key, value in settings.items():
        setattr(light, key, value)
    lamp = bpy.data.objects.new(name, light)
    lamp.location = location
    scene.collection.objects.link(lamp)
    return lamp


def material_with(group, name="Glints"):
    """A material that uses `group` two levels down."""
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    inner.nodes.new("ShaderNodeGroup").node_tree = group
    material, _ = cycles.emission_material(name)
    material.node_tree.nodes.new("ShaderNodeGroup").node_tree = inner
    return material


def names(hints):
    return [hint.name for hint in hints]


def move_to_collection(scene, thing, name="Collection"):
    collection = bpy.data.collections.new(name)
    scene.collection.children.link(collection)
    collection.objects.link(thing)
    scene.collection.objects.unlink(thing)
    return collection


def exclude_collection(lamp):
    scene = bpy.context.scene
    move_to_collection(scene, lamp)
    scene.view_layers[0].layer_collection.children["Collection"].exclude = True


def hide_parent_collection(lamp):
    outer = bpy.data.collections.new("Outer")
    bpy.context.scene.collection.children.link(outer)
    inner = move_to_collection(bpy.context.scene, lamp)
    bpy.context.scene.collection.children.unlink(inner)
    outer.children.link(inner)
    outer.hide_render = True


REASONS = [
    ("POINT", lambda lamp: setattr(lamp, "hide_render", True), "hidden in renders"),
    ("POINT", exclude_collection, "excluded from the view layer"),
    ("POINT", hide_parent_collection, "collections are hidden in renders"),
    ("SUN", lambda lamp: setattr(lamp.data, "energy", 0.0), "zero or negative"),
    ("SPOT", lambda lamp: setattr(lamp.data, "energy", -3.0), "zero or negative"),
    ("POINT", lambda lamp: setattr(lamp.data, "color", (0, 0, 0)), "black"),
    ("POINT", lambda lamp: setattr(lamp, "visible_glossy", False), "glossy"),
    ("AREA", lambda lamp: setattr(lamp.data.cycles, "is_portal", True), "portal"),
    ("SUN", lambda lamp: setattr(lamp.data, "angle", 2 * SOFT_HALF_ANGLE + 0.01), "smooth"),
]


@pytest.mark.parametrize(("kind", "spoil", "words"), REASONS, ids=[reason[2] for reason in REASONS])
def test_a_light_that_cannot_matter_is_skipped_and_the_reason_said(scene, kind, spoil, words):
    add_lamp(scene, "Kept")
    lamp = add_lamp(scene, "Spoilt", kind)
    assert names(scene_hints(scene)[0]) == ["Kept", "Spoilt"]
    spoil(lamp)
    kept, skipped = scene_hints(scene)
    assert names(kept) == ["Kept"]
    [(name, reason)] = skipped
    assert name == "Spoilt"
    assert words in reason


def aside(lamp):
    """Turn a lamp over the square to the side."""
    lamp.rotation_euler = (math.pi / 2, 0, 0)


def glinting_square():
    thing = cycles.add_plane(bpy.context.scene)
    thing.data.materials.append(material_with(glint_bsdf.build()))
    return thing


def upwards(lamp):
    lamp.rotation_euler = (math.pi, 0, 0)


def softly(lamp):
    """Its middle sees the square outside its cone, its edge does not."""
    lamp.location = (1.5, 0, 1)
    lamp.data.spot_size = 0.1
    lamp.data.shadow_soft_size = 0.6


@pytest.mark.parametrize(("kind", "turn", "kept"), [
    ("SPOT", aside, False), ("SPOT", upwards, False), ("AREA", upwards, False), ("POINT", upwards, True),
    ("SPOT", softly, True), ("AREA", aside, True),
])
def test_a_light_that_shines_past_every_glint_is_skipped(scene, kind, turn, kept):
    glinting_square()
    lamp = add_lamp(scene, "Lamp", kind)
    assert names(scene_hints(scene)[0]) == ["Lamp"]
    turn(lamp)
    hints, skipped = scene_hints(scene)
    assert names(hints) == (["Lamp"] if kept else [])
    assert skipped == ([] if kept else [("Lamp", MISSES)])


@pytest.mark.parametrize(("kind", "size"), [("POINT", "shadow_soft_size"), ("AREA", "size")])
def test_a_light_that_looks_wide_to_all_glints_is_skipped_while_it_stays(scene, kind, size):
    square = glinting_square()
    lamp = add_lamp(scene, "Lamp", kind, **{size: 0.5})
    assert names(scene_hints(scene)[0]) == ["Lamp"]
    setattr(lamp.data, size, 5.0)
    assert scene_hints(scene) == ([], [("Lamp", TOO_SOFT)])
    square.scale = (20, 20, 1)  # its far corners see the light small
    assert names(scene_hints(scene)[0]) == ["Lamp"]
    square.scale = (1, 1, 1)
    lamp.keyframe_insert("location", frame=1)
    assert names(scene_hints(scene)[0]) == ["Lamp"]


def parent_moves(lamp, square):
    lamp.parent = cycles.add_plane(bpy.context.scene)
    lamp.parent.keyframe_insert("location", frame=1)


@pytest.mark.parametrize("change", [
    lambda lamp, square: lamp.keyframe_insert("rotation_euler", frame=1),
    lambda lamp, square: lamp.data.keyframe_insert("spot_size", frame=1),
    lambda lamp, square: lamp.constraints.new("TRACK_TO"),
    parent_moves,
    lambda lamp, square: square.keyframe_insert("location", frame=1),
    lambda lamp, square: square.modifiers.new("Array", "ARRAY"),
    lambda lamp, square: setattr(square.material_slots[0].material, "displacement_method", "BOTH"),
], ids=["turns", "widens", "constrained", "parent moves", "object moves", "array", "displaced"])
def test_a_light_that_may_shine_on_glints_at_another_frame_is_kept(scene, change):
    square = glinting_square()
    lamp = add_lamp(scene, "Lamp", "SPOT")
    aside(lamp)
    assert names(scene_hints(scene)[0]) == []
    change(lamp, square)
    assert names(scene_hints(scene)[0]) == ["Lamp"]


def test_a_scene_without_lights_has_no_hints(scene):
    assert scene_hints(scene) == ([], [])


def test_an_area_light_of_any_width_and_a_portal_switch_on_another_kind_are_kept(scene):
    add_lamp(scene, "Wall", "AREA", size=500.0)
    add_lamp(scene, "Lamp").data.cycles.is_portal = True
    assert names(scene_hints(scene)[0]) == ["Lamp", "Wall"]


def test_a_sun_just_under_the_soft_angle_is_kept(scene):
    add_lamp(scene, "Sun", "SUN", angle=2 * SOFT_HALF_ANGLE - 0.01)
    assert names(scene_hints(scene)[0]) == ["Sun"]


def test_a_light_in_a_visible_and_a_hidden_collection_is_kept(scene):
    lamp = add_lamp(scene, "Lamp")
    move_to_collection(scene, lamp, "Hidden").hide_render = True
    shown = bpy.data.collections.new("Shown")
    scene.collection.children.link(shown)
    shown.objects.link(lamp)
    assert names(scene_hints(scene)[0]) == ["Lamp"]


def test_each_view_layer_that_renders_counts_unless_one_is_named(scene):
    lamp = add_lamp(scene, "Lamp")
    move_to_collection(scene, lamp)
    first, second = scene.view_layers[0], scene.view_layers.new("Second")
    first.layer_collection.children["Collection"].exclude = True
    assert names(scene_hints(scene)[0]) == ["Lamp"]
    assert names(scene_hints(scene, first)[0]) == []
    assert names(scene_hints(scene, second)[0]) == ["Lamp"]
    second.use = False
    assert names(scene_hints(scene)[0]) == []


def test_a_light_that_animation_switches_on_later_is_kept(scene):
    lamp = add_lamp(scene, "Keyed", energy=0.0)
    lamp.data.keyframe_insert("energy", frame=1)
    lamp.data.energy = 10.0
    lamp.data.keyframe_insert("energy", frame=9)
    driven = add_lamp(scene, "Driven", energy=0.0)
    driven.data.driver_add("energy").driver.expression = "frame"
    never = add_lamp(scene, "Never", energy=0.0)
    never.data.keyframe_insert("energy", frame=1)
    scene.frame_set(1)
    assert lamp.data.energy == 0.0
    hints, skipped = scene_hints(scene)
    assert names(hints) == ["Driven", "Keyed"]
    assert [name for name, _ in skipped] == ["Never"]
    assert hints[1].power > 0


def test_the_eight_strongest_are_kept_in_order_of_name(scene):
    energies = [5, 9, 1, 7, 3, 8, 2, 6, 4, 10]
    for number, energy in enumerate(energies):
        add_lamp(scene, f"Lamp {number}", energy=energy)
    kept, skipped = scene_hints(scene)
    strong = [f"Lamp {number}" for number, energy in enumerate(energies) if energy > 2]
    assert names(kept) == strong
    assert skipped == [("Lamp 2", TOO_MANY), ("Lamp 6", TOO_MANY)]


def test_strength_is_judged_at_the_objects_with_glints(scene):
    cycles.add_plane(scene, 1.0)
    far = cycles.add_plane(scene, 1.0, material=material_with(glint_bsdf.build()))
    far.location = (100, 0, 0)
    for number in range(8):
        add_lamp(scene, f"Near the plain plane {number}", location=(0, 0, 1), energy=50)
    add_lamp(scene, "Near the glints", location=(100, 0, 1), energy=1)
    kept, skipped = scene_hints(scene)
    assert "Near the glints" in names(kept)
    assert len(skipped) == 1


def test_objects_with_glints_are_those_with_a_glint_bsdf_not_with_another_group_of_ours(scene):
    glints = cycles.add_plane(scene, 1.0, material=material_with(glint_bsdf.build()))
    cycles.add_plane(scene, 1.0, material=material_with(glint_lights.build(), "Textured"))
    cycles.add_plane(scene, 1.0)
    assert glint_objects(scene.objects, scene.view_layers[:]) == [glints]


@pytest.mark.parametrize(("kind", "settings"), [("SPOT", {"spot_size": 0.5}), ("AREA", {"size": 0.1})])
def test_a_spot_or_area_light_that_looks_away_is_the_first_to_go(scene, kind, settings):
    cycles.add_plane(scene, 1.0, material=material_with(glint_bsdf.build()))
    away = add_lamp(scene, "Away", kind, energy=1000, **settings)
    away.rotation_euler = (math.pi, 0, 0)
    away.constraints.new("LIMIT_SCALE")  # it may turn around one day
    for number in range(8):
        add_lamp(scene, f"Lamp {number}", energy=1)
    assert scene_hints(scene)[1] == [("Away", TOO_MANY)]
    away.rotation_euler = (0, 0, 0)
    assert scene_hints(scene)[1] == [("Lamp 7", TOO_MANY)]


def test_light_linking_that_excludes_all_glints_is_a_reason_to_skip(scene):
    plane = cycles.add_plane(scene, 1.0, material=material_with(glint_bsdf.build()))
    lamp = add_lamp(scene, "Lamp")
    lamp.light_linking.receiver_collection = bpy.data.collections.new("Receivers")
    lamp.light_linking.receiver_collection.objects.link(plane)
    assert names(scene_hints(scene)[0]) == ["Lamp"]
    lamp.light_linking.receiver_collection.collection_objects[0].light_linking.link_state = "EXCLUDE"
    hints, [(_, reason)] = scene_hints(scene)
    assert hints == []
    assert "light linking" in reason


# States of plane A and B in the receiver collection itself, and of child collections that hold A and B.
LINKING = [
    ("INCLUDE", None, None, None),
    ("EXCLUDE", None, None, None),
    ("EXCLUDE", "INCLUDE", None, None),
    (None, None, "INCLUDE", None),
    (None, None, "EXCLUDE", None),
    ("INCLUDE", None, "EXCLUDE", None),
    ("EXCLUDE", None, "INCLUDE", None),
    (None, "EXCLUDE", None, "INCLUDE"),
    (None, "INCLUDE", "EXCLUDE", "INCLUDE"),
]


@pytest.mark.parametrize("states", LINKING)
def test_light_linking_is_read_as_cycles_reads_it(states):
    scene = cycles.empty_scene(size=(12, 4), osl=False)
    cycles.box_filter(scene, 0.01)
    cycles.add_camera(scene, (0, 0, 5), width=3)
    planes = [cycles.add_plane(scene, 0.9) for _ in range(3)]
    for plane, x in zip(planes, (-1, 0, 1), strict=True):
        plane.location.x = x
    sun = cycles.add_sun(scene, (0, 0, 1))
    receivers = bpy.data.collections.new("Receivers")
    sun.light_linking.receiver_collection = receivers

    objects = [(plane, state) for plane, state in zip(planes, states[:2], strict=False) if state]
    children = [(plane, state) for plane, state in zip(planes, states[2:], strict=False) if state]
    for plane, _ in objects:
        receivers.objects.link(plane)
    for plane, _ in children:
        child = bpy.data.collections.new("Child")
        child.objects.link(plane)
        receivers.children.link(child)
    for entries, wanted in ((receivers.collection_objects, objects), (receivers.collection_children, children)):
        for entry, (_, state) in zip(entries, wanted, strict=True):
            entry.light_linking.link_state = state

    seen = cycles.rendered(scene)[2, [2, 6, 10], 0] > 0
    lit = lit_objects(sun, planes)
    assert [plane in lit for plane in planes] == seen.tolist()


IRRADIANCES = [
    ("POINT", {"energy": 100.0, "shadow_soft_size": 0.25}, 1),
    ("POINT", {"energy": 100.0, "shadow_soft_size": 0.25, "exposure": 2.0}, 1),
    ("POINT", {"energy": 100.0, "shadow_soft_size": 0.25, "normalize": False}, 1),
    ("POINT", {"energy": 100.0, "shadow_soft_size": 0.0, "color": (0.5, 0.1, 0.2)}, 1),
    ("POINT", {"energy": 100.0, "shadow_soft_size": 0.1, "use_temperature": True, "temperature": 3000.0}, 1),
    ("SPOT", {"energy": 100.0, "shadow_soft_size": 0.1, "spot_size": 0.5, "spot_blend": 0.0}, 1),
    ("AREA", {"energy": 100.0, "shape": "SQUARE", "size": 0.2}, 1),
    ("AREA", {"energy": 100.0, "shape": "RECTANGLE", "size": 0.2, "size_y": 0.1, "normalize": False}, 2),
    ("AREA", {"energy": 100.0, "shape": "DISK", "size": 4.0}, 1),
    ("AREA", {"energy": 100.0, "shape": "ELLIPSE", "size": 0.2, "size_y": 0.1, "normalize": False}, 3),
    ("AREA", {"energy": 100.0, "shape": "DISK", "size": 0.02, "spread": 0.5}, 1),
    ("AREA", {"energy": 100.0, "shape": "SQUARE", "size": 0.002, "spread": 0.2}, 1),
    ("SUN", {"energy": 3.0, "angle": 0.05}, 1),
    ("SUN", {"energy": 300.0, "angle": 0.05, "normalize": False}, 1),
]


@pytest.mark.parametrize(("kind", "settings", "scale"), IRRADIANCES)
def test_the_estimated_irradiance_is_what_cycles_puts_on_a_white_plane(kind, settings, scale):
    scene = cycles.empty_scene(size=(4, 4), spp=256, osl=False)
    cycles.add_camera(scene, (0, 0, 1), width=0.005)
    material, colour = cycles.emission_material()
    tree = material.node_tree
    white = tree.nodes.new("ShaderNodeBsdfDiffuse")
    white.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(white.outputs["BSDF"], next(node for node in tree.nodes if "Output" in node.bl_idname).inputs[0])
    plane = cycles.add_plane(scene, 0.01, material=material)
    lamp = add_lamp(scene, "Lamp", kind, **settings)
    lamp.scale = (scale,) * 3
    scene.view_layers[0].update()
    expected = math.pi * cycles.rendered(scene)[..., :3].mean((0, 1)).max()
    assert irradiance(lamp, *world_bounds([plane]), lamp.data.energy) == pytest.approx(
        expected, rel=IRRADIANCE_TOLERANCE
    )


def test_a_light_inside_the_bounds_has_a_finite_irradiance(scene):
    low, high = np.array([[-1.0, -1, -1]]), np.array([[1.0, 1, 1]])
    for kind, settings in (("POINT", {"shadow_soft_size": 0.0}), ("SPOT", {}), ("AREA", {"size": 0.0})):
        lamp = add_lamp(scene, kind, kind, location=(0, 0, 0.5), **settings)
        scene.view_layers[0].update()
        assert 0 < irradiance(lamp, low, high, 1.0) < math.inf


def test_bounds_are_those_of_the_moved_and_turned_box(scene):
    plane = cycles.add_plane(scene, 2.0)
    plane.location, plane.rotation_euler, plane.scale = (5, 0, 0), (math.pi / 2, 0, 0), (1, 3, 1)
    scene.view_layers[0].update()
    low, high = world_bounds([plane])
    assert low[0] == pytest.approx((4, 0, -3), abs=1e-6)
    assert high[0] == pytest.approx((6, 0, 3), abs=1e-6)
