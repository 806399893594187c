"""Numbers of sockets that come through a group, whose input is of another kind than the socket it ends at."""

import bpy
import pytest

from glint_addon.lights.emission import sampled_radiance
from glint_addon.lights.node_numbers import number
from glint_addon.lights.world.textures import world_textures

COLOUR = (0.25, 0.5, 0.75, 1.0)
STRENGTH = 8.0


def group_with(owner, kind, value, inner, socket):
    """A group in the nodes of `owner` that passes its one input, of `kind`, on to a socket of a node inside, and sends
    out that node's shader; returns the node inside."""
    tree = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    tree.interface.new_socket("Input", in_out="INPUT", socket_type=kind)
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    entry, node, end = (tree.nodes.new(name) for name in ("NodeGroupInput", inner, "NodeGroupOutput"))
    tree.links.new(entry.outputs["Input"], node.inputs[socket])
    tree.links.new(node.outputs[0], end.inputs["Shader"])
    group = owner.node_tree.nodes.new("ShaderNodeGroup")
    group.node_tree = tree
    group.inputs["Input"].default_value = value
    owner.node_tree.links.new(group.outputs[0], owner.node_tree.get_output_node("CYCLES").inputs["Surface"])
    return node


def glowing(tree):
    """An Emission of strength STRENGTH."""
    node = tree.nodes.new("ShaderNodeEmission")
    node.inputs["Color"].default_value, node.inputs["Strength"].default_value = (1, 1, 1, 1), STRENGTH
    return node


def test_a_number_as_the_colour_of_an_emission_is_grey(scene):
    material = bpy.data.materials.new("Bulb")
    node = group_with(material, "NodeSocketFloat", 0.25, "ShaderNodeEmission", "Color")
    node.inputs["Strength"].default_value = STRENGTH
    assert sampled_radiance(material) == pytest.approx(0.25 * STRENGTH)


@pytest.mark.parametrize(("kind", "value"), [("NodeSocketColor", COLOUR), ("NodeSocketVector", COLOUR[:3])])
def test_a_colour_or_vector_as_a_factor_is_unknown_so_both_shaders_count(scene, kind, value):
    material = bpy.data.materials.new("Bulb")
    mix = group_with(material, kind, value, "ShaderNodeMixShader", 0)
    mix.id_data.links.new(glowing(mix.id_data).outputs[0], mix.inputs[1])
    assert sampled_radiance(material) == pytest.approx(STRENGTH)


@pytest.mark.parametrize(("kind", "value"), [("NodeSocketColor", COLOUR), ("NodeSocketVector", COLOUR[:3])])
def test_a_colour_or_vector_as_a_factor_leaves_a_texture_of_the_world_in_full(scene, kind, value):
    world = bpy.data.worlds.new("World")
    mix = group_with(world, kind, value, "ShaderNodeMixShader", 0)
    tree = mix.id_data
    background, sky = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeTexSky")
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    tree.links.new(background.outputs[0], mix.inputs[1])
    (texture,), left = world_textures(world)
    assert (texture.node, texture.factor, left) == (sky, 1.0, [])


@pytest.mark.parametrize(("kind", "value", "expected"), [
    ("NodeSocketColor", COLOUR, list(COLOUR[:3])), ("NodeSocketFloat", 0.5, [0.5] * 3),
])
def test_a_colour_as_a_vector_is_read_channel_by_channel_and_a_number_thrice(scene, kind, value, expected):
    material = bpy.data.materials.new("Map")
    bsdf = group_with(material, kind, value, "ShaderNodeBsdfDiffuse", "Normal")
    group = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    found = [number(material, bsdf.inputs["Normal"], (group,), axis) for axis in range(3)]
    assert [each.value for each in found] == pytest.approx(expected)
    assert [each.peak for each in found] == pytest.approx(expected)
