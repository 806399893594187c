"""Node group "Glint Image Texture": an image by UV map or on a sphere; nearest, bilinear, or mipmapped with OSL.

Nearest and bilinear are Blender's own Image Texture nodes, so colours, alpha, tiles and packed files are Blender's.
Mipmap is osl/image_texture.osl reading a baked pyramid; where Cycles runs without OSL, in EEVEE, and while the pyramid
is missing it is bilinear. A file name cannot be a group's socket, so each image has a group of its own ("Glint Image
Texture", "Glint Image Texture.001", ...).
"""

from __future__ import annotations

import math

import bpy

from ..properties import IMAGE_TEXTURE
from . import builder, glint_lights, script_node
from .builder import Socket

NAME = "Glint Image Texture"
VERSION = 1
SHADER = "image_texture.osl"

# Menu items by the names that functions take.
MAPPINGS = {"UV": "UV", "SPHERICAL": "Spherical", "VECTOR": "Vector"}
FILTERS = {"NEAREST": "Nearest", "BILINEAR": "Bilinear", "MIPMAP": "Mipmap"}
UP_AXES = {"Y": "Y", "Z": "Z"}

OUTPUTS = (
    Socket("Color", "NodeSocketColor", help="As Blender's Image Texture"),
    Socket("Alpha", "NodeSocketFloat", help="As Blender's Image Texture"),
)
INPUTS = (
    Socket("Mapping", "NodeSocketMenu", help="UV map, sphere around the object's origin, or the Vector socket"),
    Socket("Filter", "NodeSocketMenu", help="Mipmap needs OSL and is bilinear without"),
    Socket("Up Axis", "NodeSocketMenu", help="Axis of the sphere: v = 1 at its positive end"),
    Socket("Turn with Object", "NodeSocketBool", default=False,
           help="Spherical: the sphere's axes are the object's own instead of the world's"),
    Socket("Vector", "NodeSocketVector", help="Texture coordinates for the mapping Vector"),
)

NEAREST_NODE, BILINEAR_NODE, MIPMAP_NODE = "Image Nearest", "Image Bilinear", "Image Mipmap"
UV_NODE, ROW_NODE = "UV Map", "Half a Row"
PROBE = "Glint Alpha Probe"


def build() -> bpy.types.ShaderNodeTree:
    """The local group "Glint Image Texture", built without an image if the file has none: see `image_choice`.

    Raises SceneError if a group of that name exists that the extension did not make.
    """
    group = builder.local_group(NAME)
    return group if group is not None else new_tree()


def new_tree() -> bpy.types.ShaderNodeTree:
    """Another copy of the group, without an image."""
    group = builder.new_group(NAME, VERSION, "Image by UV map or on a sphere: nearest, bilinear, or mipmapped with OSL")
    group[IMAGE_TEXTURE] = True
    builder.add_sockets(group, OUTPUTS, INPUTS)
    group.interface.items_tree["Vector"].hide_value = True
    inputs = builder.add_node(group, "NodeGroupInput")
    vector = _add_mapping(group, inputs)
    _add_filters(group, inputs, vector)
    for socket, value in (("Mapping", "UV"), ("Filter", "Mipmap"), ("Up Axis", "Z")):
        group.interface.items_tree[socket].default_value = value
    builder.arrange(group)
    return group


def image_of(group) -> bpy.types.Image | None:
    """The image that a copy of the group shows."""
    return group.nodes[BILINEAR_NODE].image


def _add_menu(group, socket, data_type, label, sources):
    """A Menu Switch over `sources` (item name -> socket or constant); its output."""
    node = builder.add_node(group, "GeometryNodeMenuSwitch", label, data_type=data_type)
    node.enum_definition.enum_items.clear()
    for name in sources:
        node.enum_definition.enum_items.new(name)
    group.links.new(socket, node.inputs["Menu"])
    for name, source in sources.items():
        builder.feed(group, node.inputs[name], source)
    return node.outputs[0]


def _add_mapping(group, inputs):
    """Texture coordinates; z is 1 where v must not repeat (the poles of the sphere), else 0."""
    uv = builder.add_node(group, "ShaderNodeUVMap", UV_NODE).outputs["UV"]
    flat = builder.add_math(group, "MULTIPLY", inputs.outputs["Vector"], (1, 1, 0), label="Drop z", vector=True)
    sphere = _add_sphere(group, inputs)
    sources = {"UV": uv, "Spherical": sphere, "Vector": flat}
    return _add_menu(group, inputs.outputs["Mapping"], "VECTOR", "Mapping", sources)


def _add_sphere(group, inputs):
    """n = normalized hit - origin; u = atan2(n.x, n.z) / (2 pi) + 0.5, v = n.y * 0.5 + 0.5 with y up."""
    position = builder.add_node(group, "ShaderNodeNewGeometry").outputs["Position"]
    origin = builder.add_node(group, "ShaderNodeObjectInfo").outputs["Location"]
    world = builder.add_math(group, "SUBTRACT", position, origin, label="Hit - Origin", vector=True)
    own = builder.add_node(group, "ShaderNodeTexCoord", "Object Axes").outputs["Object"]
    offset = builder.add_mix(group, "VECTOR", inputs.outputs["Turn with Object"], world, own, "Axes")
    normal = builder.add_math(group, "NORMALIZE", offset, label="n", vector=True)

    # Blender's z up to y up is a turn about x, so the picture is not mirrored: (x, y, z) -> (x, z, -y).
    axes = builder.add_node(group, "ShaderNodeSeparateXYZ", "Blender's Axes")
    group.links.new(normal, axes.inputs[0])
    turned = builder.add_node(group, "ShaderNodeCombineXYZ", "Y Up")
    group.links.new(axes.outputs["X"], turned.inputs["X"])
    group.links.new(axes.outputs["Z"], turned.inputs["Y"])
    group.links.new(builder.add_math(group, "MULTIPLY", axes.outputs["Y"], -1.0, label="-y"), turned.inputs["Z"])
    upright = _add_menu(group, inputs.outputs["Up Axis"], "VECTOR", "Up Axis", {"Y": normal, "Z": turned.outputs[0]})

    n = builder.add_node(group, "ShaderNodeSeparateXYZ", "n with y up")
    group.links.new(upright, n.inputs[0])
    angle = builder.add_math(group, "ARCTAN2", n.outputs["X"], n.outputs["Z"], label="Longitude")
    u = builder.add_math(group, "MULTIPLY_ADD", angle, 0.5 / math.pi, 0.5, label="u")
    v = builder.add_math(group, "MULTIPLY_ADD", n.outputs["Y"], 0.5, 0.5, label="v")

    # Interpolation must not reach across a pole to the other one: end v at the centres of the outer rows.
    row = builder.add_node(group, "ShaderNodeValue", ROW_NODE).outputs[0]
    last = builder.add_math(group, "SUBTRACT", 1.0, row, label="1 - Half a Row")
    ended = builder.add_math(
        group, "MINIMUM", builder.add_math(group, "MAXIMUM", v, row, label="From"), last, label="To"
    )
    sphere = builder.add_node(group, "ShaderNodeCombineXYZ", "Sphere", inputs={"Z": 1.0})
    group.links.new(u, sphere.inputs["X"])
    group.links.new(ended, sphere.inputs["Y"])
    return sphere.outputs[0]


def _add_filters(group, inputs, vector):
    nearest = builder.add_node(group, "ShaderNodeTexImage", NEAREST_NODE, interpolation="Closest")
    bilinear = builder.add_node(group, "ShaderNodeTexImage", BILINEAR_NODE, interpolation="Linear")
    for node in (nearest, bilinear):
        group.links.new(vector, node.inputs["Vector"])
    color, alpha = bilinear.outputs["Color"], bilinear.outputs["Alpha"]

    # Two Menu Switch nodes on one menu clash, so the menu becomes numbers: 1 for nearest, 1 for mipmap.
    chosen = {"Nearest": (1, 0, 0), "Bilinear": (0, 0, 0), "Mipmap": (0, 1, 0)}
    choice = builder.add_node(group, "ShaderNodeSeparateXYZ", "Chosen")
    group.links.new(_add_menu(group, inputs.outputs["Filter"], "VECTOR", "Filter", chosen), choice.inputs[0])

    # Without OSL the Script node vanishes and its factor is 0: bilinear.
    script = script_node.add_script_node(group, SHADER, MIPMAP_NODE)
    if script is not None:
        group.links.new(vector, script.inputs["Vector"])
        lights = builder.add_node(group, "ShaderNodeGroup", "Scene", node_tree=glint_lights.build())
        group.links.new(lights.outputs[glint_lights.SAMPLES], script.inputs["Samples"])
        active = builder.add_math(group, "MULTIPLY", 0.0, choice.outputs["Y"], label="Mipmap Active")
        group.links.new(script.outputs["Active"], active.node.inputs[0])
        is_linked, probe_alpha = _add_alpha_probe(group)
        group.links.new(is_linked, script.inputs["Straight"])
        color = builder.add_mix(group, "RGBA", active, color, script.outputs["Color"], "Mipmap Color")
        mixed = builder.add_mix(group, "FLOAT", active, alpha, script.outputs["Alpha"], "Mipmap Alpha")
        alpha = builder.add_math(group, "MAXIMUM", mixed, probe_alpha, label="Alpha, Probe")

    output = builder.add_node(group, "NodeGroupOutput")
    color = builder.add_mix(group, "RGBA", choice.outputs["X"], color, nearest.outputs["Color"], "Nearest Color")
    alpha = builder.add_mix(group, "FLOAT", choice.outputs["X"], alpha, nearest.outputs["Alpha"], "Nearest Alpha")
    group.links.new(color, output.inputs["Color"])
    group.links.new(alpha, output.inputs["Alpha"])


def _add_alpha_probe(group):
    """Whether the group's Alpha output is in use: (1 if it is, else 0; a number below 0 to be made part of Alpha).

    Cycles divides the color of an Image Texture by alpha only if the node's Alpha is linked; our shader cannot see it,
    but it can see what another Image Texture does whose Alpha ends in the same output: white with alpha 0.5 turns gray
    if its Alpha leads nowhere.
    """
    probe = builder.add_node(group, "ShaderNodeTexImage", "Alpha Probe", image=_probe_image())
    is_linked = builder.add_math(group, "GREATER_THAN", probe.outputs["Color"], 0.75, label="Alpha Is Linked")
    return is_linked, builder.add_math(group, "SUBTRACT", probe.outputs["Alpha"], 1.0, label="Below 0")


def _probe_image():
    image = bpy.data.images.get((PROBE, None))
    if image is None:
        image = bpy.data.images.new(PROBE, 1, 1, alpha=True)
        image.generated_color = (1, 1, 1, 0.5)
    return image
