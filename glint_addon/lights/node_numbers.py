"""Sockets of shader nodes followed to their sources: through reroutes, groups, muted nodes, to numbers.

A node inside groups is named by its socket and `groups`, the group nodes around it, outermost first.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy

from ..animation.curves import is_animated, peak_value
from ..nodes.driven import Variable

COMBINED = {"X": 0, "Y": 1, "Z": 2}
WITH_AXES = {"RGBA", "VECTOR"}  # types of sockets that hold several numbers; a colour is read as a vector too


# The group nodes around a node, outermost first.
Groups = tuple[bpy.types.ShaderNode, ...]


@dataclass(frozen=True)
class Number:
    """A property that holds one number: its value now and at its keys' peak, whether it moves, and where it is.

    owner, path: by which a driver reads it. A node tree inside a data-block is read through that: drivers of a bare
    embedded tree are not updated.
    """

    value: float
    peak: float
    moves: bool
    owner: bpy.types.ID
    path: str


def source(socket: bpy.types.NodeSocket | None, groups: Groups = ()) -> tuple[bpy.types.NodeSocket | None, Groups]:
    """The source of input `socket`: (output of a node, groups), or (unlinked input that holds the value, groups).

    (None, groups) where a muted node lets nothing through, or a group has lost its output or its input.
    """
    while socket is not None and not socket.is_output:
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None or not socket.enabled:
            return socket, groups
        socket, groups = _through(link.from_socket, groups)
    return socket, groups


def _through(output: bpy.types.NodeSocket, groups: Groups) -> tuple[bpy.types.NodeSocket | None, Groups]:
    """`output` itself, or the input whose value it passes on, with that one's groups."""
    node = output.node
    if node.mute:
        return next((link.from_socket for link in node.internal_links if link.to_socket == output), None), groups
    if node.bl_idname == "NodeReroute":
        return node.inputs[0], groups
    if node.bl_idname == "ShaderNodeGroup" and node.node_tree:
        ends = [end for end in node.node_tree.nodes if end.bl_idname == "NodeGroupOutput" and end.is_active_output]
        return (_same(ends[0].inputs, output), (*groups, node)) if ends else (None, groups)
    if node.bl_idname == "NodeGroupInput" and groups:
        return _same(groups[-1].inputs, output), groups[:-1]
    return output, groups


def _same(sockets: Iterable[bpy.types.NodeSocket], socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    return next((other for other in sockets if other.identifier == socket.identifier), None)


def number(
    holder: bpy.types.ID, socket: bpy.types.NodeSocket, groups: Groups = (), axis: int | None = None
) -> Number | None:
    """The number at a socket (component `axis`, 0 to 2, of a vector), or None where only Cycles computes it.

    holder: the data-block whose own node tree the nodes outside of groups are in.
    """
    end, groups = source(socket, groups)
    if end is not None and end.is_output and end.node.bl_idname == "ShaderNodeCombineXYZ" and axis is not None:
        component = next(entry for entry in end.node.inputs if COMBINED.get(entry.identifier) == axis)
        return number(holder, component, groups)
    if end is None or end.is_output and end.node.bl_idname != "ShaderNodeValue":
        return None
    has_axes = end.type in WITH_AXES
    if has_axes and axis is None:
        return None  # Cycles makes one number of a colour or vector that a group's input holds
    return _number_at(holder, end.id_data, end.path_from_id("default_value"), axis if has_axes else None)


def _number_at(holder: bpy.types.ID, tree: bpy.types.NodeTree, path: str, axis: int | None = None) -> Number:
    index = axis or 0
    value = tree.path_resolve(path)
    owner, prefix = (holder, "node_tree.") if tree == holder.node_tree else (tree, "")
    suffix = "" if axis is None else f"[{axis}]"
    return Number(
        value if axis is None else value[axis], peak_value(tree, path, index), is_animated(tree, path, index),
        owner, f"{prefix}{path}{suffix}",
    )


def read(name: str, what: Number) -> Variable:
    """A driver's variable `name` that reads a number."""
    return Variable(name, "SINGLE_PROP", what.owner, what.path)
