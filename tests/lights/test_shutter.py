"""Lights that move while the shutter is open: where their hints are at each time of it, as Cycles renders them."""

import bpy
import numpy as np
import pytest
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from demo_scenes import maps
from demo_scenes.measure import luminance
from demo_scenes.truth import truth_material
from glint_addon import create_glint_material, prepare_scene
from glint_addon.lights.shutter import shutter_ways
from glint_addon.nodes import glint_lights
from glint_addon.nodes.driven import Keyed
from tests.helpers import cycles
from tests.helpers.scene_hints import scene_hints
from tests.helpers.seeds import rendered_seeds
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import MIDDLE, add_lamp, add_square
from tests.lights.test_emitters import add_bulb, add_glints
from tests.lights.test_instances import add_instance, fixture

SIZE = (12, 12)  # pixels
SPEED = 2.4  # metres a frame
SHUTTER = 0.5  # frames
HALF_WAY = SPEED * SHUTTER / 2
FRAMES = (1, 2, 3)
SURFACE = {"roughness": 0.2, "interpolation": "CLOSEST"}
# Blender keeps matrices, keys and sockets in 32-bit floats; places here are metres.
PLACE_TOLERANCE = 1e-4
# Measured at 64 spp: errors of 0.7 to 0.8 with hints at the frame become 0.17 (a mesh), 0.32 becomes 0.022 (a lamp).
GAIN = 3.0
LARGEST_Z = 5.0


def move(thing, speed=SPEED):
    """Let an object pass its place along X at frame 2, at a steady speed [m a frame]."""
    middle = thing.location.x
    for frame, place in zip(FRAMES, (-speed, 0.0, speed), strict=True):
        thing.location.x = middle + place
        thing.keyframe_insert("location", frame=frame)
    action = thing.animation_data.action
    bag = action_get_channelbag_for_slot(action, thing.animation_data.action_slot)
    for curve in bag.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def blur(scene, position="CENTER"):
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = SHUTTER
    scene.render.motion_blur_position = position
    scene.frame_set(2)


def ways(scene):
    """Ways by the name of their light."""
    hints, _ = scene_hints(scene)
    return {hint.name: way for hint, way in shutter_ways(scene, scene.view_layers[:], hints).items()}


def at_frame_2(numbers):
    """Numbers of a way, which differ at both ends of the range, where the lights begin and end to move."""
    return [number.values[1] if isinstance(number, Keyed) else number for number in numbers]


def moved_nodes():
    return [node for node in glint_lights.build().nodes if node.name.startswith(("Moved", "Shutter"))]


def flakes(build, thing):
    """A square of flakes with what `build` makes of their map, under a moving light that `thing` adds to the scene."""
    scene = cycles.empty_scene(size=SIZE)
    add_square(scene, build(maps.blender_image("Map", maps.flakes(64))))
    move(thing(scene))
    return scene


def bulb(scene):
    return add_bulb(scene, 0.05, MIDDLE, strength=600.0)


def lamp(scene):
    return add_lamp(scene, shadow_soft_size=0.05)


def truth(image):
    return truth_material("Truth", image, **SURFACE)


def glints(image):
    return create_glint_material("Glint", image, **SURFACE)


@stress("16,384 samples of Blender's nodes", fast=[
    "lights/test_shutter.py::test_a_mesh_goes_on_through_the_shutter_and_a_lamp_stands_in_its_middle",
    "lights/test_shutter.py::test_the_saved_file_renders_the_same_blurred_pixels_without_the_addon",
])
@pytest.mark.parametrize(("thing", "position"), [(bulb, "CENTER"), (bulb, "START"), (bulb, "END"), (lamp, "START")])
def test_a_light_that_moves_is_found_at_every_time_of_the_shutter(thing, position):
    scene = flakes(truth, thing)
    blur(scene, position)
    scene.cycles.shading_system = False
    nodes = luminance(rendered_seeds(scene, 16384, 2))

    scene = flakes(glints, thing)
    scene.frame_set(2)
    prepare_scene(scene)
    blur(scene, position)
    before = luminance(rendered_seeds(scene, 64, 4))
    prepare_scene(scene)
    after = luminance(rendered_seeds(scene, 64, 4))

    errors = [((pictures - nodes.mean(axis=0)) ** 2).mean() - nodes.var(axis=0, ddof=1).mean() / len(nodes)
              for pictures in (before, after)]
    assert GAIN**2 * errors[1] < errors[0]
    # The pixels' noise is independent: it tells how well the means are known.
    noise = [pictures.std(axis=0, ddof=1) / np.sqrt(len(pictures)) for pictures in (nodes, after)]
    deviation = np.sqrt(sum((each**2).mean() / each.size for each in noise))
    assert abs(after.mean() - nodes.mean()) < LARGEST_Z * deviation
    assert deviation < 0.03 * nodes.mean()


@pytest.mark.parametrize(("position", "middle"), [("CENTER", 0.0), ("START", 0.5), ("END", -0.5)])
def test_a_mesh_goes_on_through_the_shutter_and_a_lamp_stands_in_its_middle(scene, position, middle):
    add_glints(scene)
    for thing in (add_bulb(scene), add_lamp(scene)):
        move(thing)
    blur(scene, position)
    found = ways(scene)
    assert list(found) == (["Bulb", "Point"] if middle else ["Bulb"])
    assert at_frame_2(found["Bulb"].reach) == pytest.approx((HALF_WAY, 0.0, 0.0), abs=PLACE_TOLERANCE)
    for way in found.values():
        assert at_frame_2(way.shift) == pytest.approx((middle * SHUTTER * SPEED, 0.0, 0.0), abs=PLACE_TOLERANCE)
    assert "Point" not in found or found["Point"].reach == (0.0, 0.0, 0.0)


def test_a_sun_is_shifted_to_its_direction_in_the_middle_of_the_shutter(scene):
    add_glints(scene)
    sun = cycles.add_sun(scene, (0, 0, 1), angle=0.01)
    for frame in FRAMES:
        sun.rotation_euler.y = 0.4 * (frame - 2)
        sun.keyframe_insert("rotation_euler", frame=frame)
    blur(scene, "END")
    way = ways(scene)["Sun"]
    direction = np.array([[entry.values[1] for entry in (way.shift[0], way.shift[2])]]) + (0.0, 1.0)
    scene.frame_set(1, subframe=1.0 - SHUTTER / 2)
    assert direction[0] == pytest.approx(np.array(sun.matrix_world)[(0, 2), 2], abs=PLACE_TOLERANCE)


def constrained(scene, thing):
    leader = bpy.data.objects.new("Leader", None)
    scene.collection.objects.link(leader)
    move(leader)
    thing.constraints.new("COPY_LOCATION").target = leader
    thing.constraints[0].use_offset = True
    return "Bulb"


def driven(scene, thing):
    leader = bpy.data.objects.new("Leader", None)
    scene.collection.objects.link(leader)
    move(leader)
    driver = thing.driver_add("location", 0).driver
    variable = driver.variables.new()
    variable.name, variable.targets[0].id, variable.targets[0].data_path = "x", leader, "location.x"
    driver.expression = "x"
    return "Bulb"


def parented(scene, thing):
    leader = bpy.data.objects.new("Leader", None)
    scene.collection.objects.link(leader)
    move(leader)
    thing.parent = leader
    return "Bulb"


def in_a_moving_instance(scene, thing):
    move(add_instance(scene, fixture(scene, thing)))
    return "Bulb in Empty"


def in_an_instance_of_an_instance(scene, thing):
    inner = add_instance(scene, fixture(scene, thing))
    outer = add_instance(scene, fixture(scene, inner, name="Outer"), name="Outside")
    move(outer)
    return next(hint.name for hint in scene_hints(scene)[0])


@pytest.mark.parametrize("carry", [constrained, driven, parented, in_a_moving_instance, in_an_instance_of_an_instance])
def test_what_carries_a_light_moves_it_through_the_shutter(scene, carry):
    add_glints(scene)
    thing = add_bulb(scene)
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    name = carry(scene, thing)
    blur(scene)
    scene.view_layers[0].update()
    (way,) = ways(scene).values()
    assert at_frame_2(way.reach) == pytest.approx((HALF_WAY, 0.0, 0.0), abs=PLACE_TOLERANCE)
    assert name in [hint.name for hint in scene_hints(scene)[0]]
    assert (scene.frame_current, scene.frame_subframe) == (2, 0.0)


def no_blur(scene, thing):
    scene.render.use_motion_blur = False


def no_blur_of_the_object(scene, thing):
    thing.cycles.use_motion_blur = False


def no_motion(scene, thing):
    thing.animation_data_clear()


@pytest.mark.parametrize("stop", [no_blur, no_blur_of_the_object, no_motion])
def test_what_does_not_move_in_the_shutter_has_no_nodes_for_it(scene, stop):
    add_square(scene, glints(maps.blender_image("Map", maps.flakes(64))))
    thing = bulb(scene)
    move(thing)
    blur(scene)
    plain = [node.name for node in glint_lights.build().nodes]
    prepare_scene(scene)
    assert len(moved_nodes()) == 2
    links = sorted(str(link.as_pointer()) for link in glint_lights.build().links)
    prepare_scene(scene)
    assert sorted(str(link.as_pointer()) for link in glint_lights.build().links) == links
    stop(scene, thing)
    prepare_scene(scene)
    group = glint_lights.build()
    assert [node.name for node in group.nodes] == plain
    assert all(link.from_socket.node.name == link.to_socket.name for link in group.links)


def test_a_light_that_speeds_up_has_keys_for_it(scene):
    add_glints(scene)
    thing = add_bulb(scene)
    move(thing, 0.0)
    thing.location.x = 3.0
    thing.keyframe_insert("location", frame=9)
    blur(scene)
    scene.frame_end = 9
    x = ways(scene)["Bulb"].reach[0]
    assert x.frames == tuple(range(1, 10))
    assert x.values[:2] == (0.0, 0.0)
    assert x.values[5] > 0.05


def test_the_saved_file_renders_the_same_blurred_pixels_without_the_addon(farm, tmp_path):
    scene = flakes(glints, bulb)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    blur(scene)
    prepare_scene(scene)
    assert len(moved_nodes()) == 2
    scene.cycles.samples = 4
    picture = cycles.rendered(scene)[..., :3]
    np.testing.assert_array_equal(farm.rendered(tmp_path, 2), picture)
    assert picture.max() > 0
