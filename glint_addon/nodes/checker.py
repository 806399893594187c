"""Node group "Glint Checker": color 1 where sin(x) sin(y) sin(z) < 0 at the world-space hit times a scale, or 2.

With OSL an optional filter shows the mean color over what each sample sees, so that far away the checker fades to
the right mean instead of aliasing; without OSL, and in EEVEE, the native nodes show the plain checker.
"""

from __future__ import annotations

import bpy

from . import builder, glint_lights, script_node
from .builder import Socket

NAME = "Glint Checker"
VERSION = 1
SHADER = "checker.osl"

OUTPUTS = (
    Socket("Color", "NodeSocketColor", help="Color 1 or Color 2"),
    Socket("Factor", "NodeSocketFloat", help="Share of Color 1, from 0 to 1"),
)
INPUTS = (
    Socket("Color 1", "NodeSocketColor", default=(0.8, 0.8, 0.8, 1), help="Where sin(x) sin(y) sin(z) < 0"),
    Socket("Color 2", "NodeSocketColor", default=(0.2, 0.2, 0.2, 1), help="Everywhere else"),
    Socket("Scale", "NodeSocketFloat", default=5.0, help="Radians a metre; a cell is pi / Scale metres wide"),
    Socket("Filter", "NodeSocketBool", default=True, help="Mean over what each sample sees (needs OSL)"),
)


def build() -> bpy.types.ShaderNodeTree:
    """The local group "Glint Checker".

    Raises SceneError if a group of that name exists that the extension did not make.
    """
    group = builder.local_group(NAME)
    if group is None:
        group = builder.new_group(NAME, VERSION, "Checker in world space that fades to its mean far away (with OSL)")
        builder.add_sockets(group, OUTPUTS, INPUTS)
        _add_nodes(group)
        builder.arrange(group)
    return group


def _add_nodes(group):
    inputs = builder.add_node(group, "NodeGroupInput")
    scale = inputs.outputs["Scale"]

    # sin(x) sin(y) sin(z) < 0
    position = builder.add_node(group, "ShaderNodeNewGeometry").outputs["Position"]
    scaled = builder.add_math(group, "SCALE", position, label="Hit times Scale", vector=True).node
    group.links.new(scale, scaled.inputs["Scale"])
    sines = builder.add_node(group, "ShaderNodeSeparateXYZ", "Sines")
    group.links.new(builder.add_math(group, "SINE", scaled.outputs[0], label="Sine", vector=True), sines.inputs[0])
    product = builder.add_math(group, "MULTIPLY", sines.outputs["X"], sines.outputs["Y"], label="sin(x) sin(y)")
    product = builder.add_math(group, "MULTIPLY", product, sines.outputs["Z"], label="sin(x) sin(y) sin(z)")
    factor = builder.add_math(group, "LESS_THAN", product, 0.0, label="Is Color 1")

    # Without OSL the Script node vanishes and the factor of the mix is 0: the plain checker.
    script = script_node.add_script_node(group, SHADER, "Filtered Checker")
    if script is not None:
        group.links.new(scale, script.inputs["Scale"])
        scene = builder.add_node(group, "ShaderNodeGroup", "Scene", node_tree=glint_lights.build())
        group.links.new(scene.outputs[glint_lights.SAMPLES], script.inputs["Samples"])
        active = builder.add_math(group, "MULTIPLY", 0.0, inputs.outputs["Filter"], label="Filter Active")
        group.links.new(script.outputs["Active"], active.node.inputs[0])
        factor = builder.add_mix(group, "FLOAT", active, factor, script.outputs["Share"], "Filtered")

    color = builder.add_mix(group, "RGBA", factor, inputs.outputs["Color 2"], inputs.outputs["Color 1"], "Color")
    output = builder.add_node(group, "NodeGroupOutput")
    group.links.new(color, output.inputs["Color"])
    group.links.new(factor, output.inputs["Factor"])
