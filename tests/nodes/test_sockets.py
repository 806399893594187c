"""Sockets of the Glint BSDF are declared once: shader, operator and public function say the same of each."""

import hashlib
import inspect
import re
from pathlib import Path

import bpy
import pytest

from glint_addon import create_glint_material
from glint_addon.nodes.glint_bsdf import COLOR, INPUTS, VECTOR, VERSION, build, group_for
from glint_addon.nodes.glint_lights import HINT_COUNT, output_names
from glint_addon.nodes.glint_lights import build as build_lights
from glint_addon.nodes.map_binding import MapBinding

SHADER = (Path(__file__).parents[2] / "osl" / "glint.osl").read_text(encoding="utf-8")
SETTINGS = tuple(socket for socket in INPUTS if socket is not VECTOR)
NUMBERS = tuple(socket for socket in SETTINGS if socket.kind == "NodeSocketFloat")
SCRIPT_INPUTS = {VECTOR.name: "UV"}  # where the shader's input has another name than the socket
# The group as its version made it. Where it changes, raise VERSION in glint_addon/nodes/glint_bsdf.py and put the new
# digest here: groups of saved files are brought up to date only if their version is another.
BUILT = (13, "1fa958619dd580c4", "da1ae9ed61632c24")
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
    setting = bpy.ops.glint.add_material.get_rna_type().properties[socket.name.lower()]
    default = list(setting.default_array) if setting.is_array else setting.default
    expected = list(COLOR.default[:3]) if setting.is_array else socket.default
    assert default == pytest.approx(expected, abs=STEP)
    assert (setting.hard_min, setting.hard_max) == (socket.low, socket.high)
    assert (setting.name, setting.description) == (socket.name, socket.setting_help)


@pytest.mark.parametrize("socket", SETTINGS, ids=lambda socket: socket.name)
def test_the_public_function_has_the_default_of_the_socket(socket):
    default = inspect.signature(create_glint_material).parameters[socket.name.lower()].default
    assert default == (socket.default[:3] if socket is COLOR else socket.default)


def test_the_group_has_the_inputs_that_are_declared(scene):
    items = [item for item in build().interface.items_tree if item.in_out == "INPUT"]
    assert [(item.name, item.description) for item in items] == [(socket.name, socket.help) for socket in INPUTS]
    ranges = {item.name: (item.min_value, item.max_value) for item in items if item.socket_type == "NodeSocketFloat"}
    assert ranges == {socket.name: (socket.low, socket.high) for socket in NUMBERS}


def test_every_input_reaches_the_shader_and_blenders_own_nodes(scene):
    group = build()
    for socket in INPUTS:
        ends = {(link.to_node.bl_idname, link.to_socket.name) for link in group.links
                if (link.from_node.bl_idname, link.from_socket.name) == ("NodeGroupInput", socket.name)}
        script = ("ShaderNodeScript", SCRIPT_INPUTS.get(socket.name, socket.name))
        assert script in ends and ends > {script}, socket.name


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
    assert (VERSION, digest_of(build()), digest_of(group_for(MapBinding(image)))) == BUILT


def test_the_shader_has_an_input_for_each_output_of_the_lights(scene):
    assert {item.name for item in build_lights().interface.items_tree} == set(output_names())
    assert len(output_names()) == 3 * HINT_COUNT + 2
    for name in output_names():
        assert re.search(rf"(?:float|vector) {name.replace(' ', '')} = ", SHADER), name
