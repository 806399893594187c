"""Flakes: presence and colour images of a material reach Blender's own nodes, and what cannot be is one sentence."""

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material
from glint_addon.errors import MapError
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.flake_nodes import FLAKE_COLOR_NODE, PRESENCE_NODE, presence_read
from glint_addon.nodes.glint_bsdf import follow_map, group_binding, refresh
from glint_addon.prepare.flake_images import LUMINANCE, are_flakes, flake_colors
from tests.helpers.extension import data_names, write_flake_map

SIZE = 16


@pytest.fixture
def flake_map(scene, tmp_path):
    return write_flake_map(tmp_path / "flakes.png", SIZE)


def image_of(pixels, name, *, is_data=True, is_float=True):
    """A generated image of (height, width, 3 or 4) pixels."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=is_float, is_data=is_data, alpha=True)
    alpha = np.ones((height, width, 4 - pixels.shape[2]))
    image.pixels.foreach_set(np.float32(np.concatenate([pixels, alpha], axis=2)).ravel())
    image.update()
    return image


def random_image(name, *, size=SIZE, seed=1, **settings):
    return image_of(np.random.default_rng(seed).random((size, size, 3)), name, **settings)


def refusal(*arguments, **settings) -> str:
    before = data_names()
    with pytest.raises(MapError) as error:
        create_glint_material(*arguments, interpolation=settings.pop("interpolation", "CLOSEST"), **settings)
    assert data_names() == before
    return str(error.value)


def test_flakes_are_what_the_nodes_show(flake_map):
    presence, color = random_image("Presence"), random_image("Colors", is_data=False)
    material = create_glint_material("Flakes", flake_map, interpolation="CLOSEST", presence=presence,
                                     flake_color=color, extension="CLIP")
    (group,) = glint_groups(material)
    binding = group_binding(group)
    assert (binding.presence, binding.flake_color) == (presence, color)
    for name in (PRESENCE_NODE, FLAKE_COLOR_NODE):
        assert (group.nodes[name].interpolation, group.nodes[name].extension) == ("Closest", "CLIP")
    node = next(each for each in material.node_tree.nodes if each.bl_idname == "ShaderNodeGroup")
    assert node.inputs["Base"].links[0].from_node.bl_idname == "ShaderNodeBsdfPrincipled"
    assert [socket.name for socket in node.inputs] == ["Color", "Roughness", "Strength", "Vector", "Base"]


def test_a_group_with_flakes_is_not_one_without(flake_map):
    presence, color = random_image("Presence"), random_image("Colors", is_data=False)
    settings = [{}, {"presence": presence}, {"flake_color": color}, {"presence": presence, "flake_color": color}]
    groups = [glint_groups(create_glint_material("m", flake_map, interpolation="CLOSEST", **each))[0]
              for each in settings]
    assert len(set(groups)) == 4
    again = create_glint_material("m", flake_map, interpolation="CLOSEST", presence=presence)
    assert glint_groups(again) == [groups[1]]


def test_a_group_is_brought_up_to_date_with_its_flakes(flake_map):
    presence, color = random_image("Presence"), random_image("Colors", is_data=False)
    material = create_glint_material("Flakes", flake_map, interpolation="CLOSEST", presence=presence,
                                     flake_color=color, surface="METAL")
    (group,) = glint_groups(material)
    before = group_binding(group)
    group["glint_group"] = 1
    refresh(group)
    assert group_binding(group) == before
    node = next(each for each in material.node_tree.nodes if each.bl_idname == "ShaderNodeGroup")
    assert node.inputs["Base"].is_linked


def test_a_presence_shown_as_colour_is_read_by_a_copy_that_follows_it(flake_map):
    pixels = np.random.default_rng(3).random((SIZE, SIZE, 3))
    presence = image_of(pixels, "Presence", is_data=False, is_float=False)
    material = create_glint_material("Flakes", flake_map, interpolation="CLOSEST", presence=presence)
    (group,) = glint_groups(material)
    assert presence_read(group) != presence and group_binding(group).presence == presence
    stored = np.round(pixels * 255) / 255
    clear = np.abs(stored @ LUMINANCE - 0.5) > 1e-3
    np.testing.assert_array_equal(are_flakes(group)[clear], (stored @ LUMINANCE > 0.5)[clear])
    presence.pixels.foreach_set(np.float32(np.ones((SIZE, SIZE, 4))).ravel())
    presence.update()
    follow_map(group)
    assert are_flakes(group).all() and group_binding(group).presence == presence


@pytest.mark.parametrize(("is_data", "is_float"), [(True, True), (False, True), (False, False), (True, False)])
def test_colours_are_read_as_cycles_shows_them(flake_map, is_data, is_float):
    pixels = np.random.default_rng(3).random((SIZE, SIZE, 3))
    image = image_of(pixels, "Colors", is_data=is_data, is_float=is_float)
    material = create_glint_material("Flakes", flake_map, interpolation="CLOSEST", flake_color=image)
    colors = flake_colors(glint_groups(material)[0])
    expected = pixels if is_float else np.round(pixels * 255) / 255
    if image.colorspace_settings.name == "sRGB" and not is_float:
        expected = np.where(expected <= 0.04045, expected / 12.92, ((expected + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(colors, expected, atol=1e-6)


def test_flakes_of_files_are_opened_in_their_own_colour_spaces(flake_map, tmp_path):
    path = write_flake_map(tmp_path / "other.png", SIZE)
    material = create_glint_material("m", flake_map, interpolation="CLOSEST", presence=str(path))
    assert group_binding(glint_groups(material)[0]).presence.colorspace_settings.is_data
    path = write_flake_map(tmp_path / "colors.png", SIZE)
    material = create_glint_material("m", flake_map, interpolation="CLOSEST", flake_color=path)
    assert group_binding(glint_groups(material)[0]).flake_color.colorspace_settings.name == "sRGB"


def test_what_cannot_be_flakes_is_refused(flake_map):
    image = random_image("Picture")
    assert "Closest" in refusal("m", flake_map, presence=image, interpolation="LINEAR")
    assert "no colour" in refusal("m", flake_map, flake_color=image, surface="CONDUCTOR")
    small = random_image("Small", size=8)
    assert "8 x 8" in refusal("m", flake_map, presence=small) and "8 x 8" in refusal("m", flake_map, flake_color=small)
    assert "does not exist" in refusal("m", flake_map, presence="missing.png")
    tiled = bpy.data.images.new("Tiles", 16, 16, tiled=True)
    assert "single picture" in refusal("m", flake_map, flake_color=tiled)
    assert "Base Color" in refusal("m", flake_map, presence=image, base_color="red")
