"""Presets: data that make a material without a map; what is given takes the place of the preset's values."""

import bpy
import pytest

import glint_addon
from glint_addon import create_glint_material, paths
from glint_addon.errors import GlintError, MapError
from glint_addon.materials.find import glint_groups
from glint_addon.materials.presets import presets
from glint_addon.nodes.glint_bsdf import group_binding
from tests.helpers.extension import data_names, write_flake_map

PAINT = "Metallic Red"


def node_of(material, name):
    return next(node for node in material.node_tree.nodes if node.name.startswith(name))


def test_car_paint_is_a_group_of_base_flakes_and_coat(scene):
    material = create_glint_material("Paint", preset=PAINT)
    paint = node_of(material, "Glint Car Paint")
    (group,) = glint_groups(material)
    preset = glint_addon.presets()[PAINT]
    inner = {node.name: node for node in paint.node_tree.nodes}
    assert inner["Flakes"].node_tree == group and group_binding(group).presence is not None
    assert inner["Flakes"].inputs["Base"].links[0].from_node == inner["Base"]
    assert paint.inputs["Base Color"].default_value[:3] == pytest.approx(preset.paint["Base Color"])
    assert paint.inputs["Flake Color"].default_value[:3] == pytest.approx(preset.glint["color"])
    assert paint.inputs["Flake Roughness"].default_value == pytest.approx(preset.glint["roughness"])
    assert [node.bl_idname for node in material.node_tree.nodes].count("ShaderNodeGroup") == 2  # and Glint Scale
    scale = paint.inputs["Vector"].links[0].from_node
    assert scale.inputs["Scale"].default_value == pytest.approx(preset.scale)
    assert paint.outputs["BSDF"].links[0].to_node.bl_idname == "ShaderNodeOutputMaterial"


@pytest.mark.parametrize("name", [PAINT, "Brushed Steel"])
def test_materials_of_one_preset_share_its_map(scene, name):
    one, other = (create_glint_material("One", preset=name) for _ in range(2))
    assert glint_groups(one) == glint_groups(other)
    count = len(bpy.data.images)
    create_glint_material("One", preset=name)
    assert len(bpy.data.images) == count


def test_an_edited_map_is_not_taken_for_the_presets(scene):
    (group,) = glint_groups(create_glint_material("Paint", preset=PAINT))
    image = group_binding(group).image
    image.pixels[0] = 0.3
    image.update()
    (other,) = glint_groups(create_glint_material("Paint", preset=PAINT))
    assert group_binding(other).image != image


def test_what_is_given_takes_the_place_of_the_presets_values(scene, tmp_path):
    path = write_flake_map(tmp_path / "flakes.png", 16)
    material = create_glint_material("Paint", path, preset=PAINT, roughness=0.4, scale=0.5, color=(0.1, 0.2, 0.3))
    paint = node_of(material, "Glint Car Paint")
    assert paint.inputs["Flake Roughness"].default_value == pytest.approx(0.4)
    assert paint.inputs["Flake Color"].default_value[:3] == pytest.approx((0.1, 0.2, 0.3))
    assert paint.inputs["Vector"].links[0].from_node.inputs["Scale"].default_value == pytest.approx(0.5)
    (group,) = glint_groups(material)
    assert group_binding(group).image.name == "flakes.png" and group_binding(group).presence is None


def test_an_unknown_preset_is_refused_with_those_that_there_are(scene):
    before = data_names()
    with pytest.raises(MapError, match=f'no preset "Ultraviolet": use one of .*{PAINT}'):
        create_glint_material("Paint", preset="Ultraviolet")
    with pytest.raises(MapError, match="neither a normal map nor a preset"):
        create_glint_material("Paint")
    assert data_names() == before


@pytest.mark.parametrize("name", glint_addon.presets())
def test_every_preset_makes_a_material_and_describes_itself(scene, name):
    preset = glint_addon.presets()[name]
    assert preset.name == name and preset.category and preset.description
    assert glint_groups(create_glint_material(name, preset=name))


@pytest.mark.parametrize("contents", [
    "{", "[]", '{"name": "Ruby"}', '{"name": "Ruby", "map": {"generator": {"kind": "GEMS"}}}',
    '{"name": "Ruby", "category": "", "description": "", "map": {"generator": {"kind": "FLAKES"}}, "glitter": 1}',
])
def test_a_file_that_is_no_preset_is_named(tmp_path, monkeypatch, contents):
    (tmp_path / "ruby.json").write_text(contents)
    monkeypatch.setattr(paths, "preset_folder", lambda: tmp_path)
    with pytest.raises(GlintError, match=r"Preset ruby.json cannot be read \(.*reinstall Glint"):
        presets.__wrapped__()


def test_a_preset_that_fails_leaves_nothing_behind(scene):
    before = data_names()
    with pytest.raises(MapError, match="out of range"):
        create_glint_material("Paint", preset=PAINT, roughness=2.0)
    assert data_names() == before


def principled(material):
    return next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")


def test_what_lies_beneath_facets_is_added_to_their_light(scene):
    """Facets of snow cover all of it: the Principled BSDF with its subsurface is beneath them, and does not reflect."""
    material = create_glint_material("Snow", preset="Fresh Snow")
    base, preset = principled(material), glint_addon.presets()["Fresh Snow"]
    total = base.outputs["BSDF"].links[0].to_node
    assert total.bl_idname == "ShaderNodeAddShader"
    assert {link.from_node.name[:5] for socket in total.inputs for link in socket.links} == {"Glint", "Princ"}
    assert total.outputs[0].links[0].to_node.bl_idname == "ShaderNodeOutputMaterial"
    assert base.inputs["Subsurface Weight"].default_value == pytest.approx(preset.base["Subsurface Weight"]) != 0.0
    assert base.inputs["Specular IOR Level"].default_value == 0
    normal = base.inputs["Normal"].links[0].from_node
    (group,) = glint_groups(material)
    assert normal.inputs["Strength"].default_value == pytest.approx(preset.base["Normal"])
    texture = normal.inputs["Color"].links[0].from_node
    assert texture.image == group_binding(group).image and texture.interpolation == "Closest"
    assert texture.inputs["Vector"].links[0].from_node.name.startswith("Glint Scale")


def test_colours_may_belong_to_the_base(scene):
    material = create_glint_material("Sand", preset="Sand")
    texture = principled(material).inputs["Base Color"].links[0].from_node
    (group,) = glint_groups(material)
    assert texture.image.name.startswith("Sand Color")
    assert group_binding(group).flake_color is None


def test_a_map_of_ones_own_leaves_out_the_colours_of_the_presets_map(scene, tmp_path):
    path = write_flake_map(tmp_path / "flakes.png", 16)
    assert not principled(create_glint_material("Sand", path, preset="Sand")).inputs["Base Color"].is_linked


def test_scratches_have_no_presence_in_a_material(scene):
    """Their map is read between texels, where no texel says what is there."""
    (group,) = glint_groups(create_glint_material("Chrome", preset="Scratched Chrome"))
    binding = group_binding(group)
    assert binding.presence is None and binding.interpolation == "LINEAR"


PROMISED = {
    "Silver Metallic", "Metallic Red", "Blue Pearl", "Candy Apple", "Glitter Nail Polish", "Hologram Glitter",
    "Brushed Steel", "Brushed Aluminium", "Scratched Chrome", "Swirl Marks", "Hammered Gold", "Anodised Titanium",
    "Cast Iron", "Fresh Snow", "Old Snow", "Frost", "Sand", "Sugar", "Mica Granite", "Sequin Fabric",
    "Christmas Bauble",
}


def test_the_presets_that_were_promised_are_there():
    assert set(glint_addon.presets()) >= PROMISED
