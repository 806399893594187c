"""Pictures of prepared scenes: the same without the add-on; without a whole table those of Blender's own nodes."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material, prepare_scene
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import glint_bsdf
from glint_addon.paths import disk_path
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.stress_marks import thinned
from tests.helpers.stress_stage import add_lamp
from tests.lights.test_emitters import add_bulb, slot_values
from tests.lights.test_instances import add_instance, fixture
from tests.lights.test_world_hints import SIZE as WORLD_SIZE
from tests.lights.test_world_hints import add_environment, add_sky

SIZE = 32
MAP_SIDE = 192  # texels; its table is 256 wide, which the smallest limit of Simplify that we use (128) halves
REPEATS = 30  # of the map over the plane: a hundred texels a pixel, for a far view
FAR_PIXELS = 12  # along the picture's side: a sample without counts takes a millisecond
ROUGHNESS = 0.2
FRAME = 5  # another than the one that was prepared
LAMP_POWER = 500.0  # W
BULB_RADIANCE = 5000.0
ROUNDING = 1e-4  # relative to the brightest pixel: the same arithmetic in OSL and in Blender's own nodes


@pytest.fixture
def flake_map(scene, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return write_flake_map(tmp_path / "flakes.png", MAP_SIDE)


@pytest.fixture
def plane(scene, flake_map):
    """Glints of a sharp sun, a few texels a pixel."""
    scene = bpy.context.scene
    scene.cycles.samples = 4
    cycles.add_camera(scene, (0, -2, 2), angle=0.6)
    cycles.add_sun(scene, (0.05, 1, 1), angle=0.02)
    material = create_glint_material("Sparkle", flake_map, roughness=ROUGHNESS)
    return cycles.add_plane(scene, 3.0, material=material)


def native_material(flake_map):
    """Image Texture -> Normal Map -> Glossy BSDF, built here and not by the add-on."""
    material = bpy.data.materials.new("Native")
    tree = material.node_tree
    tree.nodes.clear()
    texture, normal_map, glossy, output = (
        tree.nodes.new(kind) for kind in
        ("ShaderNodeTexImage", "ShaderNodeNormalMap", "ShaderNodeBsdfAnisotropic", "ShaderNodeOutputMaterial")
    )
    texture.image = bpy.data.images["flakes.png"]
    glossy.distribution = "BECKMANN"
    glossy.inputs["Roughness"].default_value = ROUGHNESS
    glossy.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(texture.outputs["Color"], normal_map.inputs["Color"])
    tree.links.new(normal_map.outputs["Normal"], glossy.inputs["Normal"])
    tree.links.new(glossy.outputs["BSDF"], output.inputs["Surface"])
    return material


def native_picture(plane, flake_map):
    """The same scene with Blender's own nodes."""
    own = plane.material_slots[0].material
    plane.material_slots[0].material = native_material(flake_map)
    picture = cycles.rendered(bpy.context.scene)[..., :3]
    plane.material_slots[0].material = own
    return picture


def prepared_sockets(plane):
    """Prepare the scene; returns the shader's sockets."""
    prepare_scene(bpy.context.scene)
    (group,) = glint_groups(plane.material_slots[0].material)
    return group.nodes[glint_bsdf.SCRIPT_NODE].inputs


def prepared(plane):
    """Prepare the scene; returns the shader's sockets and the picture."""
    return prepared_sockets(plane), cycles.rendered(bpy.context.scene)[..., :3]


def table_of_normals(plane) -> Path:
    """The file of the normals in the prepared plane's map."""
    (group,) = glint_groups(plane.active_material)
    return disk_path(group["glint_table"])


def assert_same(picture, other):
    difference = np.abs(picture - other).max()
    assert difference <= ROUNDING * other.max(), f"largest difference {difference} of {other.max()}"


def assert_different(picture, other):
    """A tenth of the pixels changes by a tenth of the mean: the lobe is at work, or sameness would say nothing."""
    assert (np.abs(picture - other) > 0.1 * other.mean()).mean() > 0.1


def test_before_it_is_prepared_a_material_is_blenders_own_nodes(plane, flake_map):
    scene = bpy.context.scene
    assert_same(cycles.rendered(scene)[..., :3], native_picture(plane, flake_map))


def test_a_deleted_table_leaves_blenders_own_nodes(plane, flake_map, tmp_path):
    _, with_table = prepared(plane)
    native = native_picture(plane, flake_map)
    assert_different(with_table, native)
    table_of_normals(plane).unlink()
    assert_same(cycles.rendered(bpy.context.scene)[..., :3], native)


@pytest.mark.parametrize("damage", thinned(["empty", "text", "cut", "other"], ["cut", "other"], "two renders"))
def test_a_damaged_table_leaves_blenders_own_nodes(plane, flake_map, tmp_path, damage):
    prepare_scene(bpy.context.scene)
    table = table_of_normals(plane)
    content = {"empty": b"", "text": b"no table", "cut": table.read_bytes()[:500], "other": flake_map.read_bytes()}
    table.write_bytes(content[damage])
    assert_same(cycles.rendered(bpy.context.scene)[..., :3], native_picture(plane, flake_map))


def test_without_whole_counts_a_far_view_is_that_of_the_elements(scene, plane):
    """Slow: without counts each sample visits thousands of elements, in four of five renders."""
    scene.cycles.samples = 1
    scene.render.resolution_x = scene.render.resolution_y = FAR_PIXELS
    plane.data.uv_layers[0].uv.foreach_set("vector", np.float32([0, 0, REPEATS, 0, REPEATS, REPEATS, 0, REPEATS]))
    sockets, with_counts = prepared(plane)
    first, table = sockets["CountsFirst"].default_value, disk_path(sockets["CountsTable"].default_value)
    sockets["CountsFirst"].default_value = 0
    elements = cycles.rendered(scene)[..., :3]
    sockets["CountsFirst"].default_value = first
    assert first > 0 and (with_counts != elements).any()
    contents = {"text": b"no table", "other": disk_path(sockets["Table"].default_value).read_bytes(), "deleted": None}
    for damage, content in contents.items():
        table.unlink()
        if content is not None:
            table.write_bytes(content)
        np.testing.assert_array_equal(cycles.rendered(scene)[..., :3], elements, err_msg=damage)


@pytest.mark.parametrize("limit", thinned(["128", "256", "512"], ["128", "256"], "three renders"))
def test_a_texture_size_limit_leaves_blenders_own_nodes_or_a_whole_table(plane, flake_map, limit):
    scene = bpy.context.scene
    _, with_table = prepared(plane)
    scene.render.use_simplify = True
    scene.cycles.texture_limit_render = limit
    limited = cycles.rendered(scene)[..., :3]
    if int(limit) >= 256:
        # No smaller than the sides of the table (256 x 256): nothing is shrunk.
        np.testing.assert_array_equal(limited, with_table)
    else:
        # Blender shrinks its own normal map as well.
        assert_same(limited, native_picture(plane, flake_map))
        assert_different(limited, with_table)


def test_without_osl_a_material_has_the_mean_of_blenders_own_nodes(plane, flake_map):
    scene = bpy.context.scene
    prepare_scene(scene)
    assert scene.cycles.shading_system
    scene.cycles.shading_system = False
    scene.cycles.samples = 512
    by_nodes = cycles.rendered(scene)[..., :3].mean()
    scene.cycles.samples = 2048
    assert by_nodes == pytest.approx(native_picture(plane, flake_map).mean(), rel=0.01)


def test_tables_are_read_whatever_their_folder_is_called(plane, tmp_path):
    """Slow: a name that a shader holds is compiled into it, five times."""
    _, picture = prepared(plane)
    for folder in ("with space", "scène – 光", "50% off #1", "<UDIM>"):
        (tmp_path / folder).mkdir()
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / folder / "scene.blend"))
        sockets, moved = prepared(plane)
        assert folder in str(disk_path(sockets["Table"].default_value))
        np.testing.assert_array_equal(moved, picture, err_msg=folder)


def test_a_saved_file_renders_the_same_pixels_where_the_addon_is_not_installed(farm, plane, tmp_path):
    scene = bpy.context.scene
    sockets, picture = prepared(plane)
    np.testing.assert_array_equal(farm.rendered(tmp_path), picture)
    assert picture.max() > 0 and scene.cycles.shading_system
    assert sockets["Table"].default_value.startswith("//glint_tables/")


def light_with_everything(scene, world):
    """Hints of each kind, which follow their lights in different ways; names of them all."""
    scene.frame_start, scene.frame_end = 1, FRAME
    lamp = add_lamp(scene, location=(-0.5, 1.2, 1.5), name="Keyed", power=LAMP_POWER, shadow_soft_size=0.05)
    lamp.keyframe_insert("location", frame=1)
    lamp.location.x = 0.5
    lamp.keyframe_insert("location", frame=FRAME)
    copied = add_lamp(scene, "AREA", location=(0, 0, 0), target=(0, -1, -1), name="Copied", power=LAMP_POWER, size=0.1)
    empty = add_instance(scene, fixture(scene, copied), location=(0.8, 1.5, 1.5))
    empty.keyframe_insert("location", frame=1)
    empty.location.z = 2.0
    empty.keyframe_insert("location", frame=FRAME)
    add_bulb(scene, 0.05, (-0.8, 1.5, 1.5), strength=BULB_RADIANCE)
    if world == "picture":
        add_environment(scene, mapping="POINT")
    else:
        add_sky(scene, sun_elevation=0.8, sun_rotation=0.1)
        scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = "MANUAL", WORLD_SIZE
    scene.frame_set(1)
    return ["Bulb", "Copied in Empty", "Keyed", "Sun", "World spot" if world == "picture" else "World sun"]


def hint_values(names):
    """What the drivers of each hint say; hints are in the order of their names."""
    return [slot_values(slot) for slot in range(1, len(names) + 1)]


@pytest.mark.parametrize("world", thinned(["picture", "sky"], ["picture"], "two renders, one of them on the farm"))
def test_another_frame_of_a_scene_with_every_kind_of_light_is_the_same_where_the_addon_is_not_installed(
        farm, plane, tmp_path, world):
    scene = bpy.context.scene
    scene.cycles.samples = 2
    scene.render.resolution_x = scene.render.resolution_y = 16
    names = light_with_everything(scene, world)
    bpy.data.lights["Sun"].energy = 10.0
    assert sorted(prepare_scene(scene)["hints"]) == names
    prepared_values = hint_values(names)
    scene.frame_set(FRAME)
    picture = cycles.rendered(scene)[..., :3]
    moved = [name for name, old, new in zip(names, prepared_values, hint_values(names), strict=True) if old != new]
    assert moved == ["Copied in Empty", "Keyed"] and picture.max() > 0
    scene.frame_set(1)
    np.testing.assert_array_equal(farm.rendered(tmp_path, FRAME), picture)
