"""What no camera sees is not baked; whatever may be seen, at any frame and in any way, is."""

import math
from pathlib import Path

import bpy
import numpy as np
import pytest

import glint_addon
from glint_addon import create_glint_material, prepare_scene
from glint_addon.materials.find import glint_groups
from glint_addon.paths import stored_path
from glint_addon.seen.visibility import unseen_objects
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

AWAY = (0, 0, 10)  # behind the camera, which looks down from z = 3
PLANE = 0.5  # metres
LENS_STEPS = 12  # points tried along the lens's edge


@pytest.fixture
def plane(scene):
    """A square behind the camera."""
    cycles.add_camera(scene, (0, 0, 3))
    plane = cycles.add_plane(scene)
    plane.location = AWAY
    return plane


def is_unseen(scene, thing) -> bool:
    bpy.context.view_layer.update()
    return thing in unseen_objects(scene, [thing])




def test_what_is_behind_the_camera_is_unseen_and_what_is_before_it_is_seen(scene, plane):
    assert is_unseen(scene, plane)
    plane.location = (0, 0, 0)
    assert not is_unseen(scene, plane)


@pytest.mark.parametrize("width", [None, 2.0], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("axis", [0, 1])
def test_what_is_beside_the_view_is_unseen_from_a_quarter_outside_it(scene, width, sign, axis):
    cycles.add_camera(scene, (0, 0, 3), width=width)
    # Half of the view at the plane's depth, 0.7 radians wide or 2 metres.
    half = 1.0 if width else 3 * math.tan(0.35)
    plane = cycles.add_plane(scene, 0.02)
    for place, unseen in ((0.98 * half, False), (1.2 * half, False), (1.3 * half, True)):
        plane.location[axis] = sign * place
        assert is_unseen(scene, plane) == unseen, place


def test_a_plane_that_a_shifted_view_shows_is_seen(scene, plane):
    plane.location = (3.0, 0, 0)
    assert is_unseen(scene, plane)
    scene.camera.data.shift_x = 1.0
    assert not is_unseen(scene, plane)


def test_a_large_object_around_the_camera_is_seen_though_all_its_corners_are_outside(scene):
    cycles.add_camera(scene, (0, 0, 3))
    assert not is_unseen(scene, cycles.add_sphere(scene, 50.0))


@pytest.mark.parametrize("seed", range(4))
def test_no_ray_of_a_lens_out_of_focus_misses_what_is_called_unseen(seed):
    """Boxes at random, and rays from all over the lens through all over the frame."""
    rng = np.random.default_rng(seed)
    scene = cycles.empty_scene(size=(32, 20))
    camera = cycles.add_camera(scene, (0, 0, 0), (0, 0, -1), width=None if seed % 2 else 2.0)
    dof = camera.data.dof
    # A lens of about half a metre's radius.
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 2.0, 0.05 if seed % 2 else 1.0
    reach = 12 if seed % 2 else 4
    planes = [cycles.add_plane(scene, PLANE) for _ in range(60)]
    for plane in planes:
        plane.location = rng.uniform((-reach, -reach, -12), (reach, reach, 2))
        plane.rotation_euler = rng.uniform(-3, 3, 3)
    bpy.context.view_layer.update()
    unseen = unseen_objects(scene, planes)
    assert 5 < len(unseen) < 55, "some of each"

    # Through the focus plane's frame from the lens's edge and middle.
    frame = np.array([corner[:] for corner in camera.data.view_frame(scene=scene)])
    perspective = camera.data.type == "PERSP"
    frame *= 2.0 / -frame[0, 2] if perspective else 1.0
    low, high = frame.min(axis=0)[:2], frame.max(axis=0)[:2]
    radius = (camera.data.lens * 1e-3 if perspective else 1.0) / (2 * dof.aperture_fstop)
    angles = np.arange(LENS_STEPS) * 2 * math.pi / LENS_STEPS
    lens = [(0.0, 0.0), *(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))]
    grid = low + np.stack(np.meshgrid(*2 * [np.linspace(0, 1, 9)]), axis=-1).reshape(-1, 2) * (high - low)
    for plane in unseen:
        to_plane = plane.matrix_world.inverted()
        for lens_x, lens_y in lens:
            for x, y in grid:
                start = (lens_x + (0 if perspective else x), lens_y + (0 if perspective else y), 0.0)
                hit = crossing(to_plane, start, (x, y, -2.0))
                assert hit is None or max(abs(hit)) > PLANE / 2, plane.name


def crossing(to_plane, start, through):
    """Where (x, y) the ray from `start` through a point meets the plane z = 0 of an object, or None."""
    from mathutils import Vector

    a = np.array(to_plane @ Vector(start))
    b = np.array(to_plane @ Vector(through))
    t = a[2] / (a[2] - b[2])
    return None if t < 0 else (a + t * (b - a))[:2]


def as_panorama(scene, plane):
    scene.camera.data.type = "PANO"


def without_camera(scene, plane):
    bpy.data.objects.remove(scene.camera)


def with_another_camera(scene, plane):
    camera = scene.camera
    cycles.add_camera(scene, (0, 0, 7), AWAY)
    scene.camera = camera


def with_a_moving_camera(scene, plane):
    scene.camera.keyframe_insert("rotation_euler", frame=1)


def with_a_moving_parent_of_the_camera(scene, plane):
    scene.camera.parent = cycles.add_plane(scene)
    scene.camera.parent.driver_add("location", 0)


def with_a_zoom(scene, plane):
    scene.camera.data.keyframe_insert("lens", frame=1)


def focused_on_an_object(scene, plane):
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_object = plane


def with_stereo(scene, plane):
    scene.render.use_multiview = True


def moving(scene, plane):
    plane.keyframe_insert("location", frame=1)


def constrained(scene, plane):
    plane.constraints.new("COPY_LOCATION")


def with_an_array(scene, plane):
    plane.modifiers.new("Array", "ARRAY")


def with_keyed_shapes(scene, plane):
    plane.shape_key_add(name="Basis")
    plane.shape_key_add(name="Up").keyframe_insert("value", frame=1)


def displaced(scene, plane):
    material = bpy.data.materials.new("Displaced")
    material.displacement_method = "DISPLACEMENT"
    plane.data.materials.append(material)


def instanced_by_an_empty(scene, plane):
    kit = bpy.data.collections.new("Kit")
    kit.objects.link(plane)
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", kit
    scene.collection.objects.link(empty)


def instanced_by_nodes(scene, plane):
    tree = bpy.data.node_groups.new("Copies", "GeometryNodeTree")
    tree.nodes.new("GeometryNodeObjectInfo").inputs["Object"].default_value = plane
    outer = bpy.data.node_groups.new("Outer", "GeometryNodeTree")
    outer.nodes.new("GeometryNodeGroup").node_tree = tree
    cycles.add_plane(scene).modifiers.new("Nodes", "NODES").node_group = outer


DOUBTS = [as_panorama, without_camera, with_another_camera, with_a_moving_camera, with_a_moving_parent_of_the_camera,
          with_a_zoom, focused_on_an_object, with_stereo, moving, constrained, with_an_array, with_keyed_shapes,
          displaced, instanced_by_an_empty, instanced_by_nodes]


@pytest.mark.parametrize("change", DOUBTS, ids=lambda change: change.__name__)
def test_in_doubt_an_object_is_seen(scene, plane, change):
    assert is_unseen(scene, plane)
    change(scene, plane)
    assert not is_unseen(scene, plane)


@pytest.mark.parametrize("modifier", ["SUBSURF", "BEVEL"])
def test_a_modifier_that_keeps_the_box_leaves_no_doubt(scene, plane, modifier):
    plane.modifiers.new("Modifier", modifier)
    assert is_unseen(scene, plane)


# --- prepare ---


@pytest.fixture
def glints(scene, plane, tmp_path):
    """The square, now with glints, and a sun, in a saved file."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    plane.data.materials.append(create_glint_material("Sparkle", write_flake_map(tmp_path / "flakes.png")))
    return plane


def test_what_no_camera_sees_is_neither_read_nor_baked_and_named_in_the_report(scene, glints, tmp_path):
    report = prepare_scene(scene)
    assert report["unseen"] == ["Sparkle"] and not report["baked"] and not report["reused"]
    assert report["counts"] == dict.fromkeys(report["counts"], 0)
    assert not (tmp_path / "glint_tables").exists() and report["hints"] == ["Sun"]


def test_on_demand_what_no_camera_sees_is_baked_too(scene, glints):
    report = prepare_scene(scene, bake_unseen=True)
    assert report["baked"] and report["unseen"] == []


def test_the_scenes_setting_decides_where_the_caller_does_not(scene, glints):
    glint_addon.register()
    try:
        scene.glint.bake_unseen = True
        assert prepare_scene(scene, bake_unseen=False)["unseen"] == ["Sparkle"]
        assert prepare_scene(scene)["baked"]
    finally:
        glint_addon.unregister()


def test_a_table_that_is_there_stays_in_use_when_the_object_leaves_the_view(scene, glints):
    glints.location = (0, 0, 0)
    (table,) = prepare_scene(scene)["baked"]
    glints.location = AWAY
    report = prepare_scene(scene)
    assert report["reused"] == [table] and not report["baked"] and not report["unseen"]
    assert glint_groups(glints.material_slots[0].material)[0]["glint_table"] == stored_path(Path(table))


def test_a_material_is_baked_if_one_of_its_objects_is_seen(scene, glints):
    cycles.add_plane(scene, material=glints.material_slots[0].material)
    report = prepare_scene(scene)
    assert report["baked"] and report["unseen"] == []


def test_a_material_in_a_hidden_or_excluded_collection_is_not_baked(scene, glints):
    glints.location = (0, 0, 0)
    attic = bpy.data.collections.new("Attic")
    scene.collection.children.link(attic)
    attic.objects.link(glints)
    scene.collection.objects.unlink(glints)
    attic.hide_render = True
    assert not prepare_scene(scene)["baked"]
    attic.hide_render = False
    scene.view_layers[0].layer_collection.children["Attic"].exclude = True
    assert not prepare_scene(scene)["baked"]
    scene.view_layers[0].layer_collection.children["Attic"].exclude = False
    assert len(prepare_scene(scene)["baked"]) == 1


def test_an_object_that_animation_shows_later_is_baked(scene, glints):
    glints.location = (0, 0, 0)
    glints.hide_render = True
    assert not prepare_scene(scene)["baked"]
    glints.keyframe_insert("hide_render", frame=1)
    assert prepare_scene(scene)["baked"]
