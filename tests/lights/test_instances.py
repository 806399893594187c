"""Copies of lights as hints: instanced collections by drivers, geometry nodes, faces and nested ones by keys."""

import math
import random

import bpy
import numpy as np
import pytest
from mathutils import Vector

from glint_addon.lights.driven_matrix import DrivenMatrix
from glint_addon.lights.drivers import connect_hints
from glint_addon.nodes import glint_lights
from glint_addon.nodes.glint_lights import KIND_LOCAL, KIND_SUN
from glint_addon.nodes.scene_lights import HOLDER
from tests.helpers import cycles
from tests.helpers.scene_hints import scene_hints
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import MIDDLE, add_lamp, add_square
from tests.lights.test_emitters import add_bulb, add_glints, slot_values

# Blender keeps matrices and sockets in 32-bit floats; places here are up to hundreds of metres, directions units.
PLACE_TOLERANCE = 1e-3
DIRECTION_TOLERANCE = 1e-5
LONGEST = 255  # characters of a driver's expression


def fixture(scene, *things, name="Fixture", offset=(0, 0, 0)):
    """A collection of objects that the scene shows by instances alone."""
    collection = bpy.data.collections.new(name)
    collection.instance_offset = offset
    for thing in things:
        collection.objects.link(thing)
        scene.collection.objects.unlink(thing)
    return collection


def add_instance(scene, collection, name="Empty", location=(0, 0, 0)):
    empty = bpy.data.objects.new(name, None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    empty.location = location
    scene.collection.objects.link(empty)
    return empty


def connected(scene):
    hints, _ = scene_hints(scene)
    connect_hints(glint_lights.build(), scene, hints)
    return {hint.name: slot for slot, hint in enumerate(hints, 1)}


def names(scene):
    return [hint.name for hint in scene_hints(scene)[0]]


@pytest.mark.parametrize(("scale", "cone"), [((2, 2, 2), 0.3), ((2, 1, 1), 0.0)])
def test_the_cone_of_an_instanced_spot_is_known_where_its_empty_does_not_stretch_it(scene, scale, cone):
    add_glints(scene)
    spot = add_lamp(scene, "SPOT", spot_size=0.6)
    empty = add_instance(scene, fixture(scene, spot))
    empty.rotation_euler, empty.scale = (0.2, 0.3, 0.0), scale
    bpy.context.view_layer.update()
    (slot,) = connected(scene).values()
    group = glint_lights.build().evaluated_get(bpy.context.evaluated_depsgraph_get())
    axis = Vector([group.nodes[f"Axis {slot}"].inputs[each].default_value for each in "XYZ"])
    assert slot_values(slot)[1][2] == pytest.approx(cone, rel=1e-5)
    expected = (empty.matrix_world @ spot.matrix_world).col[2].to_3d().normalized()
    assert (axis - expected).length < DIRECTION_TOLERANCE if cone else axis.length == 0.0


def test_lights_of_an_instanced_collection_are_followed_with_their_empty(scene):
    pick = random.Random(3)
    add_glints(scene)
    area = {"name": "Area", "shape": "RECTANGLE", "size": 0.5, "size_y": 2.0}
    things = [add_lamp(scene), add_lamp(scene, "SUN", angle=0.1), add_lamp(scene, "AREA", **area), add_bulb(scene)]
    empty = add_instance(scene, fixture(scene, *things, offset=(0.5, -0.25, 1.0)))
    slots = connected(scene)
    assert list(slots) == ["Area in Empty", "Bulb in Empty", "Point in Empty", "Sun in Empty"]
    for _ in range(20):
        for thing in (empty, *things):
            thing.location = [pick.uniform(-10, 10) for _ in range(3)]
            thing.rotation_euler = [pick.uniform(-7, 7) for _ in range(3)]
            thing.scale = [pick.uniform(0.5, 2) * pick.choice([-1, 1]) for _ in range(3)]
        bpy.context.view_layer.update()
        # Blender's own copies are what Cycles renders.
        copies = {entry.instance_object.name: entry.matrix_world.copy()
                  for entry in bpy.context.view_layer.depsgraph.object_instances if entry.is_instance}
        for name in ("Area", "Bulb", "Point"):
            place, shape = slot_values(slots[f"{name} in Empty"])
            assert (Vector(place) - copies[name].translation).length < PLACE_TOLERANCE
            assert shape[0] == KIND_LOCAL
        x, y = (copies["Area"].col[axis].to_3d().length for axis in (0, 1))
        assert slot_values(slots["Area in Empty"])[1][1] == pytest.approx(0.5 * math.hypot(0.5 * x, 2 * y), rel=1e-4)
        largest = np.linalg.svd(np.array(copies["Bulb"])[:3, :3], compute_uv=False).max()
        assert 0.1 * largest * (1 - 1e-4) <= slot_values(slots["Bulb in Empty"])[1][1]
        direction, shape = slot_values(slots["Sun in Empty"])
        assert (Vector(direction) - copies["Sun"].col[2].to_3d().normalized()).length < DIRECTION_TOLERANCE
        assert shape == pytest.approx([KIND_SUN, 0.05, 0])


def test_the_longest_expressions_fit_a_driver(scene):
    lamp = add_lamp(scene)
    collection = fixture(scene, lamp, offset=(-1.2345678e-5,) * 3)
    matrix = DrivenMatrix(lamp, add_instance(scene, collection))
    numbers = [*matrix.point((-1.2345678e-5, -9.8765432e-6, -123456.789)), *matrix.z_axis()]
    assert max(len(number.expression) for number in numbers) <= LONGEST


def hide_member(empty, lamp):
    lamp.hide_render = True


def hide_collection(empty, lamp):
    empty.instance_collection.hide_render = True


def hide_empty(empty, lamp):
    empty.hide_render = True


def hide_from_gloss(empty, lamp):
    empty.visible_glossy = False


def switch_off(empty, lamp):
    lamp.data.energy = 0.0


@pytest.mark.parametrize("hide", [hide_member, hide_collection, hide_empty, hide_from_gloss, switch_off])
def test_what_an_instance_does_not_show_is_no_light(hide):
    scene = cycles.empty_scene(size=(4, 4), spp=4, osl=False)
    cycles.add_camera(scene, (0, 0, 3), width=1.0)
    square = cycles.add_plane(scene)
    square.data.materials.append(bpy.data.materials.new("Mirror"))
    principled = next(node for node in square.data.materials[0].node_tree.nodes if "Principled" in node.bl_idname)
    principled.inputs["Metallic"].default_value, principled.inputs["Roughness"].default_value = 1.0, 0.5
    lamp = add_lamp(scene, location=(0, 0, 5))
    empty = add_instance(scene, fixture(scene, lamp))
    assert names(scene) == ["Point in Empty"]
    assert cycles.rendered(scene)[..., 0].max() > 0
    hide(empty, lamp)
    assert names(scene) == []
    assert cycles.rendered(scene)[..., 0].max() == 0


def add_points(scene, lamp, points):
    """An object that shows `lamp` at its vertices by geometry nodes."""
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    entry, end, info, scatter = (tree.nodes.new(kind) for kind in (
        "NodeGroupInput", "NodeGroupOutput", "GeometryNodeObjectInfo", "GeometryNodeInstanceOnPoints"))
    info.inputs["Object"].default_value = lamp
    info.inputs["As Instance"].default_value = True
    tree.links.new(entry.outputs[0], scatter.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs["Instances"], end.inputs[0])
    thing = cycles.add_mesh(scene, points, [])
    thing.name = "Points"
    thing.modifiers.new("Scatter", "NODES").node_group = tree
    return thing


def lamp_at_rest(scene):
    """A lamp far away that is hidden itself: its copies are not."""
    lamp = add_lamp(scene, location=(0, 0, 0))
    lamp.hide_render = True
    return lamp


def test_copies_by_geometry_nodes_that_stay_are_constants(scene):
    add_glints(scene)
    points = add_points(scene, lamp_at_rest(scene), [(0, 0, 1), (0, 0, 2)])
    points.location = (3, 0, 0)
    scene.frame_set(7)
    slots = connected(scene)
    assert list(slots) == ["Point in Points", "Point in Points 2"]
    assert [slot_values(slot)[0] for slot in slots.values()] == [[3, 0, 1], [3, 0, 2]]
    assert not keys_of_light(scene)
    assert scene.frame_current == 7


def test_copies_by_geometry_nodes_that_move_have_keys_at_all_frames_and_cleared_again(scene):
    add_glints(scene)
    points = add_points(scene, lamp_at_rest(scene), [(0, 0, 1)])
    for frame, x in ((1, 0.0), (5, 8.0)):
        points.location.x = x
        points.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 5
    scene.frame_set(3, subframe=0.5)
    connected(scene)
    curves = {tuple(key.co) for key in keys_of_light(scene)}
    connected(scene)
    assert {tuple(key.co) for key in keys_of_light(scene)} == curves
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.5)
    for frame in (5, 1, 2, 4):
        scene.frame_set(frame)
        assert slot_values()[0] == pytest.approx([points.matrix_world.translation.x, 0, 1], abs=1e-5)
        assert slot_values()[1][0] == KIND_LOCAL
    bpy.data.objects.remove(points)
    connected(scene)
    scene.frame_set(2)
    assert slot_values() == [[0, 0, 0], [0, 0, 0]]


def keys_of_light(scene):
    animation = scene[HOLDER].animation_data
    return [key for curve in (animation.drivers if animation else ()) for key in curve.keyframe_points]


def test_a_copy_that_is_shown_at_some_frames_only_is_no_light_at_the_others(scene):
    add_glints(scene)
    points = add_points(scene, lamp_at_rest(scene), [(0, 0, 1)])
    modifier = points.modifiers["Scatter"]
    for frame, shown in ((1, False), (3, True)):
        modifier.show_viewport = modifier.show_render = shown
        modifier.keyframe_insert("show_viewport", frame=frame)
        modifier.keyframe_insert("show_render", frame=frame)
    scene.frame_start, scene.frame_end = 1, 4
    scene.frame_set(3)
    assert list(connected(scene)) == ["Point in Points"]
    kinds = []
    for frame in (1, 2, 3, 4):
        scene.frame_set(frame)
        kinds.append(slot_values()[1][0])
    assert kinds == [0, 0, KIND_LOCAL, KIND_LOCAL]


def test_a_moving_copy_that_no_frame_of_the_range_shows_is_where_the_present_frame_shows_it(scene):
    add_glints(scene)
    points = add_points(scene, lamp_at_rest(scene), [(0, 0, 1)])
    modifier = points.modifiers["Scatter"]
    for frame, shown in ((1, False), (9, True)):
        modifier.show_viewport = modifier.show_render = shown
        modifier.keyframe_insert("show_viewport", frame=frame)
        modifier.keyframe_insert("show_render", frame=frame)
        points.location.x = frame
        points.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 5
    scene.frame_set(9)
    assert list(connected(scene)) == ["Point in Points"]
    assert slot_values()[0] == pytest.approx([9, 0, 1])


def test_nested_instances_and_lamps_on_faces_are_found(scene):
    add_glints(scene)
    inner = add_instance(scene, fixture(scene, add_lamp(scene, location=(0, 0, 1))), "Inner", (0, 2, 0))
    add_instance(scene, fixture(scene, inner, name="Outer", offset=(1, 0, 0)), "Outer", (0, 0, 4))
    slots = connected(scene)
    assert list(slots) == ["Point in Outer"]
    assert slot_values()[0] == pytest.approx((-1, 2, 5))

    faces = cycles.add_plane(scene, 1.0)
    faces.name = "Faces"
    faces.location = (0, 0, 6)
    faces.instance_type = "FACES"
    lamp = add_lamp(scene, name="Child", location=(0, 0, 0))
    lamp.parent = faces
    hints, [(name, reason)] = scene_hints(scene)
    assert [hint.name for hint in hints] == ["Child in Faces", "Point in Outer"]
    assert name == "Child"
    assert "on its faces" in reason
    slots = connected(scene)
    assert slot_values(slots["Child in Faces"])[0] == pytest.approx((0, 0, 6))


@stress("a line of the table of stress cases", fast=[
    "prepare/test_prepared_render.py::"
    "test_another_frame_of_a_scene_with_every_kind_of_light_is_the_same_where_the_addon_is_not_installed",
])
def test_a_bulb_and_an_instanced_lamp_light_glints_as_with_blenders_nodes(stress_record):
    def build(scene, material):
        add_square(scene, material)
        add_bulb(scene, 0.06, (0.3, 1.2, 1.2), strength=1000.0)
        lamp = add_lamp(scene, location=MIDDLE, shadow_soft_size=0.06)
        add_instance(scene, fixture(scene, lamp), location=(-0.3, 0, 0))

    outcome = compare(stress_record, build, nodes=(512, 2), lobe=(16, 2))
    assert outcome.report["hints"] == ["Bulb", "Point in Empty"]
