"""Nodes in the group "Glint Lights" that put a hint where its light is when a ray is sent, while the shutter is open.

Blender has no node for the time of a ray, so a Script node gives it; the other nodes are Math nodes. A light that moves
within no scene's shutter has none of these nodes.
"""

from __future__ import annotations

import bpy

from ..errors import SceneError
from ..nodes import builder
from ..nodes.driven import write_number
from ..nodes.glint_lights import light_name, set_of
from ..nodes.scene_lights import HINT_COUNT, REACH, SHIFT, context_number, is_used
from ..nodes.script_node import add_script_node

TIME = "Shutter Time"
SHADER = "shutter_time.osl"
STILL = (0.0, 0.0, 0.0)


def read_ways(group: bpy.types.ShaderNodeTree) -> None:
    """Let each light of the group move by what the scene being rendered says, where any scene has it move.

    Numbers that are right already are not written. Raises SceneError if the group lacks a node.
    """
    moving = [slot for slot in range(1, HINT_COUNT + 1)
              if is_used(set_of(group), slot, SHIFT) or is_used(set_of(group), slot, REACH)]
    for slot in range(1, HINT_COUNT + 1):
        if slot in moving and group.nodes.get(_moved_name(slot)) is None:
            _add_nodes(group, slot)
        elif slot not in moving and group.nodes.get(_moved_name(slot)) is not None:
            _remove_nodes(group, slot)
    if not moving and group.nodes.get(TIME) is not None:
        group.nodes.remove(group.nodes[TIME])


def _shift_name(slot: int) -> str:
    return f"Shift {slot}"


def _reach_name(slot: int) -> str:
    return f"Reach {slot}"


def _shifted_name(slot: int) -> str:
    return f"Shifted {slot}"


def _moved_name(slot: int) -> str:
    return f"Moved {slot}"


def _node(group: bpy.types.ShaderNodeTree, name: str) -> bpy.types.Node:
    node = group.nodes.get(name)
    if node is None:
        raise SceneError(f'Node group "{group.name}" has lost its node "{name}": delete the group, prepare again.')
    return node


def _add_nodes(group: bpy.types.ShaderNodeTree, slot: int) -> None:
    light = _node(group, light_name(slot)).outputs["Vector"]
    ends = [link.to_socket for link in light.links]
    shift, reach = (builder.add_node(group, "ShaderNodeCombineXYZ", name(slot)) for name in (_shift_name, _reach_name))
    for node, part in ((shift, SHIFT), (reach, REACH)):
        for axis, socket in enumerate(node.inputs):
            write_number(socket, context_number(set_of(group), slot, part + axis))
    shifted = builder.add_math(group, "ADD", light, shift.outputs["Vector"], label=_shifted_name(slot), vector=True)
    time = _time(group)
    moved = builder.add_math(group, "MULTIPLY_ADD", reach.outputs["Vector"], STILL if time is None else time, shifted,
                             label=_moved_name(slot), vector=True)
    for end in ends:
        group.links.new(moved, end)
    builder.arrange(group)


def _remove_nodes(group: bpy.types.ShaderNodeTree, slot: int) -> None:
    light = _node(group, light_name(slot)).outputs["Vector"]
    for link in list(_node(group, _moved_name(slot)).outputs["Vector"].links):
        group.links.new(light, link.to_socket)
    for name in (_shift_name, _reach_name, _shifted_name, _moved_name):
        node = _node(group, name(slot))
        for socket in node.inputs if name in (_shift_name, _reach_name) else ():
            write_number(socket, 0.0)  # this removes the socket's driver
        group.nodes.remove(node)
    builder.arrange(group)


def _time(group: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket | None:
    """Output of the group's Script node, made if there is none; None where Blender has no OSL."""
    node = group.nodes.get(TIME)
    if node is None:
        node = add_script_node(group, SHADER, TIME)
    return node.outputs["Time"] if node else None
