"""The operators: what they do, why they are greyed out, and that a failure is one sentence and changes nothing."""

from pathlib import Path

import bpy
import pytest

import glint_addon
from glint_addon.materials.find import glint_groups, is_glint_material
from glint_addon.nodes import GROUPS
from glint_addon.nodes.glint_bsdf import group_binding, is_glint_group
from glint_addon.nodes.map_binding import map_of
from glint_addon.nodes.map_choices import IMAGE_NODE
from glint_addon.nodes.places import DEFAULT_COUNT, count_node, count_of
from glint_addon.nodes.scale import metres_property, scale_nodes, uv_map_of
from tests.helpers import cycles, map_sets
from tests.helpers.extension import refused, shader_editor, write_flake_map

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


def greyed(operator) -> str:
    """Why `operator` cannot be called here."""
    assert not operator.poll()
    with pytest.raises(RuntimeError, match="poll") as error:
        operator()
    return str(error.value).strip().partition("failed, ")[2] or str(error.value).strip()


def test_a_scale_is_a_node_of_the_material_and_the_object_is_measured_at_once(plane, flake_map):
    assert bpy.ops.glint.add_material(filepath=str(flake_map)) == {"FINISHED"}
    assert scale_nodes(plane.active_material) == [] and metres_property("") not in plane
    assert bpy.ops.glint.add_material(filepath=str(flake_map), scale=0.25) == {"FINISHED"}
    (node,) = scale_nodes(plane.active_material)
    assert node.inputs["Scale"].default_value == 0.25
    assert plane[metres_property("")] == pytest.approx(2.0)
    plane.data.uv_layers.new(name="Other").uv.foreach_set("vector", [0, 0, 8, 0, 8, 8, 0, 8])
    assert bpy.ops.glint.add_material(filepath=str(flake_map), scale=0.25, uv_map="Other") == {"FINISHED"}
    assert plane[metres_property("Other")] == pytest.approx(0.25)
    assert bpy.ops.glint.change_map(image="flakes.png", uv_map="") == {"FINISHED"}
    (node,) = scale_nodes(plane.active_material)
    assert node.inputs["Scale"].default_value == 0.25 and uv_map_of(node.node_tree) == ""


def test_a_dropped_file_becomes_the_material_of_the_active_object(plane, flake_map):
    assert bpy.ops.glint.add_material(filepath=str(flake_map), interpolation="CLOSEST", roughness=0.2) == {"FINISHED"}
    material = plane.active_material
    assert material.name == "Glint flakes" and is_glint_material(material)
    (group,) = glint_groups(material)
    assert map_of(group).name == "flakes.png" and group_binding(group).interpolation == "CLOSEST"
    node = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    assert node.inputs["Roughness"].default_value == pytest.approx(0.2)


def test_a_picked_image_becomes_the_material_and_the_pick_is_spent(plane, flake_map):
    image = bpy.data.images.load(str(flake_map))
    bpy.context.scene.glint.normal_map = image
    assert bpy.ops.glint.add_material() == {"FINISHED"}
    assert map_of(glint_groups(plane.active_material)[0]) == image
    assert bpy.context.scene.glint.normal_map is None


def test_the_material_of_an_image_opened_twice_has_the_name_of_the_file(plane, flake_map):
    bpy.data.images.load(str(flake_map))
    bpy.context.scene.glint.normal_map = bpy.data.images.load(str(flake_map))
    bpy.ops.glint.add_material()
    assert map_of(glint_groups(plane.active_material)[0]).name == "flakes.png.001"
    assert plane.active_material.name == "Glint flakes"


def test_a_picked_image_that_is_a_colour_stays_one(plane, flake_map):
    image = bpy.data.images.load(str(flake_map))
    bpy.context.scene.glint.normal_map = image
    bpy.ops.glint.add_material()
    assert not image.colorspace_settings.is_data
    assert map_of(glint_groups(plane.active_material)[0]) == image


def test_a_refused_pick_is_left_as_it_was(plane, scene):
    image = bpy.data.images.new("Single pixel", 1, 1)
    bpy.context.scene.glint.normal_map = image
    before = image.colorspace_settings.name
    assert "Single pixel" in refused(bpy.ops.glint.add_material)
    assert image.colorspace_settings.name == before and bpy.context.scene.glint.normal_map == image


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


def test_a_picked_file_that_is_not_an_image_is_refused(plane, tmp_path):
    (tmp_path / "notes.png").write_text("this is a text, not an image", encoding="utf-8")
    bpy.context.scene.glint.normal_map = bpy.data.images.load(str(tmp_path / "notes.png"))
    assert '"notes.png" has no pixels' in refused(bpy.ops.glint.add_material)


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


def test_the_map_of_a_material_can_be_changed_and_read_another_way(plane, flake_map, tmp_path):
    bpy.ops.glint.add_material(filepath=str(flake_map))
    plane.data.uv_layers.new(name="Second")
    other = write_flake_map(tmp_path / "other.png")
    bpy.ops.glint.change_map(filepath=str(other), interpolation="CLOSEST", convention="DIRECTX", uv_map="Second")
    (group,) = glint_groups(plane.active_material)
    assert map_of(group).name == "other.png"
    assert (group_binding(group).interpolation, group_binding(group).convention) == ("CLOSEST", "DIRECTX")
    (coordinates,) = [n for n in plane.active_material.node_tree.nodes if n.bl_idname == "ShaderNodeUVMap"]
    assert coordinates.uv_map == "Second"
    # The group of the first map has no user any more.
    assert [map_of(each) for each in bpy.data.node_groups if is_glint_group(each)] == [map_of(group)]


def test_another_map_keeps_the_number_of_places_unless_others_read_it(plane, flake_map, tmp_path):
    bpy.ops.glint.add_material(filepath=str(flake_map))
    count_node(glint_groups(plane.active_material)[0]).integer = 24
    other = write_flake_map(tmp_path / "other.png")
    bpy.ops.glint.change_map(filepath=str(other))
    assert count_of(glint_groups(plane.active_material)[0]) == 24
    glint_addon.create_glint_material("Another", flake_map)
    bpy.ops.glint.change_map(filepath=str(flake_map))
    assert count_of(glint_groups(plane.active_material)[0]) == DEFAULT_COUNT


def test_another_reading_of_a_sequence_keeps_its_frames(plane, tmp_path):
    image = map_sets.sequence(tmp_path)
    bpy.ops.glint.add_material(image=image.name)
    glint_groups(plane.active_material)[0].nodes[IMAGE_NODE].image_user.frame_start = 7
    bpy.ops.glint.change_map(image=image.name, interpolation="CLOSEST")
    group = glint_groups(plane.active_material)[0]
    assert group_binding(group).interpolation == "CLOSEST" and group_binding(group).frames.frame_start == 7


def test_a_glint_node_added_from_the_menu_gets_its_map(plane, flake_map):
    material = bpy.data.materials.new("Shader")
    plane.data.materials.append(material)
    with shader_editor(material.node_tree):
        bpy.ops.glint.add_node_group(group="Glint BSDF")
    assert not is_glint_material(material)
    bpy.context.scene.glint.normal_map = bpy.data.images.load(str(flake_map))
    bpy.ops.glint.change_map()
    assert map_of(glint_groups(material)[0]).name == "flakes.png"


def test_changing_to_a_missing_file_changes_nothing(plane, flake_map, tmp_path):
    bpy.ops.glint.add_material(filepath=str(flake_map))
    assert "gone.png does not exist" in refused(bpy.ops.glint.change_map, filepath=str(tmp_path / "gone.png"))


def test_changing_the_map_is_greyed_out_without_a_glint_node(plane):
    assert "Select an object with a Glint material" in greyed(bpy.ops.glint.change_map)
    plane.data.materials.append(bpy.data.materials.new("Plain"))
    assert "Plain has no Glint BSDF node" in greyed(bpy.ops.glint.change_map)


def test_preparing_is_greyed_out_without_a_glint_material(plane):
    assert "no Glint material yet: add one first" in greyed(bpy.ops.glint.prepare)


def test_keeping_glints_denoises_by_albedo_alone_and_can_be_undone(plane):
    def settings():
        cycles_settings = bpy.context.scene.cycles
        return [getattr(cycles_settings, f"denoising_{name}") for name in ("input_passes", "prefilter", "quality")]

    bpy.context.scene.cycles.use_denoising = True
    before = ["RGB_ALBEDO_NORMAL", "FAST", "BALANCED"]
    for name, value in zip(("input_passes", "prefilter", "quality"), before, strict=True):
        setattr(bpy.context.scene.cycles, f"denoising_{name}", value)
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.glint.keep_glints() == {"FINISHED"}
    assert settings() == ["RGB_ALBEDO", "ACCURATE", "HIGH"]
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert settings() == before


def test_keeping_glints_is_greyed_out_where_nothing_softens_them(plane):
    assert "not denoised by albedo and normal" in greyed(bpy.ops.glint.keep_glints)
    bpy.context.scene.cycles.use_denoising = True
    bpy.context.scene.render.engine = "BLENDER_EEVEE"
    assert "not denoised by albedo and normal" in greyed(bpy.ops.glint.keep_glints)


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


@pytest.fixture
def glinting(plane, flake_map, tmp_path):
    """The plane with a Glint material and a sun, in a saved file; gives the scene."""
    bpy.ops.glint.add_material(filepath=str(flake_map))
    scene = bpy.context.scene
    cycles.add_sun(scene, (0, 0, 1), angle=0.01)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "glints.blend"))
    return bpy.context.scene


def test_preparing_bakes_once_and_keeps_its_report_on_the_scene(glinting, tmp_path):
    for word in ("baked", "reused"):
        assert bpy.ops.glint.prepare() == {"FINISHED"}
        state = bpy.context.scene.glint
        # Without a camera, views from far away are prepared for too: with a table of counts.
        assert [line.detail for line in state.tables] == [word] * 2
    assert state.prepared and glinting.cycles.shading_system
    assert [line.name for line in state.hints] == ["Sun"] and not state.warnings
    assert Path(state.tables[0].name).parent == tmp_path / "glint_tables"


def test_the_report_says_why_a_light_was_left_out(glinting):
    cycles.add_sun(glinting, (0, 1, 1), strength=0.0)
    bpy.ops.glint.prepare()
    (line,) = bpy.context.scene.glint.skipped_lights
    assert line.name == "Sun.001" and line.detail


def test_warnings_say_in_words_what_stands_in_the_way(glinting):
    glinting.render.use_simplify = True
    glinting.cycles.texture_limit_render = "1024"
    glinting.cycles.device = "GPU"
    bpy.ops.glint.prepare()
    words = " ".join(line.name for line in bpy.context.scene.glint.warnings)
    assert "Simplify" in words and "by nodes" in words


def test_preparing_shows_progress_that_only_grows(glinting):
    steps = []
    glint_addon.prepare_scene(glinting, progress=lambda fraction, text: steps.append((fraction, text)))
    fractions = [fraction for fraction, _ in steps]
    assert fractions == sorted(fractions) and fractions[0] >= 0.0 and fractions[-1] == 1.0
    assert all(text for _, text in steps)


def test_preparing_fails_in_one_sentence_if_tables_cannot_be_written(glinting, tmp_path):
    (tmp_path / "glint_tables").write_text("a file where the folder should be", encoding="utf-8")
    assert str(tmp_path) in refused(bpy.ops.glint.prepare)
    assert not bpy.context.scene.glint.prepared


def test_preparing_names_a_map_whose_file_has_gone(glinting, flake_map):
    flake_map.unlink()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert "flakes.png" in refused(bpy.ops.glint.prepare)


def test_after_preparing_the_sun_lights_facets_that_blender_nodes_find_only_by_luck(glinting):
    cycles.add_camera(glinting, (0, 0, 3), width=2.0)
    for node in bpy.context.object.active_material.node_tree.nodes:
        if node.bl_idname == "ShaderNodeGroup":
            node.inputs["Roughness"].default_value = 0.1
    cycles.box_filter(glinting)
    bpy.ops.glint.prepare()
    lobe = cycles.rendered(glinting)[..., 0]
    glinting.cycles.shading_system = False
    native = cycles.rendered(glinting)[..., 0]
    # 32 pixels over 32 texels: almost no facet mirrors the sun, but each has a lobe, and one sample finds few of them.
    assert lobe.std() / lobe.mean() < 0.9 * native.std() / native.mean()
