"""Node group "Glint Lights": the small lights that a glint material looks for, and the scene's sample count.

Where materials look for different lights, the further sets are "Glint Lights.001" and so on, each with a number. The
group names no light and no scene: it reads the numbers of its set from the scene that is being rendered (see
`scene_lights`), by drivers that Blender evaluates without Python. So a saved file renders the same without the add-on,
in batch and in animation, one material serves several scenes, and a material that is appended brings no lamp along.
"""

from __future__ import annotations

import bpy

from ..errors import SceneError
from ..properties import LIGHT_SET, STAMP
from . import builder
from .driven import Driven, Variable, write_number
from .scene_lights import AXIS, HINT_COUNT, LIGHT, SHAPE, context_number

NAME = "Glint Lights"
VERSION = 5

# Values of a shape's X.
KIND_NONE = 0
KIND_SUN = 1
KIND_LOCAL = 2

SAMPLES = "Samples"
CLOSURES = "Closures"
AXIS_WORD = "Axis"
LIGHT_HELP = "Sun: unit vector towards the light, in world space. Other lights: position in world space, in metres"
SHAPE_HELP = (
    "X: 0 no light, 1 sun, 2 other light. Y: half-angle of a sun in radians, radius of other lights in metres. "
    "Z: half-angle in radians of the cone in which a light shines, 0 all around"
)
AXIS_HELP = "Unit vector in world space that points away from where a light with a cone shines: its object's Z axis"
# First entry and tooltip of each of a light's vectors, in the order of `slot_names`.
PARTS = ((LIGHT, LIGHT_HELP), (SHAPE, SHAPE_HELP), (AXIS, AXIS_HELP))

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

# Closures that the Glint BSDFs of a material may return together (osl/selection.h). On the CPU Cycles keeps 64 of a
# shading point; on a GPU its pool holds about ten: there the lobe stays out, and glints are rendered by nodes.
CLOSURE_COUNT = Driven(
    "64 if device < 1 else 0", (Variable("device", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.device"),)
)


def light_name(slot: int) -> str:
    """Name of the output, and of the node behind it, with direction or position of light `slot` (1 to HINT_COUNT)."""
    return f"Light {slot}"


def shape_name(slot: int) -> str:
    """Name of the output, and of the node behind it, with kind and size of light `slot` (1 to HINT_COUNT)."""
    return f"Shape {slot}"


def axis_name(slot: int) -> str:
    """Name of the output, and of the node behind it, with the axis of light `slot` (1 to HINT_COUNT)."""
    return f"{AXIS_WORD} {slot}"


def slot_names(slot: int) -> tuple[str, str, str]:
    """Names of the outputs with place, shape and axis of light `slot` (1 to HINT_COUNT)."""
    return light_name(slot), shape_name(slot), axis_name(slot)


def output_names() -> list[str]:
    """Names of all outputs."""
    return [SAMPLES, CLOSURES, *(name for slot in range(1, HINT_COUNT + 1) for name in slot_names(slot))]


def build() -> bpy.types.ShaderNodeTree:
    """The local group "Glint Lights", which holds set 1, built if the file has none.

    Raises SceneError if a group of that name exists that the extension did not make.
    """
    group = builder.local_group(NAME)
    if group is None:
        return _built(NAME, 1)
    refresh(group)
    return group


def build_set(number: int) -> bpy.types.ShaderNodeTree:
    """The local group that reads set `number`, 1 or more, built if the file has none."""
    if number == 1:
        build()  # a group of an older version has no number yet
    group = next((group for group in groups() if set_of(group) == number), None)
    return _built(f"{NAME}.{number - 1:03d}", number) if group is None else group


def set_of(group) -> int:
    """Number of the set that the group reads; 0 for a group of version 2 and before, which holds lights itself."""
    return group.get(LIGHT_SET, 0)


def refresh(group) -> None:
    """Let a group of an older version read the lights of the scene; what reads the group stays linked."""
    if builder.version_of(group) >= VERSION:
        return
    group.animation_data_clear()
    group.nodes.clear()
    group[LIGHT_SET] = 1 if group.name == NAME else _free_set()
    _add_nodes(group)
    builder.arrange(group)
    group[STAMP] = VERSION


def check_nodes(group) -> None:
    """Raise SceneError if the group lacks one of the nodes that read lights."""
    for slot in range(1, HINT_COUNT + 1):
        for name in slot_names(slot):
            if group.nodes.get(name) is None:
                raise SceneError(
                    f'Node group "{group.name}" has lost its node "{name}": delete the group, prepare again.')


def groups() -> list[bpy.types.ShaderNodeTree]:
    """All local groups of this kind, "Glint Lights" first, by name."""
    found = (group for group in bpy.data.node_groups if group.library is None and is_lights_group(group))
    return sorted(found, key=lambda group: (group.name != NAME, group.name))


def is_lights_group(group) -> bool:
    """Whether a node tree is such a group, local or linked."""
    return STAMP in group and shape_name(1) in group.nodes


def _built(name, number):
    group = builder.new_group(name, VERSION, "Lights that glints look for, and the number of samples")
    group[LIGHT_SET] = number
    _add_nodes(group)
    builder.arrange(group)
    return group


def _free_set() -> int:
    """The lowest number that no group in the file reads."""
    taken = {set_of(group) for group in bpy.data.node_groups if is_lights_group(group)}
    return next(number for number in range(1, len(taken) + 2) if number not in taken)


def _add_nodes(group):
    """The nodes, and the outputs that a new group or an older version lacks."""
    sources = {}
    for slot in range(1, HINT_COUNT + 1):
        for name, (part, help) in zip(slot_names(slot), PARTS, strict=True):
            node = builder.add_node(group, "ShaderNodeCombineXYZ", name)
            for axis, socket in enumerate(node.inputs):
                write_number(socket, context_number(set_of(group), slot, part + axis))
            sources[name] = node.outputs["Vector"], help
    for name, number, help in ((SAMPLES, SAMPLE_COUNT, "Samples a pixel of the render under way"),
                               (CLOSURES, CLOSURE_COUNT, "Closures of a material's glints: 64 on CPU, 0 on GPU")):
        sources[name] = builder.add_node(group, "ShaderNodeValue", name).outputs["Value"], help
        write_number(sources[name][0], number)

    present = {item.name for item in group.interface.items_tree}
    output = builder.add_node(group, "NodeGroupOutput")
    # Axes came last, in version 2: nodes keep their links to another group by the order in which sockets were made.
    for name, (source, help) in sorted(sources.items(), key=lambda item: item[0].startswith(AXIS_WORD)):
        if name not in present:
            kind = "NodeSocketFloat" if name in (SAMPLES, CLOSURES) else "NodeSocketVector"
            builder.add_output(group, builder.Socket(name, kind, help=help))
        group.links.new(source, output.inputs[name])
