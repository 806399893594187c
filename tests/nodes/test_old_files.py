"""Files of version 9: they open, keep their maps, values and links, and are brought up to date.

data/version_9.blend was saved by that version, prepared: a square with a packed map of 32 x 32 flakes, a sun, a lamp.
Its shader was taken out, which every version brings along anyway.
"""

from pathlib import Path

import bpy
import numpy as np
import pytest

import glint_addon
from glint_addon import changes_since_prepared, create_glint_material, prepare_scene
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.builder import STAMP
from glint_addon.nodes.glint_bsdf import VERSION, group_binding, inputs_of, refresh
from glint_addon.nodes.map_binding import map_of
from glint_addon.nodes.script_node import osl_available
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.stress_marks import stress

OLD_FILE = Path(__file__).parents[1] / "data" / "version_9.blend"
VALUES = {"Roughness": 0.2, "Strength": 0.8}
COLOR = (0.9, 0.5, 0.25)


@pytest.fixture
def old_scene(scene, tmp_path):
    """The old file, opened where the extension is registered."""
    file = tmp_path / "old.blend"
    file.write_bytes(OLD_FILE.read_bytes())
    glint_addon.register()
    bpy.ops.wm.open_mainfile(filepath=str(file))
    yield bpy.context.scene
    glint_addon.unregister()


def sparkle():
    """The material of the old file, and its group."""
    material = bpy.data.materials["Sparkle"]
    (group,) = glint_groups(material)
    return material, group


def node_of(material):
    (node,) = [node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup"]
    return node


def assert_map_survives(material, tmp_path):
    """Previews take no user of the map away, and the saved file has it."""
    (group,) = glint_groups(material)
    image = map_of(group)
    users, name = image.users, material.name
    before = cycles.rendered(bpy.context.scene)
    material.asset_generate_preview()  # takes seconds; of version 9 the first took the map's only user
    assert image.users == users > 0
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "again.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "again.blend"))
    material = bpy.data.materials[name]
    (group,) = glint_groups(material)
    assert map_of(group).users == users and tuple(map_of(group).size) == (32, 32)
    np.testing.assert_array_equal(cycles.rendered(bpy.context.scene), before)


def test_an_old_file_has_no_pointer_to_its_map_left_once_it_is_open(old_scene):
    _, group = sparkle()
    assert not any(isinstance(value, bpy.types.ID) for value in group.values())
    assert map_of(group).name == "flakes.png" and map_of(group).users == 1


@stress("two previews of 7 s of processor time each", fast=[
    "nodes/test_old_files.py::test_an_old_file_has_no_pointer_to_its_map_left_once_it_is_open",
    "nodes/test_old_files.py::test_the_map_of_a_new_material_survives_previews",
])
def test_the_map_of_an_old_file_survives_previews_before_it_is_prepared_and_after(old_scene, tmp_path):
    assert_map_survives(sparkle()[0], tmp_path)
    prepare_scene(bpy.context.scene)
    assert_map_survives(sparkle()[0], tmp_path)


def test_the_map_of_a_new_material_survives_previews(scene, tmp_path):
    """Slow: Blender renders a preview with samples of its own, which no setting lowers."""
    material = create_glint_material("Sparkle", write_flake_map(tmp_path / "flakes.png", 32))
    cycles.add_plane(scene, material=material)
    cycles.add_camera(scene, (0, 0, 3), width=1.0)
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.1)
    assert_map_survives(material, tmp_path)


def test_an_old_group_becomes_one_of_this_version_and_keeps_map_values_and_links(old_scene):
    material, group = sparkle()
    before, node = group_binding(group), node_of(material)
    assert group[STAMP] == 9 and changes_since_prepared(old_scene)
    prepare_scene(old_scene)
    assert group[STAMP] == VERSION and group_binding(group) == before
    assert {name: round(node.inputs[name].default_value, 6) for name in VALUES} == VALUES
    assert tuple(node.inputs["Color"].default_value)[:3] == pytest.approx(COLOR)
    assert node.inputs["Vector"].links[0].from_node.bl_idname == "ShaderNodeUVMap" and node.outputs["BSDF"].is_linked
    assert not osl_available() or group["glint_table"].startswith("//glint_tables/")
    assert changes_since_prepared(old_scene) == []
    assert not any(isinstance(value, bpy.types.ID) for tree in bpy.data.node_groups for value in tree.values())


def test_a_socket_that_an_old_group_lacks_is_added_and_the_others_keep_their_links(old_scene):
    material, group = sparkle()
    group.interface.remove(group.interface.items_tree["Strength"])
    kept = [item.name for item in group.interface.items_tree if item.in_out == "INPUT"]
    refresh(group)
    node = node_of(material)
    assert [socket.name for socket in node.inputs] == kept + [
        socket.name for socket in inputs_of("TINT") if socket.name not in kept]
    assert node.inputs["Strength"].default_value == 1.0 and node.inputs["Vector"].is_linked
    assert round(node.inputs["Roughness"].default_value, 6) == VALUES["Roughness"]


def test_an_old_file_renders_what_a_new_material_does(old_scene):
    prepare_scene(old_scene)
    old = cycles.rendered(old_scene)[..., :3]
    square, image = bpy.data.objects["Mesh"], map_of(sparkle()[1])
    new = create_glint_material("New", image, interpolation="CLOSEST", color=COLOR, **{
        name.lower(): value for name, value in VALUES.items()})
    square.material_slots[0].material = new
    prepare_scene(old_scene)
    np.testing.assert_array_equal(cycles.rendered(old_scene)[..., :3], old)
    assert old.max() > 0.0
