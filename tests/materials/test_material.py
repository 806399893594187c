"""create_glint_material: its arguments reach the nodes; what cannot be is one sentence and leaves nothing behind."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material
from glint_addon.errors import GlintError, MapError, ShaderError
from glint_addon.materials.find import glint_groups, is_glint_material
from glint_addon.materials.replace_group import replace_group
from glint_addon.materials.surface_values import WORDS
from glint_addon.nodes import glint_bsdf
from glint_addon.nodes.map_binding import MapBinding, map_of
from glint_addon.nodes.map_choices import CONVENTION, DISTRIBUTION, EXTENSION, INTERPOLATION, SURFACE
from glint_addon.nodes.surface_kinds import IORS, KINDS, METALS
from tests.helpers.extension import data_names, write_flake_map

SIZE = 16


@pytest.fixture
def flake_map(scene, tmp_path):
    return write_flake_map(tmp_path / "flakes.png", SIZE)


def surface(material):
    """The Glint BSDF node of a material."""
    return next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")


def float_image(name="Float map", fill=(0.5, 0.5, 1.0)):
    """A generated image that may hold any number."""
    image = bpy.data.images.new(name, 4, 4, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.tile(np.float32([*fill, 1]), (16, 1)).ravel())
    return image


def refusal(*arguments, kind=MapError, **settings) -> str:
    """The one sentence of the refusal; no data-block may be left or lost."""
    before = data_names()
    with pytest.raises(kind) as error:
        create_glint_material(*arguments, **settings)
    assert data_names() == before
    sentence = str(error.value)
    # Thing and cause, then the next step.
    thing, colon, step = sentence.rpartition(": ")
    assert thing and colon and len(step) > 5 and sentence.endswith(".") and "\n" not in sentence, sentence
    return sentence


def test_the_defaults_are_those_of_the_documented_signature(flake_map):
    material = create_glint_material("Sparkle", flake_map)
    (group,) = glint_groups(material)
    assert material.name == "Sparkle" and is_glint_material(material)
    node = surface(material)
    assert node.inputs["Roughness"].default_value == pytest.approx(0.1)
    assert node.inputs["Strength"].default_value == 1.0 and node.inputs["Color"].default_value[:] == (1, 1, 1, 1)
    assert glint_bsdf.group_binding(group) == MapBinding(
        bpy.data.images["flakes.png"], "LINEAR", "OPENGL", "BECKMANN", "")
    assert node.outputs["BSDF"].links[0].to_node.bl_idname == "ShaderNodeOutputMaterial"


@pytest.mark.parametrize("distribution", DISTRIBUTION.identifiers)
@pytest.mark.parametrize("interpolation", INTERPOLATION.identifiers)
@pytest.mark.parametrize("convention", CONVENTION.identifiers)
def test_the_arguments_reach_both_the_shader_and_the_native_nodes(flake_map, distribution, interpolation, convention):
    material = create_glint_material(
        "m", str(flake_map), roughness=0.3, distribution=distribution, interpolation=interpolation,
        convention=convention, color=(0.1, 0.2, 0.3), strength=2.0, uv_map="Other",
    )
    node, nodes = surface(material), glint_groups(material)[0].nodes
    assert node.inputs["Roughness"].default_value == pytest.approx(0.3) and node.inputs["Strength"].default_value == 2.0
    assert node.inputs["Color"].default_value[:] == pytest.approx((0.1, 0.2, 0.3, 1))
    kinds = {inner.bl_idname: inner for inner in nodes}
    assert kinds["ShaderNodeTexImage"].interpolation == INTERPOLATION.value(interpolation).native
    assert kinds["ShaderNodeNormalMap"].convention == convention and kinds["ShaderNodeNormalMap"].uv_map == "Other"
    assert kinds["ShaderNodeBsdfAnisotropic"].distribution == distribution
    script = nodes[glint_bsdf.SCRIPT_NODE].inputs
    assert script["Linear"].default_value == (interpolation == "LINEAR")
    assert script["GGX"].default_value == (distribution == "GGX")
    assert script["TangentName"].default_value == "Other.tangent"
    assert script["SignName"].default_value == "Other.tangent_sign"
    coordinates = next(inner for inner in material.node_tree.nodes if inner.bl_idname == "ShaderNodeUVMap")
    assert coordinates.uv_map == "Other"


def test_an_image_data_block_is_as_good_as_a_path(scene):
    image = float_image()
    assert map_of(glint_groups(create_glint_material("m", image))[0]) == image


def test_the_same_name_twice_gives_two_materials_that_share_one_group(flake_map):
    one, other = (create_glint_material("Sparkle", flake_map, roughness=r) for r in (0.1, 0.2))
    assert one != other and {one.name, other.name} == {"Sparkle", "Sparkle.001"}
    assert glint_groups(one) == glint_groups(other) and len(bpy.data.images) == 1


def test_two_ways_of_reading_one_map_give_two_groups(flake_map):
    one, other = (create_glint_material("m", flake_map, interpolation=name) for name in INTERPOLATION.identifiers)
    assert glint_groups(one) != glint_groups(other) and len(bpy.data.images) == 1


def test_a_color_with_alpha_and_the_ends_of_the_ranges_are_taken(flake_map):
    material = create_glint_material("m", flake_map, roughness=0, strength=10, color=(0, 0, 0, 1))
    assert surface(material).inputs["Roughness"].default_value == 0
    assert surface(material).inputs["Strength"].default_value == 10
    material = create_glint_material("m", flake_map, roughness=1, strength=0)
    assert surface(material).inputs["Roughness"].default_value == 1
    assert surface(material).inputs["Strength"].default_value == 0


@pytest.mark.parametrize(("name", "values"), [
    ("roughness", (-0.01, 1.01, float("nan"), "rough", None)),
    ("strength", (-1, 10.5, float("inf"), "strong", None)),
])
def test_a_number_out_of_range_is_refused(flake_map, name, values):
    for value in values:
        sentence = refusal("Sparkle", flake_map, **{name: value})
        assert name.title() in sentence and "Sparkle" in sentence and str(value) in sentence


@pytest.mark.parametrize("color", [(1,), (1, 1), (1, 1, 1, 1, 1), (-0.1, 0, 0), (float("nan"), 0, 0),
                                   (float("inf"), 0, 0), "red", 0.5])
def test_what_is_no_color_is_refused(flake_map, color):
    assert "Color" in refusal("Sparkle", flake_map, color=color)


@pytest.mark.parametrize(("name", "allowed"), [
    ("distribution", DISTRIBUTION.identifiers),
    ("interpolation", INTERPOLATION.identifiers),
    ("convention", CONVENTION.identifiers),
    ("extension", EXTENSION.identifiers),
])
def test_an_unknown_choice_is_refused_with_those_there_are(flake_map, name, allowed):
    for value in ("PHONG", allowed[0].lower(), "", None):
        sentence = refusal("Sparkle", flake_map, **{name: value})
        assert str(value) in sentence and all(choice in sentence for choice in allowed)


def test_names_that_are_no_text_are_refused(flake_map):
    assert "Name 3" in refusal(3, flake_map)
    assert "UV map 3" in refusal("Sparkle", flake_map, uv_map=3)


def test_a_missing_file_is_refused(scene, tmp_path):
    file = tmp_path / "nothing.png"
    assert str(file) in refusal("Sparkle", file)
    assert "does not exist" in refusal("Sparkle", tmp_path)
    assert "does not exist" in refusal("Sparkle", "")


@pytest.mark.parametrize("content", [b"", b"this is a text", b"\x89PNG\r\n\x1a\n" + bytes(40)])
def test_a_file_that_is_no_image_is_refused(scene, tmp_path, content):
    file = tmp_path / "text.png"
    file.write_bytes(content)
    assert "text.png" in refusal("Sparkle", file)


def test_a_file_that_may_not_be_read_is_refused(flake_map):
    flake_map.chmod(0)
    try:
        flake_map.read_bytes()
    except PermissionError:
        assert "flakes.png" in refusal("Sparkle", flake_map)
    else:
        pytest.skip("an administrator may read every file")
    finally:
        flake_map.chmod(0o600)


def test_a_single_pixel_is_refused(scene):
    image = bpy.data.images.new("dot", 1, 1, is_data=True)
    assert "single pixel" in refusal("Sparkle", image)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_pixels_that_are_no_numbers_are_refused(scene, value):
    assert "16 pixels that are NaN, infinite or huge" in refusal("Sparkle", float_image(fill=(0.5, value, 1)))


def test_pixels_without_a_direction_are_refused(scene):
    assert "no direction" in refusal("Sparkle", float_image(fill=(0.5, 0.5, 0.5)))


def test_movies_and_unsaved_sets_that_are_shown_as_colour_are_refused(flake_map):
    assert "UDIM set" in refusal("Sparkle", bpy.data.images.new("tiles", 4, 4, tiled=True))
    image = bpy.data.images.load(str(flake_map))
    image.source = "MOVIE"
    assert "movie" in refusal("Sparkle", image)


def test_a_bad_image_shown_as_colour_leaves_no_copy(scene):
    image = bpy.data.images.new("Colour", 4, 4, float_buffer=True)
    image.pixels.foreach_set(np.full(64, np.nan, np.float32))
    assert "NaN" in refusal("Sparkle", image)


def test_a_node_group_of_the_same_name_that_is_not_ours_is_refused(flake_map):
    bpy.data.node_groups.new(glint_bsdf.NAME, "ShaderNodeTree")
    assert glint_bsdf.NAME in refusal("Sparkle", flake_map, kind=GlintError)


def test_a_shader_that_does_not_compile_leaves_nothing(flake_map, monkeypatch):
    monkeypatch.setattr("glint_addon.nodes.script_node.shader_source", lambda name: "shader broken( {")
    assert "glint.osl" in refusal("Sparkle", flake_map, kind=ShaderError)


def test_a_failure_spares_what_was_there_before(flake_map):
    material = create_glint_material("Sparkle", flake_map)
    refusal("Other", flake_map, distribution="PHONG")
    refusal("Other", flake_map, color="red")
    assert is_glint_material(material) and len(bpy.data.materials) == 1


def test_only_materials_with_a_map_are_glint_materials(scene, flake_map):
    assert not is_glint_material(None)
    plain = bpy.data.materials.new("plain")
    assert not is_glint_material(plain)
    node = plain.node_tree.nodes.new("ShaderNodeGroup")
    assert not is_glint_material(plain)  # a group node without a group
    node.node_tree = glint_bsdf.build()
    assert not is_glint_material(plain)  # without a map it is only glossy
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    outer.nodes.new("ShaderNodeGroup").node_tree = glint_groups(create_glint_material("m", flake_map))[0]
    node.node_tree = outer
    assert is_glint_material(plain)


def test_each_kind_of_surface_takes_its_values(flake_map):
    given = {
        "TINT": {"color": (0.1, 0.2, 0.3)},
        "METAL": {"color": (0.1, 0.2, 0.3), "edge_tint": (0.4, 0.5, 0.6)},
        "CONDUCTOR": {"ior": (1.0, 2.0, 3.0), "extinction": (4.0, 5.0, 6.0)},
        "DIELECTRIC": {"color": (0.1, 0.2, 0.3), "ior": 1.31},
    }
    assert tuple(given) == SURFACE.identifiers
    for kind, values in given.items():
        inputs = surface(create_glint_material(kind, flake_map, surface=kind, **values)).inputs
        for name, value in values.items():
            if name == "color":
                assert inputs[KINDS[kind].color.name].default_value[:] == pytest.approx((*value, 1.0))
            else:
                stored = inputs[WORDS[name]].default_value
                expected = (*value, 1.0) if name == "edge_tint" else value
                assert (stored[:] if hasattr(stored, "__len__") else stored) == pytest.approx(expected)


def test_a_metal_is_known_by_its_name(flake_map):
    gold = METALS["Gold"]
    metal = surface(create_glint_material("m", flake_map, surface="METAL", metal="Gold", color=(0.5, 0.5, 0.5))).inputs
    assert metal["Base Color"].default_value[:] == pytest.approx((0.5, 0.5, 0.5, 1.0))  # what is given comes first
    assert metal["Edge Tint"].default_value[:3] == pytest.approx(gold.edge_tint)
    conductor = surface(create_glint_material("m", flake_map, surface="CONDUCTOR", metal="Gold")).inputs
    assert conductor["IOR"].default_value[:] == pytest.approx(gold.ior)
    assert conductor["Extinction"].default_value[:] == pytest.approx(gold.extinction)


def test_a_dielectric_is_always_ggx(flake_map):
    material = create_glint_material("Ice", flake_map, surface="DIELECTRIC", distribution="BECKMANN")
    assert glint_bsdf.group_binding(glint_groups(material)[0]).distribution == "GGX"


@pytest.mark.parametrize(("settings", "words"), [
    ({"surface": "WOOD"}, "Surface"),
    ({"surface": "METAL", "metal": "Unobtainium"}, "Gold"),
    ({"surface": "TINT", "metal": "Gold"}, "METAL"),
    ({"surface": "TINT", "edge_tint": (1, 1, 1)}, "Edge Tint"),
    ({"surface": "METAL", "ior": 1.5}, '"CONDUCTOR", "DIELECTRIC"'),
    ({"surface": "CONDUCTOR", "color": (1, 1, 1)}, "Color"),
    ({"surface": "CONDUCTOR", "ior": 1.5}, "IOR 1.5"),
    ({"surface": "CONDUCTOR", "extinction": (1, 1, -1)}, "Extinction"),
    ({"surface": "DIELECTRIC", "ior": 0.5}, "1 to 100"),
    ({"surface": "DIELECTRIC", "ior": (1.5, 1.5, 1.5)}, "IOR"),
])
def test_what_a_surface_cannot_have_is_refused(flake_map, settings, words):
    assert words in refusal("Sparkle", flake_map, **settings)


def test_another_kind_of_surface_keeps_values_and_links_of_what_both_have(flake_map):
    material = create_glint_material("m", flake_map, color=(0.1, 0.2, 0.3), roughness=0.3)
    node = surface(material)
    glossy = node.node_tree
    source = node.inputs["Vector"].links[0].from_socket
    tint = material.node_tree.nodes.new("ShaderNodeRGB").outputs[0]
    material.node_tree.links.new(tint, node.inputs["Color"])
    for kind in ("METAL", "DIELECTRIC", "METAL", "TINT"):
        replace_group(node, glint_bsdf.group_for(replace(glint_bsdf.group_binding(glossy), surface=kind)))
        assert node.inputs[KINDS[kind].color.name].links[0].from_socket == tint
        assert node.inputs["Roughness"].default_value == pytest.approx(0.3)
        assert node.inputs["Strength"].default_value == 1.0 and not node.inputs["Strength"].is_linked
        assert node.inputs["Vector"].links[0].from_socket == source and node.outputs["BSDF"].is_linked
    assert node.node_tree == glossy
    replace_group(node, glint_bsdf.group_for(replace(glint_bsdf.group_binding(glossy), surface="CONDUCTOR")))
    assert node.inputs["IOR"].default_value[:] == pytest.approx(IORS.default)
