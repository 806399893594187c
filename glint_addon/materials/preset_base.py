"""What lies between or beneath the facets of a preset: a Principled BSDF, described by the preset's "base".

Values are those of its inputs by name; two inputs may follow the map instead of having one value:

* "Base Color": "COLORS" takes the image of colours of the map;
* "Normal": a number reads the map by a Normal Map node of that strength, so that grains shade softly too.
"""

from __future__ import annotations

import bpy

from ..nodes.builder import add_node, arrange
from ..nodes.flake_nodes import BASE
from ..nodes.glint_bsdf import BSDF, VECTOR, group_binding

COLORS = "COLORS"


def add_base(tree, node, values: dict, colors: bpy.types.Image | None) -> None:
    """Give the Glint BSDF `node` in `tree` the base of a preset: between its flakes, or where its map has no presence
    beneath all facets, whose light is added. values: see this module; colors: the map's image of colours, or None."""
    base = node.inputs[BASE.name].links[0].from_node if BASE.name in node.inputs else _add_beneath(tree, node)
    values = dict(values)
    if is_of_colors(values):
        del values["Base Color"]
    if colors is not None:
        texture = _add_reading(tree, node, colors)
        tree.links.new(texture.outputs["Color"], base.inputs["Base Color"])
    if "Normal" in values:
        _add_normal(tree, node, base, values.pop("Normal"))
    set_inputs(base, values)
    arrange(tree)


def is_of_colors(values: dict) -> bool:
    """Whether the image of colours belongs to the base of a preset, instead of to its facets."""
    return values.get("Base Color") == COLORS


def set_inputs(node, values: dict) -> None:
    """Give inputs of a node, by name, values as a preset has them: colours have three numbers there."""
    for name, value in values.items():
        socket = node.inputs[name]
        is_color = socket.bl_idname == "NodeSocketColor"
        socket.default_value = (*value, 1.0) if is_color else value


def _add_beneath(tree, node):
    """Add a Principled BSDF to the light of `node`; facets reflect for it, so it has no reflection of its own."""
    base = add_node(tree, "ShaderNodeBsdfPrincipled", inputs={"Specular IOR Level": 0.0}, width=200.0)
    total = add_node(tree, "ShaderNodeAddShader")
    output = node.outputs[BSDF.name].links[0].to_socket
    for shader, into in ((node.outputs[BSDF.name], total.inputs[0]), (base.outputs["BSDF"], total.inputs[1]),
                         (total.outputs[0], output)):
        tree.links.new(shader, into)
    return base


def _add_normal(tree, node, base, strength):
    """Let the base have the normals of the map of `node`."""
    binding = group_binding(node.node_tree)
    texture = _add_reading(tree, node, binding.image)
    normal = add_node(tree, "ShaderNodeNormalMap", convention=binding.convention, uv_map=binding.uv_map,
                      inputs={"Strength": strength})
    tree.links.new(texture.outputs["Color"], normal.inputs["Color"])
    tree.links.new(normal.outputs["Normal"], base.inputs["Normal"])


def _add_reading(tree, node, image):
    """An Image Texture node that reads `image` as the Glint BSDF `node` reads its map."""
    closest = group_binding(node.node_tree).interpolation == "CLOSEST"
    texture = add_node(tree, "ShaderNodeTexImage", image=image, interpolation="Closest" if closest else "Linear")
    tree.links.new(node.inputs[VECTOR.name].links[0].from_socket, texture.inputs["Vector"])
    return texture
