"""prepare_scene: bakes what is missing and nothing else, says what it did, and refuses without leaving a trace."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material, prepare_scene
from glint_addon.errors import MapError, TableError
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import glint_bsdf, glint_lights, image_choice
from glint_addon.nodes.map_binding import map_of
from glint_addon.paths import TABLE_FOLDER_NAME, disk_path, table_folder
from tests.helpers import cycles
from tests.helpers.extension import data_names, write_flake_map
from tests.helpers.no_osl import take_osl_away


@pytest.fixture
def flake_map(scene, tmp_path):
    return write_flake_map(tmp_path / "flakes.png")


@pytest.fixture
def blend(scene, tmp_path):
    """The open file, saved: its tables go to a folder beside it, which is given."""
    save(tmp_path / "scene.blend")
    return tmp_path / TABLE_FOLDER_NAME


@pytest.fixture
def plane(scene, flake_map, blend):
    """A square with glints under a sun, in a saved file."""
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 3))
    return cycles.add_plane(scene, material=create_glint_material("Sparkle", flake_map))


def save(file):
    bpy.ops.wm.save_as_mainfile(filepath=str(file))


def tables(folder):
    """Tables in `folder`: {name: time of last change}."""
    return {file.name: file.stat().st_mtime_ns for file in folder.iterdir()} if folder.is_dir() else {}


def group_of(plane, slot=0):
    (group,) = glint_groups(plane.material_slots[slot].material)
    return group


def shown_table(group):
    """The file that the shader's socket names."""
    return str(disk_path(group.nodes[glint_bsdf.SCRIPT_NODE].inputs["Table"].default_value))


def plain(value):
    """A property's value as something that can be compared later."""
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def state(scene):
    """All that prepare_scene may change in the file."""
    bpy.context.view_layer.update()  # drivers show their values only then
    groups = {
        group.name: ({name: plain(value) for name, value in group.items()},
                     [plain(getattr(socket, "default_value", 0)) for node in group.nodes for socket in node.inputs],
                     len(group.animation_data.drivers) if group.animation_data else 0)
        for group in bpy.data.node_groups
    }
    return data_names(), groups, scene.cycles.shading_system


def refusal(scene, kind) -> str:
    """The one sentence with which prepare_scene refuses; the scene must be as it was."""
    before = state(scene)
    with pytest.raises(kind) as error:
        prepare_scene(scene)
    assert state(scene) == before
    sentence = str(error.value)
    assert sentence.endswith(".") and ": " in sentence and "\n" not in sentence, sentence
    return sentence


# --- baking ---


def test_the_first_call_bakes_and_the_second_does_nothing(scene, plane, blend):
    first = prepare_scene(scene)
    before, files = state(scene), tables(blend)
    second = prepare_scene(scene)
    assert len(first["baked"]) == 1 and not first["reused"]
    assert second["reused"] == first["baked"] and not second["baked"]
    assert tables(blend) == files and len(files) == 1 and state(scene) == before


def test_the_second_call_does_not_even_read_the_image(scene, plane, monkeypatch):
    prepare_scene(scene)

    def read(image):
        raise AssertionError(f"{image.name} was read again")

    monkeypatch.setattr("glint_addon.prepare.map_bake.image_pixels", read)
    assert prepare_scene(scene)["reused"]


def test_the_report_names_lights_tables_and_device(scene, plane, blend):
    bpy.data.objects["Sun"].name = "Key"
    cycles.add_sun(scene, (0, 0, 1), strength=0.0)
    report = prepare_scene(scene)
    assert report["hints"] == ["Key"] and report["osl"] is True and report["device"] == "CPU"
    assert [name for name, reason in report["skipped_lights"]] == ["Sun"]
    assert all(reason for name, reason in report["skipped_lights"]) and report["warnings"] == []
    assert [blend / name for name in tables(blend)] == [blend.parent / path for path in report["baked"]]


def test_the_shader_is_told_the_table_its_size_and_its_slopes(scene, flake_map, plane):
    (path,) = prepare_scene(scene)["baked"]
    script = group_of(plane).nodes[glint_bsdf.SCRIPT_NODE].inputs
    assert script["Table"].default_value == f"//{TABLE_FOLDER_NAME}/{Path(path).name}" and Path(path).is_file()
    assert (script["Width"].default_value, script["Height"].default_value) == (32, 32)
    low, high = script["SlopeLow"].default_value, script["SlopeHigh"].default_value
    # The map's slopes are normal with deviation 0.3, 1024 of them: nearly all within four deviations.
    assert -1.6 < low[0] < -0.6 and -1.6 < low[1] < -0.6 and 0.6 < high[0] < 1.6 and 0.6 < high[1] < 1.6


def test_osl_is_switched_on(scene, plane):
    scene.cycles.shading_system = False
    prepare_scene(scene)
    assert scene.cycles.shading_system


def test_progress_grows_from_0_to_1_and_says_what_is_baked(scene, plane, flake_map):
    plane.data.materials.append(create_glint_material("Other", flake_map, interpolation="CLOSEST"))
    calls = []
    prepare_scene(scene, progress=lambda fraction, text: calls.append((fraction, text)))
    fractions = [fraction for fraction, _ in calls]
    assert fractions == sorted(fractions) and {0.0, 0.5, 1.0} <= set(fractions)
    assert all("flakes.png" in text for _, text in calls[:-1]) and calls[-1] == (1.0, "Glints are ready")


def test_a_changed_image_file_is_baked_again(scene, plane, flake_map, blend):
    (old,) = prepare_scene(scene)["baked"]
    write_flake_map(flake_map, 64)
    report = prepare_scene(scene)
    (new,) = report["baked"]
    assert old != new and len(tables(blend)) == 2 and not report["reused"]
    assert shown_table(group_of(plane)) == new
    assert group_of(plane).nodes[glint_bsdf.SCRIPT_NODE].inputs["Width"].default_value == 64


def test_painting_the_image_bakes_again(scene, plane):
    (old,) = prepare_scene(scene)["baked"]
    image = map_of(group_of(plane))
    pixels = np.tile(np.float32([0.5, 0.5, 1, 1]), 32 * 32)
    image.pixels.foreach_set(pixels)
    (new,) = prepare_scene(scene)["baked"]
    assert new != old and shown_table(group_of(plane)) == new


def test_a_failed_call_does_not_hide_that_another_image_changed(scene, plane, flake_map, tmp_path):
    other = write_flake_map(tmp_path / "other.png", 16)
    plane.data.materials.append(create_glint_material("Other", other))
    old = prepare_scene(scene)["baked"]
    write_flake_map(flake_map, 64)
    other.write_text("no image", encoding="utf-8")
    assert "other.png" in refusal(scene, MapError)
    write_flake_map(other, 16)
    prepare_scene(scene)
    script = group_of(plane).nodes[glint_bsdf.SCRIPT_NODE].inputs
    assert script["Table"].default_value not in old and script["Width"].default_value == 64


def test_a_deleted_table_is_baked_again(scene, plane, blend):
    (path,) = prepare_scene(scene)["baked"]
    next(blend.iterdir()).unlink()
    assert prepare_scene(scene)["baked"] == [path] and len(tables(blend)) == 1


def test_materials_on_one_map_share_one_table(scene, plane, flake_map, blend):
    plane.data.materials.append(create_glint_material("Rough", flake_map, roughness=0.5))
    plane.data.materials.append(create_glint_material("GGX", flake_map, distribution="GGX"))
    report = prepare_scene(scene)
    assert len(report["baked"]) == 1 and report["reused"] == report["baked"] and len(tables(blend)) == 1
    assert group_of(plane, 0) == group_of(plane, 1) != group_of(plane, 2)
    assert {shown_table(group_of(plane, slot)) for slot in range(3)} == set(report["baked"])


def test_each_way_of_reading_a_map_has_its_own_table(scene, plane, flake_map, blend):
    plane.data.materials.append(create_glint_material("Closest", flake_map, interpolation="CLOSEST"))
    plane.data.materials.append(create_glint_material("DirectX", flake_map, convention="DIRECTX"))
    assert len(prepare_scene(scene)["baked"]) == 3 == len(tables(blend))


# --- where tables go ---


def test_tables_of_an_unsaved_file_go_to_the_users_folder_and_later_beside_the_file(scene, flake_map, tmp_path):
    cycles.add_camera(scene)  # near: no counts are needed
    plane = cycles.add_plane(scene, material=create_glint_material("Sparkle", flake_map))
    folder = table_folder()
    assert tmp_path not in folder.parents
    before = set(tables(folder))
    (path,) = prepare_scene(scene)["baked"] or prepare_scene(scene)["reused"]
    name = path.rpartition("/")[2].rpartition("\\")[2]
    assert name in tables(folder) and len(set(tables(folder)) - before) <= 1
    save(tmp_path / "later.blend")
    report = prepare_scene(scene)
    assert list(tables(tmp_path / TABLE_FOLDER_NAME)) == [name]
    assert report["baked"] == [str(tmp_path / TABLE_FOLDER_NAME / name)] == [shown_table(group_of(plane))]


def test_a_folder_that_cannot_be_written_is_refused(scene, plane, blend):
    blend.touch()  # a file where the folder should be: no permission makes it a folder
    sentence = refusal(scene, TableError)
    assert str(blend) in sentence and "save the .blend file in a folder you may write to" in sentence


def test_a_file_prepared_in_a_writable_folder_still_is_when_moved_to_a_read_only_one(scene, plane, blend):
    report = prepare_scene(scene)
    blend.chmod(0o500)
    try:
        assert prepare_scene(scene)["reused"] == report["baked"]
    finally:
        blend.chmod(0o700)


# --- what is prepared ---


def test_a_scene_without_glints_is_left_alone(scene, blend):
    cycles.add_plane(scene, material=bpy.data.materials.new("Plain"))
    scene.cycles.shading_system = False
    before = state(scene)
    report = prepare_scene(scene)
    assert state(scene) == before and not tables(blend)
    assert not any(report[name] for name in ("hints", "skipped_lights", "baked", "reused", "warnings"))
    assert glint_lights.NAME not in bpy.data.node_groups


def test_an_object_hidden_in_renders_is_not_baked(scene, plane, blend):
    plane.hide_render = True
    assert not prepare_scene(scene)["baked"] and not tables(blend)
    plane.hide_render = False
    assert prepare_scene(scene)["baked"]


def test_a_material_that_no_object_wears_is_not_baked(scene, flake_map, blend):
    create_glint_material("Sparkle", flake_map)
    assert not prepare_scene(scene)["baked"] and not tables(blend)


def test_a_group_without_a_map_is_not_baked(scene, blend):
    material = bpy.data.materials.new("Plain")
    material.node_tree.nodes.new("ShaderNodeGroup").node_tree = glint_bsdf.build()
    cycles.add_plane(scene, material=material)
    assert not prepare_scene(scene)["baked"]


def test_glints_inside_other_node_groups_are_found(scene, flake_map, blend):
    inner = glint_groups(create_glint_material("Sparkle", flake_map))[0]
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    outer.nodes.new("ShaderNodeGroup").node_tree = inner
    material = bpy.data.materials.new("Wrapped")
    material.node_tree.nodes.new("ShaderNodeGroup").node_tree = outer
    cycles.add_plane(scene, material=material)
    assert prepare_scene(scene)["baked"]


def test_objects_of_an_instanced_collection_are_found(scene, flake_map, blend):
    thing = cycles.add_plane(scene, material=create_glint_material("Sparkle", flake_map))
    kit = bpy.data.collections.new("Kit")
    kit.objects.link(thing)
    scene.collection.objects.unlink(thing)
    assert not prepare_scene(scene)["baked"]
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", kit
    scene.collection.objects.link(instance)
    assert prepare_scene(scene)["baked"]


def test_a_material_linked_to_the_object_instead_of_its_mesh_is_found(scene, flake_map, blend):
    thing = cycles.add_plane(scene, material=bpy.data.materials.new("Plain"))
    thing.material_slots[0].link = "OBJECT"
    thing.material_slots[0].material = create_glint_material("Sparkle", flake_map)
    assert prepare_scene(scene)["baked"]


def from_other_file(tmp_path, flake_map, *, link):
    """A prepared scene, and in it "Guest", a plane with glints that were prepared in another file."""
    guest = cycles.add_plane(bpy.context.scene, material=create_glint_material("Guest", flake_map))
    guest.name = "Guest"
    cycles.add_sun(bpy.context.scene, (1, 0, 1)).name = "Other sun"
    (tmp_path / "other").mkdir()
    file = tmp_path / "other" / "other.blend"
    save(file)
    prepare_scene(bpy.context.scene)
    save(file)

    scene = cycles.empty_scene()
    save(tmp_path / "scene.blend")
    cycles.add_sun(scene, (0, 0, 1))
    cycles.add_camera(scene)
    # Near the camera and in no mirror, these need no counts.
    scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = 0
    cycles.add_plane(scene, material=create_glint_material("Own", flake_map, interpolation="CLOSEST"))
    prepare_scene(scene)
    with bpy.data.libraries.load(str(file), link=link) as (_, wanted):
        wanted.objects = ["Guest"]
    scene.collection.objects.link(bpy.data.objects["Guest"])
    return scene, bpy.data.objects["Guest"]


def test_glints_appended_from_another_file_get_a_table_here_and_the_lights_of_this_scene(scene, flake_map, tmp_path):
    scene, guest = from_other_file(tmp_path, flake_map, link=False)
    report = prepare_scene(scene)
    group = group_of(guest)
    assert report["hints"] == ["Sun"] and not report["warnings"]
    assert shown_table(group) in report["baked"] and str(tmp_path / TABLE_FOLDER_NAME) in shown_table(group)
    assert group.nodes[glint_bsdf.LIGHTS_NODE].node_tree == bpy.data.node_groups[glint_lights.NAME, None]


def test_glints_linked_from_another_file_keep_their_tables_and_find_the_lights_of_this_scene(
    scene, flake_map, tmp_path
):
    scene, guest = from_other_file(tmp_path, flake_map, link=True)
    table = shown_table(group_of(guest))
    report = prepare_scene(scene)
    assert len(report["reused"]) == 1 and not report["baked"] and shown_table(group_of(guest)) == table
    assert Path(table).is_file() and Path(table).parent == tmp_path / TABLE_FOLDER_NAME  # where Blender looks for it
    assert report["warnings"] == [] and len(report["hints_by_material"]) == 2


def test_a_file_moved_with_its_tables_bakes_nothing(scene, plane, blend, tmp_path):
    prepare_scene(scene)
    save(tmp_path / "scene.blend")
    (tmp_path / "moved").mkdir()
    for name in ("scene.blend", TABLE_FOLDER_NAME):
        (tmp_path / name).rename(tmp_path / "moved" / name)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "moved" / "scene.blend"))
    report = prepare_scene(bpy.context.scene)
    (path,) = report["reused"]
    assert not report["baked"] and str(tmp_path / "moved") in path
    assert shown_table(group_of(bpy.data.objects["Mesh"])) == path


# --- warnings and refusals ---


def warnings(scene) -> str:
    return " ".join(prepare_scene(scene)["warnings"])


def test_a_texture_size_limit_is_warned_about_only_where_it_works(scene, plane):
    scene.cycles.texture_limit_render = "128"
    assert not warnings(scene)
    scene.render.use_simplify = True
    assert "Simplify" in warnings(scene) and "No Limit" in warnings(scene)
    scene.cycles.texture_limit_render = "OFF"
    assert not warnings(scene)


def test_a_gpu_is_warned_about_because_it_holds_too_few_closures(scene, plane):
    assert not warnings(scene)
    scene.cycles.device = "GPU"
    assert "rendered by nodes" in warnings(scene)


def test_another_engine_is_warned_about(scene, plane):
    scene.render.engine = "BLENDER_EEVEE"
    assert not warnings(scene)
    scene.render.engine = "BLENDER_WORKBENCH"
    assert "BLENDER_WORKBENCH" in warnings(scene) and "Cycles or EEVEE" in warnings(scene)


def test_a_blender_without_osl_is_told_and_bakes_nothing(scene, plane, blend, monkeypatch):
    take_osl_away(monkeypatch)
    scene.cycles.shading_system = False
    report = prepare_scene(scene)
    assert "Open Shading Language" in report["warnings"][0] and report["osl"] is False
    assert not report["baked"] and not tables(blend) and not scene.cycles.shading_system


def test_a_missing_image_is_refused_while_it_has_no_table(scene, plane, flake_map):
    flake_map.unlink()
    map_of(group_of(plane)).reload()
    assert "flakes.png" in refusal(scene, MapError)


def test_a_missing_image_is_warned_about_while_its_table_is_there(scene, plane, flake_map):
    (path,) = prepare_scene(scene)["baked"]
    flake_map.unlink()
    map_of(group_of(plane)).reload()
    for _ in range(2):
        report = prepare_scene(scene)
        assert report["reused"] == [path] and len(report["warnings"]) == 1
        assert "flakes.png" in report["warnings"][0] and "External Data" in report["warnings"][0]
    write_flake_map(flake_map)
    assert prepare_scene(scene)["warnings"] == []


def test_an_image_that_went_bad_is_refused(scene, plane):
    prepare_scene(scene)
    map_of(group_of(plane)).source = "MOVIE"
    assert "movie" in refusal(scene, MapError)


def test_mip_levels_of_image_textures_are_baked_too_and_once(scene, blend):
    image = bpy.data.images.new("Checks", 8, 4)
    tree = cycles.emission_material()[0].node_tree
    image_choice.add_node(tree, image, filter="BILINEAR")
    assert prepare_scene(scene)["mip_levels"] == [] and not tables(blend)

    node = next(node for node in tree.nodes if node.type == "GROUP")
    node.inputs["Filter"].default_value = "Mipmap"
    scene.cycles.shading_system = False
    assert prepare_scene(scene)["mip_levels"] == ["Checks"]
    assert scene.cycles.shading_system, "mip levels are read by OSL"
    assert prepare_scene(scene)["mip_levels"] == []
