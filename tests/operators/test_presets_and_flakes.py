"""Ready materials, and flakes of images and generated maps, by operators."""

import bpy
import numpy as np
import pytest

from glint_addon.materials.find import glint_groups
from glint_addon.materials.presets import presets
from glint_addon.nodes.glint_bsdf import group_binding
from glint_addon.operators.add_preset import preset_items
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

KIND = '{"coverage": 0.5, "extent": 0.03, "populations": [{"size": 0.001}]}'


@pytest.fixture
def plane(registered):
    scene = cycles.empty_scene()
    thing = cycles.add_plane(scene)
    bpy.context.view_layer.objects.active = thing
    return thing


def binding_of(thing):
    (group,) = glint_groups(thing.active_material)
    return group_binding(group)


def generated(**settings):
    bpy.ops.glint.generate_map(kind="FLAKES", resolution="64", settings=KIND, **settings)
    return bpy.context.scene.glint.normal_map


def picture(name):
    image = bpy.data.images.new(name, 16, 16, is_data=True)
    image.pixels.foreach_set(np.ones(16 * 16 * 4, np.float32))
    return image


def test_a_preset_is_one_press(plane):
    assert [item[0] for item in preset_items(None, None)] == list(presets())
    assert bpy.ops.glint.add_preset(preset="Metallic Red") == {"FINISHED"}
    material = plane.active_material
    assert material.name == "Metallic Red" and glint_groups(material)
    assert "glint_uv_metres" in plane


def test_a_turned_metal_says_which_uvs_it_wants(plane, capsys):
    bpy.ops.glint.add_preset(preset="Brushed Steel")
    assert "Radial UVs" not in capsys.readouterr().out
    bpy.ops.glint.add_preset(preset="Brushed Aluminium")
    assert "give it UVs around its axis (Object > Radial UVs (Glint)), then press Prepare" in capsys.readouterr().out


def test_a_generated_map_brings_its_flakes_and_its_size(plane):
    image = generated()
    assert bpy.ops.glint.add_material() == {"FINISHED"}
    binding = binding_of(plane)
    assert binding.image == image and binding.interpolation == "CLOSEST"
    assert binding.presence == image["glint_generated_presence"] and binding.flake_color is None
    scale = next(node for node in plane.active_material.node_tree.nodes if node.name == "Glint Scale")
    assert scale.inputs["Scale"].default_value == pytest.approx(0.03)


def test_a_generated_map_that_gets_colours_or_waves_is_read_as_it_is_then(plane):
    image = generated()
    bpy.ops.glint.add_material()
    image.glint.coloring.mode = "SPREAD"
    binding = binding_of(plane)
    assert binding.flake_color == image["glint_generated_color"] and binding.presence is not None
    node = next(node for node in plane.active_material.node_tree.nodes if node.name == "Glint BSDF")
    assert node.inputs["Base"].is_linked and node.inputs["Vector"].is_linked
    image.glint.kind = "BUMPS"
    binding = binding_of(plane)
    assert (binding.interpolation, binding.presence, binding.flake_color) == ("LINEAR", None, None)
    image.glint.kind = "FLAKES"
    binding = binding_of(plane)
    assert binding.interpolation == "CLOSEST" and binding.presence is not None
    node = next(node for node in plane.active_material.node_tree.nodes if node.name == "Glint BSDF")
    assert node.inputs["Base"].links[0].from_node.bl_idname == "ShaderNodeBsdfPrincipled"


def test_colours_of_the_users_own_stay(plane):
    image = generated()
    own = bpy.data.images.new("Own", 64, 64)
    bpy.ops.glint.add_material(flake_color="Own")
    image.glint.coloring.mode = "SPREAD"
    assert binding_of(plane).flake_color == own


def test_images_of_flakes_are_chosen_by_name(plane, tmp_path):
    picture("Where"), picture("Colors")
    path = str(write_flake_map(tmp_path / "flakes.png", 16))
    bpy.ops.glint.add_material(filepath=path, interpolation="CLOSEST", presence="Where", flake_color="Colors")
    binding = binding_of(plane)
    assert (binding.presence.name, binding.flake_color.name) == ("Where", "Colors")
    with pytest.raises(RuntimeError, match='no image named "Missing"'):
        bpy.ops.glint.add_material(filepath=path, interpolation="CLOSEST", presence="Missing")
    bpy.ops.glint.change_map(image="flakes.png", interpolation="CLOSEST", presence="Where")
    binding = binding_of(plane)
    assert binding.presence.name == "Where" and binding.flake_color is None


def test_the_surface_is_chosen_with_its_numbers(plane, tmp_path):
    path = str(write_flake_map(tmp_path / "flakes.png", 16))
    bpy.ops.glint.add_material(filepath=path, surface="METAL", metal="Gold")
    node = next(node for node in plane.active_material.node_tree.nodes if node.name == "Glint BSDF")
    assert node.inputs["Base Color"].default_value[0] > 2 * node.inputs["Base Color"].default_value[2]
    bpy.ops.glint.add_material(filepath=path, surface="CONDUCTOR", metal="CUSTOM", ior_rgb=(1, 2, 3))
    node = next(node for node in plane.active_material.node_tree.nodes if node.name == "Glint BSDF")
    assert node.inputs["IOR"].default_value[:] == (1, 2, 3)
    bpy.ops.glint.add_material(filepath=path, surface="DIELECTRIC", ior=1.31)
    node = next(node for node in plane.active_material.node_tree.nodes if node.name == "Glint BSDF")
    assert node.inputs["IOR"].default_value == pytest.approx(1.31) and binding_of(plane).distribution == "GGX"
