"""Drivers of the light hints against the lights themselves, over frames, parents, files and processes."""

import json
import math
import random
import subprocess
import sys

import bpy
import numpy as np
import pytest
from mathutils import Vector

from glint_addon.errors import SceneError
from glint_addon.lights.drivers import connect_hints
from glint_addon.lights.hint import Hint
from glint_addon.lights.kinds import kind_of
from glint_addon.lights.shutter import shutter_ways
from glint_addon.nodes import glint_lights
from glint_addon.nodes.glint_lights import HINT_COUNT, KIND_LOCAL, KIND_SUN
from glint_addon.nodes.scene_lights import HOLDER, PARTS
from tests.helpers import cycles
from tests.helpers.scene_hints import scene_hints

# Blender keeps matrices, angles and sockets in 32-bit floats; 2.4e-6 was the worst of 20,000 random rotations.
DIRECTION_TOLERANCE = 5e-6
SIZE_TOLERANCE = 1e-6
SOCKETS = ("X", "Y", "Z")


@pytest.fixture
def stage(scene):
    """An empty scene with a plane whose material reads the group."""
    add_reader(scene)
    return scene


def add_reader(scene):
    material, colour = cycles.emission_material()
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = glint_lights.build()
    material.node_tree.links.new(node.outputs["Light 1"], colour)
    return cycles.add_plane(scene, 2.0, material=material)


def add_lamp(scene, name, kind="POINT", location=(0, 0, 5), parent=None, **settings):
    light = bpy.data.lights.new(name, kind)
    for key, value in settings.items():
        setattr(light, key, value)
    lamp = bpy.data.objects.new(name, light)
    lamp.location = location
    lamp.parent = parent
    scene.collection.objects.link(lamp)
    return lamp


def connected(scene):
    """Find and connect the scene's hints; returns the group."""
    group = glint_lights.build()
    connect_hints(group, scene, scene_hints(scene)[0])
    return group


def slot_values(group, slot):
    """Evaluated Light and Shape of `slot`."""
    nodes = group.evaluated_get(bpy.context.evaluated_depsgraph_get()).nodes
    vectors = [nodes[f"{name} {slot}"] for name in ("Light", "Shape")]
    return [[node.inputs[axis].default_value for axis in SOCKETS] for node in vectors]


def axis_of(group, slot=1):
    """Evaluated Axis of `slot`."""
    node = group.evaluated_get(bpy.context.evaluated_depsgraph_get()).nodes[f"Axis {slot}"]
    return [node.inputs[axis].default_value for axis in SOCKETS]


def towards(lamp):
    return lamp.matrix_world.col[2].to_3d().normalized()


def light_drivers(scene):
    """The drivers of the scene's lights."""
    return scene[HOLDER].animation_data.drivers


def driver_records(scene):
    """Everything a driver of the scene's lights holds, and where."""
    return [
        (curve.data_path, curve.array_index, curve.driver.type, curve.driver.expression, len(curve.keyframe_points))
        + tuple(
            (entry.name, entry.type, target.id and target.id.name, target.data_path, target.transform_type)
            for entry in curve.driver.variables
            for target in entry.targets
        )
        for curve in light_drivers(scene)
    ]


def test_sun_direction_is_the_world_z_axis_for_random_rotations_parents_shear_and_mirroring(stage):
    pick = random.Random(1)
    suns = []
    for number in range(HINT_COUNT):
        parent = bpy.data.objects.new("Parent", None)
        stage.collection.objects.link(parent)
        suns.append(add_lamp(stage, f"Sun {number}", "SUN", parent=parent))
    group = connected(stage)
    for _ in range(100):
        for sun in suns:
            sun.rotation_mode = pick.choice(["XYZ", "ZYX", "YZX", "QUATERNION", "AXIS_ANGLE"])
            sun.rotation_euler = [pick.uniform(-7, 7) for _ in range(3)]
            sun.rotation_quaternion = [pick.uniform(-1, 1) for _ in range(4)]
            sun.rotation_axis_angle = [pick.uniform(-7, 7) for _ in range(4)]
            sun.scale = [pick.uniform(-3, 3) for _ in range(3)]
            sun.parent.rotation_euler = [pick.uniform(-7, 7) for _ in range(3)]
            sun.parent.scale = [pick.uniform(-3, 3) for _ in range(3)]
            sun.parent.location = [pick.uniform(-100, 100) for _ in range(3)]
        bpy.context.view_layer.update()
        for slot, sun in enumerate(suns, 1):
            assert (Vector(slot_values(group, slot)[0]) - towards(sun)).length < DIRECTION_TOLERANCE


def test_sun_direction_is_exact_where_euler_angles_lock(stage):
    sun = add_lamp(stage, "Sun", "SUN")
    group = connected(stage)
    for x in range(4):
        for y in range(4):
            for z in range(4):
                sun.rotation_euler = (x * math.pi / 2, y * math.pi / 2, z * math.pi / 2)
                bpy.context.view_layer.update()
                assert (Vector(slot_values(group, 1)[0]) - towards(sun)).length < DIRECTION_TOLERANCE


def test_constrained_lights_are_followed(stage):
    target = bpy.data.objects.new("Target", None)
    target.location = (3, -4, 1)
    stage.collection.objects.link(target)
    sun = add_lamp(stage, "B sun", "SUN", location=(0, 0, 9))
    track = sun.constraints.new("TRACK_TO")
    track.target, track.track_axis, track.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"
    lamp = add_lamp(stage, "A lamp")
    lamp.constraints.new("COPY_LOCATION").target = target
    group = connected(stage)
    assert slot_values(group, 1)[0] == pytest.approx((3, -4, 1))
    expected = (Vector((0, 0, 9)) - target.location).normalized()
    assert (Vector(slot_values(group, 2)[0]) - expected).length < DIRECTION_TOLERANCE


@pytest.mark.parametrize(
    ("kind", "settings", "expected"),
    [
        ("POINT", {"shadow_soft_size": 0.3}, 0.3),
        ("POINT", {"shadow_soft_size": 0.0}, 0.0),
        ("SPOT", {"shadow_soft_size": 0.7}, 0.7),
        ("AREA", {"shape": "SQUARE", "size": 0.5, "size_y": 9.0}, 0.25 * math.hypot(2, 3)),
        ("AREA", {"shape": "RECTANGLE", "size": 0.5, "size_y": 2.0}, 0.5 * math.hypot(1, 6)),
        ("AREA", {"shape": "DISK", "size": 0.5, "size_y": 9.0}, 0.75),
        ("AREA", {"shape": "ELLIPSE", "size": 4.0, "size_y": 2.0}, 4.0),
        ("SUN", {"angle": 0.04}, 0.02),
    ],
)
def test_sizes_of_scaled_lights_are_those_of_cycles(stage, kind, settings, expected):
    lamp = add_lamp(stage, "Lamp", kind, **settings)
    lamp.scale = (2, -3, 5)
    group = connected(stage)
    place, shape = slot_values(group, 1)
    assert shape[:2] == pytest.approx([KIND_SUN if kind == "SUN" else KIND_LOCAL, expected], rel=SIZE_TOLERANCE)
    assert kind_of(lamp).size(lamp) == pytest.approx(expected, rel=SIZE_TOLERANCE)
    assert place == pytest.approx((0, 0, 1) if kind == "SUN" else (0, 0, 5))


@pytest.mark.parametrize(("kind", "shape"), [("POINT", None), ("SPOT", None), ("AREA", "DISK"), ("AREA", "RECTANGLE")])
def test_the_radius_is_what_a_camera_sees_of_the_scaled_light(kind, shape):
    width, pixels = 8.0, 64
    scene = cycles.empty_scene(size=(pixels, pixels), spp=4, osl=False)
    cycles.box_filter(scene, 0.01)
    cycles.add_camera(scene, (0, 0, 5), width=width)
    settings = {"shape": shape, "size": 1.0, "size_y": 2.0} if shape else {"shadow_soft_size": 1.0}
    lamp = add_lamp(scene, "Lamp", kind, location=(0, 0, 0), energy=1000, **settings)
    lamp.visible_camera = True
    lamp.rotation_euler = (math.pi, 0, 0)
    lamp.scale = (3, 2, 1)
    scene.view_layers[0].update()
    seen = cycles.rendered(scene)[..., 0] > 0
    pixel = width / pixels
    rows, columns = np.nonzero(seen)
    centres = (np.stack([columns, rows]) + 0.5) * pixel - width / 2
    furthest = np.hypot(*centres).max()
    # The furthest lit pixel centre lies within a pixel's diagonal of the edge.
    assert kind_of(lamp).size(lamp) - 1.5 * pixel < furthest < kind_of(lamp).size(lamp) + 0.1 * pixel


@pytest.mark.parametrize(
    ("kind", "settings", "cone"),
    [
        ("POINT", {}, 0.0),
        ("SUN", {}, 0.0),
        ("AREA", {}, math.pi / 2),
        ("AREA", {"spread": 0.6}, 0.3),
        ("SPOT", {"spot_size": 0.6}, math.atan(math.tan(0.3) * 3 / 5)),
        ("SPOT", {"spot_size": math.pi}, math.atan(math.tan(1.57) * 3 / 5)),
    ],
)
def test_the_cone_in_which_a_light_shines_and_its_axis_follow_the_light(stage, kind, settings, cone):
    lamp = add_lamp(stage, "Lamp", kind, **settings)
    lamp.scale, lamp.rotation_euler = (2, -3, 5), (0.3, 0.4, 0.5)
    group = connected(stage)
    assert slot_values(group, 1)[1][2] == pytest.approx(cone, rel=SIZE_TOLERANCE)
    axis = Vector(axis_of(group))
    assert (axis - towards(lamp)).length < DIRECTION_TOLERANCE if cone else axis.length == 0.0
    lamp.rotation_euler = (2.0, 1.0, 0.0)
    bpy.context.view_layer.update()
    assert (Vector(axis_of(group)) - towards(lamp)).length < DIRECTION_TOLERANCE or not cone


def test_an_animated_cone_is_followed(stage):
    spot = add_lamp(stage, "Spot", "SPOT", spot_size=0.4)
    spot.data.keyframe_insert("spot_size", frame=1)
    spot.data.spot_size = 1.2
    spot.data.keyframe_insert("spot_size", frame=2)
    group = connected(stage)
    for frame, half in ((1, 0.2), (2, 0.6)):
        stage.frame_set(frame)
        assert slot_values(group, 1)[1][2] == pytest.approx(half, rel=SIZE_TOLERANCE)


@pytest.mark.parametrize(("position", "followed"), [("CENTER", True), ("START", False), ("END", False)])
@pytest.mark.parametrize("channel", ["location", "rotation_euler"])
def test_no_cone_is_known_of_a_lamp_that_the_middle_of_the_shutter_shows_elsewhere(stage, position, followed, channel):
    spot = add_lamp(stage, "Spot", "SPOT", spot_size=0.4)
    for frame, value in ((1, 0.0), (2, 1.0)):
        setattr(spot, channel, (value, 0.0, 5.0))
        spot.keyframe_insert(channel, frame=frame)
    stage.frame_start, stage.frame_end = 1, 2
    stage.render.use_motion_blur, stage.render.motion_blur_position = True, position
    hints, _ = scene_hints(stage)
    group = glint_lights.build()
    connect_hints(group, stage, hints, shutter_ways(stage, stage.view_layers[:], hints))
    assert bool(slot_values(group, 1)[1][2]) == any(axis_of(group)) == followed


def test_keyed_lights_are_followed_through_the_frames(stage):
    lamp = add_lamp(stage, "Lamp")
    sun = add_lamp(stage, "Sun", "SUN")
    for frame in (1, 20):
        lamp.location = (frame, -frame, 3)
        lamp.data.shadow_soft_size = frame / 10
        sun.rotation_euler = (frame / 10, frame / 30, 0)
        sun.data.angle = frame / 100
        for owner, path in ((lamp, "location"), (sun, "rotation_euler"), (sun.data, "angle")):
            owner.keyframe_insert(path, frame=frame)
        lamp.data.keyframe_insert("shadow_soft_size", frame=frame)
    group = connected(stage)
    seen = set()
    for frame in (1, 7, 13, 20):
        stage.frame_set(frame)
        place, shape = slot_values(group, 1)
        assert place == pytest.approx(lamp.matrix_world.translation, abs=1e-6)
        assert shape == pytest.approx([KIND_LOCAL, lamp.data.shadow_soft_size, 0])
        direction, shape = slot_values(group, 2)
        assert (Vector(direction) - towards(sun)).length < DIRECTION_TOLERANCE
        assert shape == pytest.approx([KIND_SUN, sun.data.angle / 2, 0])
        seen.add(tuple(place))
    assert len(seen) == 4


def test_a_light_switched_off_by_animation_is_no_light_while_it_is_off(stage):
    lamp = add_lamp(stage, "Lamp", energy=0)
    for frame, energy, hidden in ((1, 0, False), (2, 5, False), (3, 5, True)):
        lamp.data.energy, lamp.hide_render = energy, hidden
        lamp.data.keyframe_insert("energy", frame=frame)
        lamp.keyframe_insert("hide_render", frame=frame)
    stage.frame_set(1)
    group = connected(stage)
    kinds = []
    for frame in (1, 2, 3):
        stage.frame_set(frame)
        kinds.append(slot_values(group, 1)[1][0])
    assert kinds == [0, KIND_LOCAL, 0]


@pytest.mark.parametrize("kind", ["POINT", "SUN", "AREA"])
def test_a_deleted_light_is_no_light_before_the_scene_is_prepared_again(stage, kind, tmp_path):
    lamp = add_lamp(stage, "Lamp", kind)
    group = connected(stage)
    assert slot_values(group, 1)[1][0] != 0
    bpy.data.objects.remove(lamp)
    assert slot_values(group, 1)[1][0] == 0
    blend = str(tmp_path / "deleted.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.open_mainfile(filepath=blend, use_scripts=False)
    assert slot_values(glint_lights.build(), 1)[1][0] == 0


@pytest.mark.parametrize("how", ["hide_viewport", "hide_set", "collection"])
def test_a_light_hidden_in_the_viewport_alone_is_followed(stage, how):
    lamp = add_lamp(stage, "Lamp")
    if how == "hide_viewport":
        lamp.hide_viewport = True
    elif how == "hide_set":
        lamp.hide_set(True)
    else:
        collection = bpy.data.collections.new("Collection")
        stage.collection.children.link(collection)
        collection.objects.link(lamp)
        stage.collection.objects.unlink(lamp)
        collection.hide_viewport = True
    group = connected(stage)
    lamp.location = (4, 5, 6)
    assert slot_values(group, 1)[0] == pytest.approx((4, 5, 6))


def test_a_light_whose_data_is_exchanged_keeps_its_size_current(stage):
    lamp = add_lamp(stage, "Lamp", shadow_soft_size=0.5)
    group = connected(stage)
    lamp.data = bpy.data.lights.new("Other", "POINT")
    lamp.data.shadow_soft_size = 0.125
    assert slot_values(group, 1)[1] == pytest.approx([KIND_LOCAL, 0.125, 0])


@pytest.mark.parametrize("count", [0, 1, 8, 9, 100])
def test_any_number_of_lights_fills_at_most_eight_slots(stage, count):
    for number in range(count):
        add_lamp(stage, f"Lamp {number:03}", location=(number, 0, 1))
    hints, skipped = scene_hints(stage)
    group = connected(stage)
    used = [slot for slot in range(1, HINT_COUNT + 1) if slot_values(group, slot)[1][0] != 0]
    assert used == list(range(1, min(count, 8) + 1))
    assert len(hints) + len(skipped) == count
    for slot, hint in enumerate(hints, 1):
        assert slot_values(group, slot)[0] == pytest.approx(hint.object.location)


def test_connecting_twice_changes_nothing(stage):
    add_lamp(stage, "Lamp")
    add_lamp(stage, "Panel", "AREA", shape="ELLIPSE")
    add_lamp(stage, "Sun", "SUN")
    connected(stage)
    before = driver_records(stage)
    addresses = [curve.as_pointer() for curve in light_drivers(stage)]
    connected(stage)
    assert driver_records(stage) == before
    assert [curve.as_pointer() for curve in light_drivers(stage)] == addresses


def test_slots_of_removed_lights_are_cleared_and_later_lights_move_up(stage):
    first = add_lamp(stage, "A")
    second = add_lamp(stage, "B", "SUN")
    group = connected(stage)
    bpy.data.objects.remove(first)
    connected(stage)
    assert slot_values(group, 1)[0] == pytest.approx(towards(second))
    assert slot_values(group, 1)[1] == pytest.approx([KIND_SUN, second.data.angle / 2, 0])
    assert slot_values(group, 2) == [[0, 0, 0], [0, 0, 0]]
    assert [index for _, index, *_ in driver_records(stage) if index >= PARTS] == []


def test_without_lights_nothing_is_driven_by_objects(stage):
    add_lamp(stage, "Lamp", location=(1, 2, 3))
    group = connected(stage)
    for _ in range(2):
        connect_hints(group, stage, [])
        assert list(light_drivers(stage)) == []
        assert slot_values(group, 1) == [[0, 0, 0], [0, 0, 0]]


def test_every_expression_is_evaluated_without_python(stage):
    for shape in ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"):
        add_lamp(stage, shape, "AREA", shape=shape)
    for kind in ("POINT", "SPOT", "SUN"):
        add_lamp(stage, kind, kind)
    group = connected(stage)
    assert len(light_drivers(stage)) == 7 * 5 + 5 * 4, "of areas and spots the cone and its axis too"
    for curve in [*light_drivers(stage), *group.animation_data.drivers]:
        assert curve.driver.is_simple_expression, curve.driver.expression
        assert curve.driver.is_valid


def test_changing_the_shape_of_an_area_light_changes_its_driver_when_connected_again(stage):
    lamp = add_lamp(stage, "Panel", "AREA", shape="SQUARE", size=2.0)
    group = connected(stage)
    assert slot_values(group, 1)[1][1] == pytest.approx(math.sqrt(2))
    lamp.data.shape = "DISK"
    connected(stage)
    assert slot_values(group, 1)[1][1] == pytest.approx(1.0)


def test_too_many_hints_or_a_light_of_another_scene_are_refused(stage):
    lamp = add_lamp(stage, "Lamp")
    hint = Hint("Lamp", KIND_LOCAL, 1.0, 0.1, lamp)
    with pytest.raises(SceneError, match="do not fit"):
        connect_hints(glint_lights.build(), stage, [hint] * (HINT_COUNT + 1))
    other = bpy.data.scenes.new("Other")
    with pytest.raises(SceneError, match='not in scene "Other"'):
        connect_hints(glint_lights.build(), other, [hint])


def test_a_group_without_its_nodes_is_refused(stage):
    group = glint_lights.build()
    group.nodes.remove(group.nodes["Shape 3"])
    with pytest.raises(SceneError, match='lost its node "Shape 3"'):
        connect_hints(group, stage, [])
    assert HOLDER not in stage


def test_lights_linked_from_a_library_are_followed(stage, tmp_path):
    lamp = add_lamp(stage, "Far lamp", "AREA", location=(7, 8, 9), shape="DISK", size=3.0)
    sun = add_lamp(stage, "Far sun", "SUN")
    sun.rotation_euler = (0.3, 0.4, 0)
    bpy.context.view_layer.update()
    direction = towards(sun)
    library = str(tmp_path / "lights.blend")
    bpy.data.libraries.write(library, {lamp, sun})
    bpy.data.objects.remove(lamp)
    bpy.data.objects.remove(sun)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["Far lamp", "Far sun"]
    for thing in wanted.objects:
        stage.collection.objects.link(thing)
    group = connected(stage)
    assert slot_values(group, 1) == [pytest.approx((7, 8, 9)), pytest.approx([KIND_LOCAL, 1.5, math.pi / 2])]
    assert (Vector(slot_values(group, 2)[0]) - direction).length < DIRECTION_TOLERANCE


FRESH_PROCESS = """
import json, sys
import bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1], use_scripts=False)
scene = bpy.context.scene
result = {}
for frame in json.loads(sys.argv[2]):
    scene.frame_set(frame)
    nodes = bpy.data.node_groups["Glint Lights"].evaluated_get(bpy.context.evaluated_depsgraph_get()).nodes
    result[frame] = {
        name: [nodes[name].inputs[axis].default_value for axis in "XYZ"]
        for name in ("Light 1", "Shape 1", "Light 2", "Shape 2", "Light 3")
    }
    result[frame]["Samples"] = nodes["Samples"].outputs[0].default_value
assert not bpy.app.autoexec_fail, bpy.app.autoexec_fail_message
assert not [name for name in sys.modules if "glint" in name]
bpy.ops.render.render(animation=True)
json.dump(result, open(sys.argv[3], "w"))
"""


def test_a_saved_file_gives_the_same_numbers_and_pictures_without_the_add_on(tmp_path):
    scene = cycles.empty_scene(size=(4, 4), spp=3, osl=False)
    add_reader(scene)
    cycles.add_camera(scene, (0, 0, 3), width=1.0)
    parent = bpy.data.objects.new("Parent", None)
    scene.collection.objects.link(parent)
    lamp = add_lamp(scene, "Lamp", location=(1, 2, 9), parent=parent)
    sun = add_lamp(scene, "Sun", "SUN", parent=parent)
    for frame in (1, 3):
        parent.location = (frame, 2 * frame, 0)
        parent.rotation_euler = (frame / 10, frame / 5, frame)
        parent.keyframe_insert("location", frame=frame)
        parent.keyframe_insert("rotation_euler", frame=frame)
        scene.cycles.samples = frame
        scene.cycles.keyframe_insert("samples", frame=frame)
    connected(scene)
    scene.frame_start, scene.frame_end = 1, 3
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    scene.render.filepath = str(tmp_path / "frame_####")
    blend = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend, copy=True)

    frames = [3, 1, 2]
    answer = tmp_path / "answer.json"
    command = [sys.executable, "-c", FRESH_PROCESS, blend, json.dumps(frames), str(answer)]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    values = json.loads(answer.read_text())
    for frame in frames:
        scene.frame_set(frame)
        expected = lamp.matrix_world.translation
        found = values[str(frame)]
        assert found["Light 1"] == pytest.approx(expected, abs=1e-6)
        assert found["Shape 1"] == pytest.approx([KIND_LOCAL, lamp.data.shadow_soft_size, 0])
        assert (Vector(found["Light 2"]) - towards(sun)).length < DIRECTION_TOLERANCE
        assert found["Shape 2"] == pytest.approx([KIND_SUN, sun.data.angle / 2, 0])
        assert found["Light 3"] == [0, 0, 0]
        assert found["Samples"] == scene.cycles.samples == frame
        picture = cycles.read_image(tmp_path / f"frame_{frame:04}.exr")
        assert picture[2, 2, :3] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("persistent", [False, True])
def test_cycles_sees_a_light_move_from_frame_to_frame(persistent):
    scene = cycles.empty_scene(size=(4, 4), osl=False)
    scene.render.use_persistent_data = persistent
    add_reader(scene)
    cycles.add_camera(scene, (0, 0, 3), width=1.0)
    lamp = add_lamp(scene, "Lamp")
    for frame in (1, 3):
        lamp.location = (frame, 2 * frame, 3 * frame)
        lamp.keyframe_insert("location", frame=frame)
    connected(scene)
    for frame in (1, 2, 3, 1):
        scene.frame_set(frame)
        assert cycles.rendered(scene)[2, 2, :3] == pytest.approx(lamp.matrix_world.translation, rel=1e-5)
