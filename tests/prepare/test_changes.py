"""What changed since a scene was prepared: each kind is a sentence until it is prepared again; no more is said."""

import hashlib
import os
import shutil

import bpy
import numpy as np
import pytest

from glint_addon import changes_since_prepared, create_glint_material, prepare_scene
from glint_addon.bake.float_image import is_whole
from glint_addon.materials.build import bound_group
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.glint_bsdf import VERSION
from glint_addon.nodes.map_binding import MapBinding, map_of
from glint_addon.nodes.map_choices import FACETS_NODE, IMAGE_NODE, NORMAL_NODE
from glint_addon.paths import TABLE_FOLDER_NAME
from glint_addon.prepare.changes import NOT_PREPARED, OTHER_VERSION, PREPARED
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.lights.test_emitters import add_bulb

SIDE = 32  # texels


@pytest.fixture
def folder(tmp_path):
    """Where the .blend file is."""
    return tmp_path


@pytest.fixture
def prepared(scene, folder):
    """A square of flakes under a sun and a lamp, in a saved file, prepared."""
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    material = create_glint_material("Sparkle", write_flake_map(folder / "flakes.png", SIDE), interpolation="CLOSEST")
    map_of(glint_groups(material)[0]).filepath = "//flakes.png"
    cycles.add_plane(scene, material=material, repeats=8.0).name = "Square"
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    add_lamp(scene, "Lamp")
    cycles.add_camera(scene, (0, 0, 4), width=2.0)
    prepare_scene(scene)
    return scene


def add_lamp(scene, name, kind="POINT"):
    lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, kind))
    lamp.data.energy, lamp.location = 50.0, (0.2, 0.1, 2.0)
    if kind == "POINT":
        lamp.data.shadow_soft_size = 0.02
    scene.collection.objects.link(lamp)
    return lamp


def group():
    return glint_groups(bpy.data.materials["Sparkle"])[0]


def texture():
    return group().nodes[IMAGE_NODE]


def use_normal_map(normal_map, **settings):
    """As Change Normal Map does."""
    (node,) = [node for node in bpy.data.materials["Sparkle"].node_tree.nodes if node.bl_idname == "ShaderNodeGroup"]
    node.node_tree = bound_group(normal_map, MapBinding(**{"interpolation": "CLOSEST"} | settings))


# --- what is told ---


def a_sun_more(scene, folder):
    add_lamp(scene, "Second", "SUN")
    return 'Light "Second" was added.'


def a_lamp_less(scene, folder):
    bpy.data.objects.remove(bpy.data.objects["Lamp"])
    return 'Light "Lamp" is gone.'


def a_sun_that_is_a_point_now(scene, folder):
    bpy.data.objects["Sun"].data.type = "POINT"
    return 'Light "Sun" is a point light now, not a sun.'


def a_lamp_that_is_switched_off(scene, folder):
    bpy.data.objects["Lamp"].data.energy = 0.0
    return 'Light "Lamp" needs no glints now: its energy is zero or negative.'


def a_lamp_that_is_hidden(scene, folder):
    bpy.data.objects["Lamp"].hide_render = True
    return 'Light "Lamp" needs no glints now: hidden in renders.'


def a_lamp_that_is_linked_to_some_objects(scene, folder):
    receivers = bpy.data.collections.new("Receivers")
    bpy.data.objects["Lamp"].light_linking.receiver_collection = receivers
    return 'Light "Lamp" was changed.'


def a_bulb(scene, folder):
    add_bulb(scene, 0.05)
    return 'Emissive object "Bulb" was added.'


def a_lamp_in_an_instance(scene, folder):
    inside = bpy.data.collections.new("Inside")
    inner = add_lamp(scene, "Inner")
    scene.collection.objects.unlink(inner)
    inside.objects.link(inner)
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", inside
    scene.collection.objects.link(empty)
    return 'Light "Inner" in "Empty" was added.'


def a_sky_with_a_sun(scene, folder):
    bpy.data.objects.remove(bpy.data.objects["Sun"])
    scene.world = bpy.data.worlds.new("Sky")
    tree = scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    return 'World "Sky" was added.'


def a_second_material(scene, folder):
    material = create_glint_material("Other", write_flake_map(folder / "other.png", SIDE))
    cycles.add_plane(scene, material=material)
    return 'Material "Other" shows glints now.'


def a_second_object(scene, folder):
    cycles.add_plane(scene, material=bpy.data.materials["Sparkle"]).name = "Second"
    return 'Object "Second" shows glints now.'


def a_second_lobe(scene, folder):
    tree = bpy.data.materials["Sparkle"].node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = bound_group(folder / "flakes.png", MapBinding(distribution="GGX"))
    return 'Material "Sparkle" has 2 Glint BSDFs now, not 1.'


def another_interpolation(scene, folder):
    use_normal_map(folder / "flakes.png", interpolation="LINEAR")
    return 'Interpolation of the map of "Sparkle" is LINEAR now, not CLOSEST.'


def another_interpolation_inside_the_group(scene, folder):
    texture().interpolation = "Linear"
    return 'Interpolation of the map of "Sparkle" is LINEAR now, not CLOSEST.'


def another_extension_inside_the_group(scene, folder):
    texture().extension = "CLIP"
    return 'Extension of the map of "Sparkle" is CLIP now, not REPEAT.'


def another_convention_inside_the_group(scene, folder):
    group().nodes[NORMAL_NODE].convention = "DIRECTX"
    return 'Convention of the map of "Sparkle" is DIRECTX now, not OPENGL.'


def another_distribution_inside_the_group(scene, folder):
    group().nodes[FACETS_NODE].distribution = "GGX"
    return 'Distribution of the map of "Sparkle" is GGX now, not BECKMANN.'


def another_image_inside_the_group(scene, folder):
    image = bpy.data.images.load(str(write_flake_map(folder / "other.png", SIDE)))
    image.colorspace_settings.name = "Non-Color"
    texture().image = image
    return 'Material "Sparkle" reads the map "other.png" now, not "flakes.png".'


def an_overwritten_file(scene, folder):
    write_flake_map(folder / "flakes.png", 2 * SIDE)
    return 'The pixels of the map "flakes.png" changed.'


def an_overwritten_file_that_is_reloaded(scene, folder):
    write_flake_map(folder / "flakes.png", 2 * SIDE)
    map_of(group()).reload()
    return 'The pixels of the map "flakes.png" changed.'


def a_painted_map(scene, folder):
    image = map_of(group())
    pixels = np.array(image.pixels[:])
    pixels[:8] = [0.6, 0.5, 0.9, 1.0] * 2
    image.pixels.foreach_set(pixels.astype(np.float32))
    return 'The pixels of the map "flakes.png" changed.'


def a_rougher_facet(scene, folder):
    (node,) = [each for each in bpy.data.materials["Sparkle"].node_tree.nodes if each.bl_idname == "ShaderNodeGroup"]
    node.inputs["Roughness"].default_value = 0.3
    return 'Roughness or Strength of "Sparkle" changed.'


def tables_that_are_gone(scene, folder):
    for file in (folder / TABLE_FOLDER_NAME).iterdir():
        file.unlink()
    return f'Tables of the map "flakes.png" are gone from {folder / TABLE_FOLDER_NAME}.'


def a_table_that_is_cut(scene, folder):
    largest = max((folder / TABLE_FOLDER_NAME).iterdir(), key=lambda file: file.stat().st_size)
    largest.write_bytes(largest.read_bytes()[: largest.stat().st_size // 2])
    return 'Tables of the map "flakes.png" are damaged.'


def the_gpu(scene, folder):
    scene.cycles.device = "GPU"
    return "Device: GPU now, CPU before."


def osl_switched_off(scene, folder):
    scene.cycles.shading_system = False
    return "Open Shading Language: off now, on before."


def simplify(scene, folder):
    scene.render.use_simplify = True
    scene.cycles.texture_limit_render = "128"
    return "The texture limit of Simplify: 128 at 1 now, no limit before."


def another_engine(scene, folder):
    scene.render.engine = "BLENDER_WORKBENCH"
    return "Render Engine: BLENDER_WORKBENCH now, CYCLES before."


def a_view_layer_more(scene, folder):
    scene.view_layers.new("Second")
    return "View layers: ViewLayer, Second now, ViewLayer before."


def a_material_override(scene, folder):
    scene.view_layers[0].material_override = bpy.data.materials["Sparkle"]
    return "The material override: Sparkle now, none before."


def a_longer_animation(scene, folder):
    scene.frame_end = 300
    return "The frame range: 1 to 300 now, 1 to 250 before."


def motion_blur(scene, folder):
    scene.render.use_motion_blur = True
    return "Motion blur: 0.5 CENTER now, off before."


def a_camera_more(scene, folder):
    scene.collection.objects.link(bpy.data.objects.new("Close", bpy.data.cameras.new("Close")))
    return "Cameras: Camera, Close now, Camera before."


def a_much_larger_picture(scene, folder):
    scene.render.resolution_x = scene.render.resolution_y = 128
    return "Pixels of the picture: 16384 now, 1024 before."


TOLD = [
    a_sun_more, a_lamp_less, a_sun_that_is_a_point_now, a_lamp_that_is_switched_off, a_lamp_that_is_hidden,
    a_lamp_that_is_linked_to_some_objects, a_bulb, a_lamp_in_an_instance, a_sky_with_a_sun, a_second_material,
    a_second_object, a_second_lobe, another_interpolation, another_interpolation_inside_the_group,
    another_extension_inside_the_group, another_convention_inside_the_group, another_distribution_inside_the_group,
    another_image_inside_the_group, an_overwritten_file, an_overwritten_file_that_is_reloaded, a_painted_map,
    a_rougher_facet, tables_that_are_gone, a_table_that_is_cut, the_gpu, osl_switched_off, simplify, another_engine,
    a_view_layer_more, a_material_override, a_longer_animation, motion_blur, a_camera_more, a_much_larger_picture,
]


@pytest.mark.parametrize("change", TOLD)
def test_what_changed_is_told_until_the_scene_is_prepared_again(prepared, folder, change):
    assert changes_since_prepared(prepared) == []
    sentence = change(prepared, folder)
    bpy.context.view_layer.update()
    assert sentence in changes_since_prepared(prepared)
    prepare_scene(prepared)
    assert changes_since_prepared(prepared) == []


# --- what is not told: drivers follow it, or it does no harm ---


def a_light_that_moves(scene, folder):
    bpy.data.objects["Lamp"].location.x = 0.7


def a_light_that_grows(scene, folder):
    bpy.data.objects["Lamp"].data.shadow_soft_size = 0.04
    bpy.data.objects["Lamp"].data.energy = 70.0


def another_frame(scene, folder):
    scene.frame_set(7)


def another_name_of_the_scene(scene, folder):
    scene.name = "Renamed"


def another_colour(scene, folder):
    (node,) = [each for each in bpy.data.materials["Sparkle"].node_tree.nodes if each.bl_idname == "ShaderNodeGroup"]
    node.inputs["Color"].default_value = (1, 0, 0, 1)


def a_plain_object(scene, folder):
    cycles.add_plane(scene, material=bpy.data.materials.new("Plain"))


def other_samples(scene, folder):
    scene.cycles.samples = 64


def a_slightly_larger_picture(scene, folder):
    scene.render.resolution_percentage = 150


def a_lamp_of_another_scene_in_an_instance(scene, folder):
    """The scene that keeps the collection is not the one whose lights are looked for."""
    a_lamp_in_an_instance(scene, folder)
    assets = bpy.data.scenes.new("Assets")
    assets.collection.children.link(bpy.data.collections["Inside"])
    bpy.context.view_layer.update()
    assert "Inner in Empty" in prepare_scene(scene)["hints"]


def its_folder_moved(scene, folder):
    bpy.ops.wm.save_mainfile()
    (folder / "elsewhere").mkdir()
    for name in ("flakes.png", TABLE_FOLDER_NAME):
        (folder / name).rename(folder / "elsewhere" / name)
    (folder / "scene.blend").rename(folder / "elsewhere" / "scene.blend")
    bpy.ops.wm.open_mainfile(filepath=str(folder / "elsewhere" / "scene.blend"))


def its_folder_copied(scene, folder):
    """As people copy: the copies are younger."""
    bpy.ops.wm.save_mainfile()
    shutil.copytree(folder, folder / "copy", copy_function=shutil.copyfile)
    shutil.rmtree(folder / TABLE_FOLDER_NAME)
    os.utime(folder / "copy" / "flakes.png", (1, 1))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "copy" / "scene.blend"))


def the_file_saved_again(scene, folder):
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)


@pytest.mark.parametrize("change", [
    a_light_that_moves, a_light_that_grows, another_frame, another_name_of_the_scene, another_colour, a_plain_object,
    other_samples, a_slightly_larger_picture, a_lamp_of_another_scene_in_an_instance, its_folder_moved,
    its_folder_copied, the_file_saved_again,
])
def test_nothing_is_told_of_what_does_no_harm(prepared, folder, change):
    change(prepared, folder)
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    assert changes_since_prepared(scene) == []


def test_a_scene_that_was_not_prepared_says_only_that(scene, tmp_path):
    assert changes_since_prepared(scene) == []
    cycles.add_plane(scene, material=create_glint_material("Sparkle", write_flake_map(tmp_path / "flakes.png", SIDE)))
    assert changes_since_prepared(scene) == [NOT_PREPARED]


def test_a_scene_of_another_version_says_only_that(prepared):
    version = f'"version": {VERSION}'
    text = prepared[PREPARED].partition(" ")[2].replace(version, f'"version": {VERSION - 1}')
    prepared[PREPARED] = f"{hashlib.sha256(text.encode()).hexdigest()[:16]} {text}"
    assert changes_since_prepared(prepared) == [OTHER_VERSION]


def test_a_map_shown_as_colour_is_followed_when_it_is_painted(scene, tmp_path):
    """The group reads a copy; what is told, and baked, is what the user's own image holds now."""
    image = bpy.data.images.new("Painted", SIDE, SIDE)
    pixels = np.tile(np.float32([0.5, 0.5, 1.0, 1.0]), (SIDE * SIDE, 1))
    pixels[::3, 0] = 0.6
    image.pixels.foreach_set(pixels.ravel())
    cycles.add_plane(scene, material=create_glint_material("Sparkle", image, interpolation="CLOSEST"))
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 4), width=2.0)
    first = prepare_scene(scene)["baked"]
    assert map_of(group()) == image and texture().image != image and changes_since_prepared(scene) == []
    pixels[::5, 1] = 0.4
    image.pixels.foreach_set(pixels.ravel())
    assert changes_since_prepared(scene) == ['The pixels of the map "Painted" changed.']
    second = prepare_scene(scene)["baked"]
    assert second and not set(first) & set(second) and changes_since_prepared(scene) == []
    assert not image.colorspace_settings.is_data and np.allclose(image.pixels[:], pixels.ravel(), atol=0.5 / 255)


def test_damaged_tables_are_baked_again_and_the_report_says_so(prepared, folder):
    files = {file: file.read_bytes() for file in (folder / TABLE_FOLDER_NAME).iterdir()}
    for damage in (lambda data: b"", lambda data: data[: len(data) // 2], lambda data: bytes(len(data))):
        for file, data in files.items():
            file.write_bytes(damage(data))
            report = prepare_scene(prepared)
            assert {str(file)} == set(report["baked"]) and is_whole(file) and file.stat().st_size == len(data)
            assert f"Table {file.name} is damaged, or of an older version: it is baked again." in report["notes"]
    assert prepare_scene(prepared)["notes"] == []
