"""Sockets of the Glint BSDF are declared once: shader, operator and public function say the same of each."""

import hashlib
import inspect
import re
from dataclasses import replace
from pathlib import Path

import bpy
import pytest

from glint_addon import create_glint_material
from glint_addon.nodes.glint_bsdf import COMMON, VECTOR, VERSION, build, group_for, inputs_of
from glint_addon.nodes.glint_lights import HINT_COUNT, output_names
from glint_addon.nodes.glint_lights import build as build_lights
from glint_addon.nodes.map_binding import MapBinding
from glint_addon.nodes.map_choices import SURFACE
from glint_addon.nodes.surface_kinds import COLOR, EDGE_TINT, EXTINCTION, IOR, IORS, KINDS

SHADER = (Path(__file__).parents[2] / "osl" / "glint.osl").read_text(encoding="utf-8")
NUMBERS = tuple(socket for socket in COMMON if socket.kind == "NodeSocketFloat")
# The setting of the operator that each socket becomes, where it has one.
SETTINGS = {socket: socket.name.lower() for socket in (*NUMBERS, COLOR, EXTINCTION, IOR)} | {
    EDGE_TINT: "edge_tint", IORS: "ior_rgb"}
# The group without a map, with one for each kind of surface, with flakes, and these shuffled, as its version made it.
# Where it changes, raise VERSION in glint_addon/nodes/glint_bsdf.py and put the new digests here: groups of saved files
# are brought up to date only if their version is another.
BUILT = (15, "6958bf5c8ca29170", "e619673f565828f9", "51c31420544bea6e", "98f6f3b5901f6835", "60fb9950e1675196",
         "df669fad7a833984", "2b80fa9bfe1dadaf")
# Of 32-bit floats that Blender stores.
STEP = 1e-6


def shader_numbers(socket) -> list[float]:
    """Default and, where the shader has them, lowest and highest value of the shader's input of that name."""
    line = re.search(rf"^ *\w+ {socket.name} = (.*)\]\],$", SHADER, re.MULTILINE).group(1)
    default = re.search(r"[\d.]+", line).group()
    return [float(default), *(float(number) for number in re.findall(r"float (?:min|max) = ([\d.]+)", line))]


@pytest.mark.parametrize("socket", NUMBERS, ids=lambda socket: socket.name)
def test_the_shader_has_the_default_and_the_range_of_the_socket(socket):
    assert shader_numbers(socket) == [socket.default, socket.low, socket.high]


def test_the_shader_has_the_default_of_the_colour():
    assert shader_numbers(COLOR) * 4 == list(COLOR.default)


@pytest.mark.parametrize("socket", SETTINGS, ids=lambda socket: socket.name)
def test_the_operator_offers_the_default_and_the_range_of_the_socket(registered, socket):
    setting = bpy.ops.glint.add_material.get_rna_type().properties[SETTINGS[socket]]
    default = list(setting.default_array) if setting.is_array else setting.default
    expected = list(socket.default[:3]) if setting.is_array else socket.default
    assert default == pytest.approx(expected, abs=STEP)
    assert (setting.hard_min, setting.hard_max) == (socket.low, socket.high)
    assert (setting.name, setting.description) == (socket.name, socket.setting_help or socket.help)


@pytest.mark.parametrize("socket", NUMBERS, ids=lambda socket: socket.name)
def test_the_public_function_has_the_default_of_the_socket(socket):
    assert inspect.signature(create_glint_material).parameters[socket.name.lower()].default == socket.default


@pytest.mark.parametrize("surface", KINDS)
def test_the_group_has_the_inputs_that_are_declared(scene, surface):
    inputs = inputs_of(surface)
    items = [item for item in group_for(MapBinding(surface=surface)).interface.items_tree if item.in_out == "INPUT"]
    assert [(item.name, item.description) for item in items] == [(socket.name, socket.help) for socket in inputs]
    ranges = {item.name: (item.min_value, item.max_value) for item in items if item.socket_type == "NodeSocketFloat"}
    assert ranges == {socket.name: (socket.low, socket.high) for socket in inputs if socket.kind == "NodeSocketFloat"}


@pytest.mark.parametrize("surface", KINDS)
def test_every_input_reaches_the_shader_and_blenders_own_nodes(scene, surface):
    group = group_for(MapBinding(surface=surface))
    # Where the shader's input has another name than the socket.
    names = {VECTOR: "UV", **KINDS[surface].sockets}
    for socket in inputs_of(surface):
        ends = {(link.to_node.bl_idname, link.to_socket.name) for link in group.links
                if (link.from_node.bl_idname, link.from_socket.name) == ("NodeGroupInput", socket.name)}
        script = ("ShaderNodeScript", names.get(socket, socket.name))
        assert script in ends and ends > {script}, socket.name
    assert {(KINDS[surface].node, socket.name) for socket in KINDS[surface].sockets} <= {
        (link.to_node.bl_idname, link.to_socket.name) for link in group.links}


def test_the_sockets_of_a_kind_are_those_of_blenders_node(scene):
    for surface, kind in KINDS.items():
        group = group_for(MapBinding(surface=surface))
        native = group.nodes[SURFACE.node]
        for socket in kind.sockets:
            ours, theirs = group.interface.items_tree[socket.name], native.inputs[socket.name]
            assert ours.socket_type.startswith(theirs.bl_idname), (surface, socket.name)
            if surface != "TINT":
                default = theirs.default_value
                assert socket.default == pytest.approx(default[:] if hasattr(default, "__len__") else default), surface


def digest_of(group) -> str:
    """Short digest of a group's sockets, nodes and links, and of the shader's inputs; not of what is Blender's own."""
    sockets = [(item.name, item.in_out, item.socket_type) for item in group.interface.items_tree]
    nodes = sorted((node.name, node.bl_idname) for node in group.nodes)
    inputs = [socket.name for node in group.nodes if node.bl_idname == "ShaderNodeScript" for socket in node.inputs]
    links = sorted((link.from_node.name, link.from_socket.name, link.to_node.name, link.to_socket.name)
                   for link in group.links)
    return hashlib.sha256(repr((sockets, nodes, inputs, links)).encode()).hexdigest()[:16]


def test_another_group_is_another_version(scene):
    image = bpy.data.images.new("Map", 4, 4, is_data=True)
    kinds = [digest_of(group_for(MapBinding(image, surface=surface))) for surface in KINDS]
    flakes = MapBinding(image, interpolation="CLOSEST", presence=image, flake_color=image)
    shuffled = replace(flakes, variation="SHUFFLE")
    of_flakes = [digest_of(group_for(each)) for each in (flakes, shuffled)]
    assert (VERSION, digest_of(build()), *kinds, *of_flakes) == BUILT


def test_the_shader_has_an_input_for_each_output_of_the_lights(scene):
    assert {item.name for item in build_lights().interface.items_tree} == set(output_names())
    assert len(output_names()) == 3 * HINT_COUNT + 2
    for name in output_names():
        assert re.search(rf"(?:float|vector) {name.replace(' ', '')} = ", SHADER), name
