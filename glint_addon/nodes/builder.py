"""Small vocabulary for building node groups: get-or-build, sockets by name, layout without typed coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..errors import SceneError
from ..properties import STAMP

COLUMN_WIDTH = 220.0  # a little wider than Blender's default node, so that links stay visible
ROW_HEIGHT = 190.0  # about the height of a Math node


@dataclass(frozen=True)
class Socket:
    """An input or output of a group, declared once: other modules take its name, default and range from here.

    kind: Blender's type; low, high: of what a user may set (for colours of each channel, which only settings of
    operators know); help: tooltip, gives the unit; setting_help: tooltip where an operator sets it on a new node.
    """

    name: str
    kind: str
    default: float | tuple[float, ...] | None = None
    low: float | None = None
    high: float | None = None
    subtype: str | None = None
    help: str = ""
    setting_help: str = ""


def local_group(name: str) -> bpy.types.ShaderNodeTree | None:
    """The local (not linked) node group `name`, or None.

    Raises SceneError if a group of that name exists that the extension did not make.
    """
    group = bpy.data.node_groups.get((name, None))
    if group is not None and (STAMP not in group or group.bl_idname != "ShaderNodeTree"):
        raise SceneError(f'A node group named "{name}" exists that Glint did not make: rename it and try again.')
    return group


def version_of(group) -> int:
    """The version of its kind that a group made by Glint has; 0 for a stamp that no version wrote."""
    return group[STAMP] if isinstance(group[STAMP], int) else 0


def new_group(name: str, version: int, description: str = "") -> bpy.types.ShaderNodeTree:
    """An empty shader node group marked as ours."""
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    group[STAMP] = version
    group.description = description
    return group


def add_input(group, socket: Socket):
    """Add an input to the group's interface."""
    item = group.interface.new_socket(socket.name, in_out="INPUT", socket_type=socket.kind)
    # Blender's colours have no range.
    low, high = (None, None) if socket.kind == "NodeSocketColor" else (socket.low, socket.high)
    settings = {"subtype": socket.subtype, "min_value": low, "max_value": high, "default_value": socket.default}
    for name, value in settings.items():
        if value is not None:
            setattr(item, name, value)
    item.description = socket.help
    return item


def add_output(group, socket: Socket):
    """Add an output to the group's interface."""
    item = group.interface.new_socket(socket.name, in_out="OUTPUT", socket_type=socket.kind)
    item.description = socket.help
    return item


def add_sockets(group, outputs, inputs):
    """Add a group's outputs, then its inputs."""
    for socket in outputs:
        add_output(group, socket)
    for socket in inputs:
        add_input(group, socket)


def add_node(group, kind, label="", **settings):
    """Add a node of type `kind` ("ShaderNodeMath") with properties set and sockets given by name as `inputs={...}`."""
    inputs = settings.pop("inputs", {})
    node = group.nodes.new(kind)
    node.label = label
    if label:
        node.name = label
    for key, value in settings.items():
        setattr(node, key, value)
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    return node


def add_math(group, operation, *operands, label="", vector=False):
    """Add a (Vector) Math node; operands are sockets (linked) or constants. Returns its first enabled output."""
    node = add_node(group, "ShaderNodeVectorMath" if vector else "ShaderNodeMath", label, operation=operation)
    for socket, operand in zip(_enabled(node.inputs), operands, strict=False):
        feed(group, socket, operand)
    return _enabled(node.outputs)[0]


def add_mix(group, data_type, factor, a, b, label):
    """Add a Mix node of `data_type`; factor, a and b are sockets (linked) or constants. Returns its output."""
    node = add_node(group, "ShaderNodeMix", label, data_type=data_type)
    for socket, source in zip(_enabled(node.inputs), (factor, a, b), strict=True):
        feed(group, socket, source)
    return _enabled(node.outputs)[0]


def vector_or(group, vector, other):
    """The vector of an input of a group, or `other` where nothing is connected to it, which is 0 everywhere then."""
    length = add_math(group, "LENGTH", vector, vector=True, label="Length")
    is_connected = add_math(group, "GREATER_THAN", length, 0.0, label="Is Connected")
    return add_mix(group, "VECTOR", is_connected, other, vector, "Coordinates")


def feed(group, socket, source):
    """Let an input of one of the group's nodes have what `source` gives, if that is a socket, else its value."""
    if isinstance(source, bpy.types.NodeSocket):
        group.links.new(source, socket)
    else:
        socket.default_value = source


def _enabled(sockets) -> list:
    """The sockets that the settings of their node leave in use."""
    return [socket for socket in sockets if socket.enabled]


def change_text(socket, change):
    """Let change(text) say what a socket's text is to be, if there are a socket and a text.

    The same text is not written: Blender would compile the shader again.
    """
    if socket is not None and socket.default_value and (text := change(socket.default_value)) != socket.default_value:
        socket.default_value = text


def arrange(group):
    """Place every node in columns by its longest distance from the inputs, in order of creation within a column."""
    depth = {}

    def column(node):
        if node.name not in depth:
            depth[node.name] = 0  # breaks cycles, which Blender does not allow but files may hold
            sources = [link.from_node for socket in node.inputs for link in socket.links]
            depth[node.name] = 1 + max((column(source) for source in sources), default=-1)
        return depth[node.name]

    rows = {}
    for node in group.nodes:
        x = column(node)
        node.location = (x * COLUMN_WIDTH, -rows.get(x, 0) * ROW_HEIGHT)
        rows[x] = rows.get(x, 0) + 1
