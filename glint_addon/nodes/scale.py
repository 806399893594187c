"""Node group "Glint Scale": texture coordinates of which one repeat is as wide as Scale says, in metres of the scene.

The preparation keeps on each object how many metres one unit of its UV map covers, divided by the object's mean scale:
an Attribute node reads that, so one material has the same size on all objects. The scale itself is read while
rendering, so it follows animation and differs between instances. Each UV map has a group of its own: "Glint Scale",
"Glint Scale.001", ...; an attribute's name is no socket.
"""

from __future__ import annotations

import hashlib
from math import sqrt

import bpy

from ..properties import STAMP, UV_METRES
from . import builder
from .builder import Socket

NAME = "Glint Scale"
VERSION = 1
UV_NODE, METRES_NODE = "UV Map", "Metres of a UV Unit"

SCALE = Socket(
    "Scale", "NodeSocketFloat", default=1.0, low=0.0, subtype="DISTANCE",
    help="Width of one repeat in the scene. 0: as the UV map is. Prepare Glints measures the UV maps of all objects",
    setting_help="Width of one repeat of the normal map on the object; 0 repeats it as the UV map says",
)
VECTOR = Socket("Vector", "NodeSocketVector", help="Texture coordinates of the UV map; itself if nothing is connected")
INPUTS = (VECTOR, SCALE)
COORDINATES = Socket("Vector", "NodeSocketVector", help="Texture coordinates: one unit is one repeat")


def build() -> bpy.types.ShaderNodeTree:
    """Get or build the group that gives the map of the active UV map's coordinates a size in metres.

    Raises SceneError if a group of that name exists that the extension did not make.
    """
    return group_for("")


def group_for(uv_map: str) -> bpy.types.ShaderNodeTree:
    """The local group for the UV map `uv_map`, "" for the one active for rendering. Raises as `build`."""
    builder.local_group(NAME)
    for group in bpy.data.node_groups:
        if group.library is None and is_scale_group(group) and uv_map_of(group) == uv_map:
            return group
    group = builder.new_group(NAME, VERSION, "Gives one repeat of a texture a width in metres")
    builder.add_sockets(group, (COORDINATES,), INPUTS)
    # The active UV map stands in for what is not connected, so there is no value to show.
    group.interface.items_tree[1].hide_value = True
    _add_nodes(group, uv_map)
    builder.arrange(group)
    return group


def is_scale_group(tree) -> bool:
    """Whether a node tree, or None, is a group "Glint Scale"."""
    return tree is not None and STAMP in tree and METRES_NODE in tree.nodes and UV_NODE in tree.nodes


def scale_nodes(material) -> list:
    """The nodes of a material's own tree, or of None, that are a "Glint Scale"."""
    nodes = material.node_tree.nodes if material is not None and material.node_tree is not None else ()
    return [node for node in nodes if node.bl_idname == "ShaderNodeGroup" and is_scale_group(node.node_tree)]


def uv_map_of(group) -> str:
    """Name of the UV map that a group "Glint Scale" measures, "" for the one active for rendering."""
    return group.nodes[UV_NODE].uv_map


def metres_property(uv_map: str) -> str:
    """Name of the custom property in which an object keeps the size of UV map `uv_map`.

    Blender's names of properties are shorter than UV maps' may be, so a digest stands for the name.
    """
    return f"{UV_METRES}_{hashlib.sha256(uv_map.encode()).hexdigest()[:8]}" if uv_map else UV_METRES


def follow_uv_map(group) -> None:
    """Let a group whose UV Map node was changed by hand read the size of the UV map that it has now."""
    name = metres_property(uv_map_of(group))
    if group.nodes[METRES_NODE].attribute_name != name:
        group.nodes[METRES_NODE].attribute_name = name


def _add_nodes(group, uv_map):
    inputs = builder.add_node(group, "NodeGroupInput")
    uv = builder.add_node(group, "ShaderNodeUVMap", UV_NODE, uv_map=uv_map).outputs["UV"]
    name = metres_property(uv_map_of(group))  # of what the node kept of a name that is too long
    coordinates = builder.vector_or(group, inputs.outputs[VECTOR.name], uv)

    # An object that was not measured has 0 here: one metre then, as a plane of Blender's with its UVs from 0 to 1
    # would have if it were one metre wide.
    metres = builder.add_node(group, "ShaderNodeAttribute", METRES_NODE, attribute_type="OBJECT",
                              attribute_name=name).outputs["Fac"]
    is_known = builder.add_math(group, "GREATER_THAN", metres, 0.0, label="Is Known")
    metres = builder.add_mix(group, "FLOAT", is_known, 1.0, metres, "Metres or 1")
    metres = builder.add_math(group, "MULTIPLY", metres, _add_object_scale(group), label="Metres in the Scene")

    scale = inputs.outputs[SCALE.name]
    repeats = builder.add_math(group, "DIVIDE", metres, scale, label="Repeats of a UV Unit")
    is_wanted = builder.add_math(group, "GREATER_THAN", scale, 0.0, label="Is Wanted")
    repeats = builder.add_mix(group, "FLOAT", is_wanted, 1.0, repeats, "Repeats or 1")
    scaled = builder.add_math(group, "SCALE", coordinates, label="Repeated", vector=True).node
    group.links.new(repeats, scaled.inputs["Scale"])
    output = builder.add_node(group, "NodeGroupOutput")
    group.links.new(scaled.outputs[0], output.inputs[COORDINATES.name])


def _add_object_scale(group):
    """The mean scale of the object or instance being rendered: root mean square of its axes' lengths in the scene."""
    lengths = builder.add_node(group, "ShaderNodeCombineXYZ", "Lengths of Axes")
    for axis, name in enumerate("XYZ"):
        own = builder.add_node(group, "ShaderNodeVectorTransform", f"Own {name}", vector_type="VECTOR",
                               convert_from="OBJECT", convert_to="WORLD",
                               inputs={"Vector": [float(axis == other) for other in range(3)]}).outputs[0]
        group.links.new(builder.add_math(group, "LENGTH", own, vector=True, label=f"Length of {name}"),
                        lengths.inputs[name])
    norm = builder.add_math(group, "LENGTH", lengths.outputs[0], vector=True, label="Norm")
    return builder.add_math(group, "MULTIPLY", norm, 1.0 / sqrt(3.0), label="Mean Scale")
