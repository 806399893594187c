"""Node group "Glint Lights": the small lights that a glint material looks for, and the scene's sample count.

Where materials look for different lights, the further sets are "Glint Lights.001" and so on. The numbers
are constants or driven by simple expressions (see `lights.drivers`), so a saved file renders the same without the
add-on, in batch and in animation.
"""

from __future__ import annotations

import bpy

from . import builder
from .driven import Driven, Variable, write_number

NAME = "Glint Lights"
VERSION = 2
HINT_COUNT = 8  # all hints share the 64 closures of a shading point: 8 leave each of them 8 closures

# Values of a shape's X.
KIND_NONE = 0
KIND_SUN = 1
KIND_LOCAL = 2

SAMPLES = "Samples"
CLOSURES = "Closures"
LIGHT_HELP = "Sun: unit vector towards the light, in world space. Other lights: position in world space, in metres"
SHAPE_HELP = (
    "X: 0 no light, 1 sun, 2 other light. Y: half-angle of a sun in radians, radius of other lights in metres. "
    "Z: half-angle in radians of the cone in which a light shines, 0 all around"
)
AXIS_HELP = "Unit vector in world space that points away from where a light with a cone shines: its object's Z axis"

# Samples of the render under way: the view layer may override the scene's, by one of three rules
# (0 use, 1 use as an upper bound, 2 ignore), and 0 of its samples means no override.
SAMPLE_COUNT = Driven(
    "layer if layer > 0 and (rule < 1 or rule < 2 and layer < samples) else samples",
    (
        Variable("samples", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.samples"),
        Variable("rule", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.use_layer_samples"),
        Variable("layer", "CONTEXT_PROP", "ACTIVE_VIEW_LAYER", "samples"),
    ),
)

# Closures a shading point may return. On the CPU Cycles keeps 64; on a GPU its pool holds about ten and drops the rest
# in silence, which would darken the picture: there the lobe stays out, and Blender's own answer is rendered.
CLOSURE_COUNT = Driven(
    "60 if device < 1 else 0", (Variable("device", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.device"),)
)


def light_name(slot: int) -> str:
    """Name of the output, and of the node behind it, with direction or position of light `slot` (1 to HINT_COUNT)."""
    return f"Light {slot}"


def shape_name(slot: int) -> str:
    """Name of the output, and of the node behind it, with kind and size of light `slot` (1 to HINT_COUNT)."""
    return f"Shape {slot}"


def axis_name(slot: int) -> str:
    """Name of the output, and of the node behind it, with the axis of light `slot` (1 to HINT_COUNT)."""
    return f"Axis {slot}"


def build() -> bpy.types.ShaderNodeTree:
    """The local group "Glint Lights", built without any light if the file has none.

    Raises SceneError if a group of that name exists that the extension did not make.
    """
    group = builder.local_group(NAME)
    if group is None:
        return build_another()
    refresh(group)
    return group


def build_another() -> bpy.types.ShaderNodeTree:
    """One more group of this kind, without any light."""
    group = builder.new_group(NAME, VERSION, "Lights that glints look for, and the number of samples")
    _add_outputs(group)
    _add_nodes(group)
    _add_axes(group)
    builder.arrange(group)
    return group


def refresh(group) -> None:
    """Give a group of version 1, whose lights have no axes, what it lacks; its lights stay as they are."""
    if group[builder.STAMP] < VERSION:
        _add_axes(group)
        builder.arrange(group)
        group[builder.STAMP] = VERSION


def groups() -> list[bpy.types.ShaderNodeTree]:
    """All local groups of this kind, "Glint Lights" first, by name."""
    found = (group for group in bpy.data.node_groups
             if group.library is None and builder.STAMP in group and shape_name(1) in group.nodes)
    return sorted(found, key=lambda group: (group.name != NAME, group.name))


def _add_outputs(group):
    for slot in range(1, HINT_COUNT + 1):
        builder.add_output(group, light_name(slot), "NodeSocketVector", help=LIGHT_HELP)
        builder.add_output(group, shape_name(slot), "NodeSocketVector", help=SHAPE_HELP)
    builder.add_output(group, SAMPLES, "NodeSocketFloat", help="Samples a pixel of the render under way")
    builder.add_output(group, CLOSURES, "NodeSocketFloat", help="Closures a glint may use: 60 on CPU, 0 on GPU")


def _add_nodes(group):
    names = [name(slot) for slot in range(1, HINT_COUNT + 1) for name in (light_name, shape_name)]
    sources = {name: builder.add_node(group, "ShaderNodeCombineXYZ", name).outputs["Vector"] for name in names}
    for name, number in ((SAMPLES, SAMPLE_COUNT), (CLOSURES, CLOSURE_COUNT)):
        sources[name] = builder.add_node(group, "ShaderNodeValue", name).outputs["Value"]
        write_number(sources[name], number)

    output = builder.add_node(group, "NodeGroupOutput")
    for name, source in sources.items():
        group.links.new(source, output.inputs[name])


def _add_axes(group):
    names = [axis_name(slot) for slot in range(1, HINT_COUNT + 1)]
    for name in names:
        builder.add_output(group, name, "NodeSocketVector", help=AXIS_HELP)
    (output,) = (node for node in group.nodes if node.bl_idname == "NodeGroupOutput")
    for name in names:
        node = builder.add_node(group, "ShaderNodeCombineXYZ", name)
        group.links.new(node.outputs["Vector"], output.inputs[name])
