"""The operators: what they do, why they are greyed out, and that a failure is one sentence and changes nothing."""

import bpy
import pytest

from glint_addon.material import glint_groups, is_glint_material
from glint_addon.nodes import GROUPS
from tests.helpers import cycles
from tests.helpers.extension import data_names, shader_editor, write_flake_map

pytestmark = pytest.mark.usefixtures("registered")


@pytest.fixture
def plane(scene):
    """The active object: a square with a UV map and no material."""
    thing = cycles.add_plane(bpy.context.scene)
    bpy.context.view_layer.objects.active = thing
    return thing


@pytest.fixture
def flake_map(tmp_path):
    """Path of a small normal map."""
    return write_flake_map(tmp_path / "flakes.png")


def refused(operator, **settings) -> str:
    """The sentence with which `operator` refuses; the file must not change meanwhile."""
    before = data_names()
    with pytest.raises(RuntimeError) as error:
        operator(**settings)
    assert data_names() == before
    sentence = str(error.value).strip().removeprefix("Error: ")
    assert sentence.endswith(".") and "\n" not in sentence and ": " in sentence, sentence
    return sentence


def greyed(operator) -> str:
    """Why `operator` cannot be called here."""
    assert not operator.poll()
    with pytest.raises(RuntimeError, match="poll") as error:
        operator()
    return str(error.value).strip().partition("failed, ")[2] or str(error.value).strip()


def test_a_dropped_file_becomes_the_material_of_the_active_object(plane, flake_map):
    assert bpy.ops.glint.add_material(filepath=str(flake_map), interpolation="CLOSEST", roughness=0.2) == {"FINISHED"}
    material = plane.active_material
    assert material.name == "Glint flakes" and is_glint_material(material)
    (group,) = glint_groups(material)
    assert group["glint_image"].name == "flakes.png" and group["glint_interpolation"] == "CLOSEST"
    node = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    assert node.inputs["Roughness"].default_value == pytest.approx(0.2)


def test_a_picked_image_becomes_the_material_and_the_pick_is_spent(plane, flake_map):
    image = bpy.data.images.load(str(flake_map))
    image.colorspace_settings.name = "Non-Color"
    bpy.context.scene.glint.normal_map = image
    assert bpy.ops.glint.add_material() == {"FINISHED"}
    assert glint_groups(plane.active_material)[0]["glint_image"] == image
    assert bpy.context.scene.glint.normal_map is None


def test_the_material_replaces_only_the_active_slot(plane, flake_map):
    for name in ("First", "Second"):
        plane.data.materials.append(bpy.data.materials.new(name))
    plane.active_material_index = 1
    bpy.ops.glint.add_material(filepath=str(flake_map), name="Sparkle")
    assert [slot.material.name for slot in plane.material_slots] == ["First", "Sparkle"]


def test_adding_the_material_can_be_undone(plane, flake_map):
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.glint.add_material(filepath=str(flake_map))
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert not bpy.data.materials and not bpy.context.object.material_slots


def test_without_a_map_the_sentence_says_where_to_pick_one(plane):
    assert "No normal map is chosen: pick an image" in refused(bpy.ops.glint.add_material)


def test_a_missing_file_is_named(plane, tmp_path):
    assert "gone.png does not exist" in refused(bpy.ops.glint.add_material, filepath=str(tmp_path / "gone.png"))


def test_an_unknown_image_is_named(plane):
    assert 'no image named "nothing"' in refused(bpy.ops.glint.add_material, image="nothing")


@pytest.mark.parametrize("content", [b"", b"this is a text, not an image\n", b"\x89PNG\r\n\x1a\n cut short"])
def test_a_file_that_is_not_an_image_is_refused(plane, tmp_path, content):
    file = tmp_path / "notes.png"
    file.write_bytes(content)
    assert "notes.png" in refused(bpy.ops.glint.add_material, filepath=str(file))


def test_a_folder_instead_of_a_file_is_refused(plane, tmp_path):
    assert str(tmp_path) in refused(bpy.ops.glint.add_material, filepath=str(tmp_path))


def test_a_mesh_without_uv_map_is_refused(plane, flake_map):
    plane.data.uv_layers.remove(plane.data.uv_layers[0])
    assert '"Mesh" has no UV map' in refused(bpy.ops.glint.add_material, filepath=str(flake_map))


def test_an_unknown_uv_map_is_refused_with_the_names_there_are(plane, flake_map):
    sentence = refused(bpy.ops.glint.add_material, filepath=str(flake_map), uv_map="Other")
    assert 'no UV map named "Other": choose one of UVMap.' in sentence


def test_adding_a_material_is_greyed_out_without_an_object(scene):
    assert "Select an object" in greyed(bpy.ops.glint.add_material)


def test_adding_a_material_is_greyed_out_for_a_camera(scene):
    camera = cycles.add_camera(bpy.context.scene)
    bpy.context.view_layer.objects.active = camera
    assert "Camera is not an object that takes materials" in greyed(bpy.ops.glint.add_material)


def test_preparing_is_greyed_out_without_a_glint_material(plane):
    assert "no Glint material yet: add one first" in greyed(bpy.ops.glint.prepare)


def test_adding_a_group_is_greyed_out_outside_the_shader_editor(plane):
    assert "Open the Shader Editor" in greyed(bpy.ops.glint.add_node_group)
    with shader_editor(None):
        assert "shows no material" in greyed(bpy.ops.glint.add_node_group)


@pytest.mark.parametrize("name", list(GROUPS))
def test_each_group_is_added_at_the_cursor_and_selected_alone(plane, name):
    tree = bpy.data.materials.new("Shader").node_tree
    others = len(tree.nodes)
    with shader_editor(tree) as space:
        space.cursor_location = (120.0, -40.0)
        assert bpy.ops.glint.add_node_group(group=name) == {"FINISHED"}
    assert len(tree.nodes) == others + 1
    node = tree.nodes.active
    assert node.node_tree.name == name and tuple(node.location) == (120.0, -40.0)
    assert [other for other in tree.nodes if other.select] == [node]


@pytest.mark.parametrize("name", list(GROUPS))
def test_a_group_is_never_added_to_itself(plane, name):
    group = GROUPS[name]()
    with shader_editor(group):
        assert "cannot be added to itself" in refused(bpy.ops.glint.add_node_group, group=name)


def test_a_clash_of_names_is_one_sentence(plane):
    name = next(iter(GROUPS))
    bpy.data.node_groups.new(name, "ShaderNodeTree")
    tree = bpy.data.materials.new("Shader").node_tree
    with shader_editor(tree):
        assert "rename it" in refused(bpy.ops.glint.add_node_group, group=name)
