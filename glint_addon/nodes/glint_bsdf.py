"""Glint BSDF: a normal map's glints, through OSL where Cycles has it, else Blender's own nodes.

The map belongs to the group, not to a socket: OSL needs its table's file name as a constant, and node groups have no
string sockets. So there is one group for each map and way of reading it: "Glint BSDF", "Glint BSDF.001", ...

Blender's own nodes inside the group say which image it reads and how. Nothing repeats that: whoever changes these nodes
changes what is prepared. An image in a custom property would be lost besides, because each preview of a material takes
one of its users away.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..errors import MapError, SceneError
from ..images import data_image, is_data_copy
from ..properties import (
    OLD_CONVENTION,
    OLD_DISTRIBUTION,
    OLD_EXTENSION,
    OLD_IMAGE,
    OLD_INTERPOLATION,
    OLD_PROPERTIES,
    OLD_UV_MAP,
    STAMP,
)
from . import glint_lights
from .builder import add_input, add_node, add_output, arrange, local_group, new_group, version_of
from .driven import Driven, Variable, write_number
from .map_tables import SCRIPT_NODE, forget_table, stored_text
from .script_node import add_script_node, osl_available

NAME = "Glint BSDF"
VERSION = 10
LIGHTS_NODE = "Lights"
CAUSTICS_NODE = "Caustics"
# Blender's own nodes, which say what the group reads.
IMAGE_NODE, NORMAL_NODE, FACETS_NODE = "Normal Map Image", "Tangent Space", "Facets"
UV_NODE = "UV Map"
MIX_NODE = "OSL or native"
OWN_NODES = (SCRIPT_NODE, LIGHTS_NODE, CAUSTICS_NODE, UV_NODE, MIX_NODE)
ORIGINAL_NODE = "Original"  # of an image that is shown as colour elsewhere: the group reads a copy, and this holds it
DISTRIBUTIONS = ("BECKMANN", "GGX")
INTERPOLATIONS = ("LINEAR", "CLOSEST")  # in the Image Texture node: Linear, Closest
CONVENTIONS = ("OPENGL", "DIRECTX")
EXTENSIONS = ("REPEAT", "EXTEND", "CLIP", "MIRROR")

# Up to version 9 custom properties said what a group reads.
VERSION_OF_NODES = 10

# Whether glints are enumerated after diffuse bounces too, in the scene that is being rendered: where Cycles shows what
# facets throw on their neighbours, and does not blur it by Filter Glossy, which leaves nothing to gain.
CAUSTICS = Driven(
    "1 if caustics > 0 and blur <= 0 else 0",
    (
        Variable("caustics", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.caustics_reflective"),
        Variable("blur", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.blur_glossy"),
    ),
)


@dataclass(frozen=True)
class MapBinding:
    """A normal map, the user's own image, and how it is read; the values are those of Blender's own nodes."""

    image: bpy.types.Image | None = None
    interpolation: str = "LINEAR"
    convention: str = "OPENGL"
    distribution: str = "BECKMANN"
    uv_map: str = ""
    extension: str = "REPEAT"

    def __post_init__(self):
        for value, allowed, what in (
            (self.interpolation, INTERPOLATIONS, "Interpolation"),
            (self.convention, CONVENTIONS, "Convention"),
            (self.distribution, DISTRIBUTIONS, "Distribution"),
            (self.extension, EXTENSIONS, "Extension"),
        ):
            if value not in allowed:
                raise MapError(f'{what} "{value}" is unknown: use one of {", ".join(allowed)}.')


SOCKETS = (
    ("Color", "NodeSocketColor", {"default": (1, 1, 1, 1), "help": "Reflectance of a facet"}),
    ("Roughness", "NodeSocketFloat", {
        "default": 0.1, "low": 0.0, "high": 1.0, "subtype": "FACTOR",
        "help": "Roughness of a single facet; its alpha is the square. Smaller: sharper, rarer, brighter glints"}),
    ("Strength", "NodeSocketFloat", {
        "default": 1.0, "low": 0.0, "high": 10.0, "help": "Scale of the map's slopes, as in the Normal Map node"}),
    ("Vector", "NodeSocketVector", {"help": "Texture coordinates; the UV map if nothing is connected"}),
)


def build() -> bpy.types.ShaderNodeTree:
    """Get or build the group without a map: a plain glossy surface until a map is chosen."""
    return group_for(MapBinding())


def group_for(binding: MapBinding) -> bpy.types.ShaderNodeTree:
    """Get or build the group that reads `binding`.

    Raises SceneError if a group of that name is not ours, ShaderError if the shader does not compile.
    """
    local_group(NAME)
    for group in bpy.data.node_groups:
        if is_glint_group(group) and group.library is None and reads(group, binding):
            return group
    group = new_group(NAME, VERSION, "Glints of a normal map's microstructure")
    try:
        forget_table(group)
        _add_sockets(group)
        _add_nodes(group, binding)
        arrange(group)
    except Exception:
        bpy.data.node_groups.remove(group)
        raise
    return group


def is_glint_group(group) -> bool:
    """Whether a node tree is a Glint BSDF group."""
    return group is not None and STAMP in group and (IMAGE_NODE in group.nodes or OLD_INTERPOLATION in group)


def map_of(group) -> bpy.types.Image | None:
    """The normal map of a Glint BSDF group: the user's own image, though the group may read a copy of it."""
    texture, original = group.nodes.get(IMAGE_NODE), group.nodes.get(ORIGINAL_NODE)
    if texture is None:
        return group.get(OLD_IMAGE)
    if original is not None and original.image is not None and is_data_copy(texture.image):
        return original.image
    return texture.image


def image_read(group) -> bpy.types.Image | None:
    """The image whose pixels a Glint BSDF group reads: its map, or the copy of that which is read as data."""
    texture = group.nodes.get(IMAGE_NODE)
    return texture.image if texture is not None else group.get(OLD_IMAGE)


def lights_of(group):
    """The group "Glint Lights" that a Glint BSDF group reads, or None."""
    node = group.nodes.get(LIGHTS_NODE)
    return node.node_tree if node is not None else None


def group_binding(group) -> MapBinding:
    """What a Glint BSDF group reads, and how: what Blender's own nodes in it say.

    Raises MapError for a way of reading that glints cannot follow, SceneError if one of those nodes, or a socket, is
    missing.
    """
    if OLD_INTERPOLATION in group and version_of(group) < VERSION_OF_NODES:
        return _old_binding(group)
    _check_sockets(group)
    texture, normal_map, facets = (_node(group, name) for name in (IMAGE_NODE, NORMAL_NODE, FACETS_NODE))
    return MapBinding(
        map_of(group),
        texture.interpolation.upper(),
        normal_map.convention,
        facets.distribution,
        normal_map.uv_map,
        texture.extension,
    )


def drop_pointers():
    """Let groups of version 9 and before keep their map in a node alone, before a preview takes it from them."""
    for group in bpy.data.node_groups:
        if group.library is None and group.get(OLD_IMAGE) is not None and IMAGE_NODE in group.nodes:
            if group.nodes[IMAGE_NODE].image is None:
                group.nodes[IMAGE_NODE].image = group[OLD_IMAGE]
            del group[OLD_IMAGE]


def reads(group, binding: MapBinding) -> bool:
    """Whether a Glint BSDF group reads `binding`; one that was changed so that it cannot be read does not."""
    try:
        return group_binding(group) == binding
    except (MapError, SceneError):
        return False


def refresh(group):
    """Bring a group of another version, of a Blender without OSL, or one that lost nodes up to date; its map, values
    and links stay.

    Where its nodes were changed by hand, the OSL node follows them.
    """
    binding = group_binding(group)
    if version_of(group) != VERSION or osl_available() and not _is_complete(group):
        group.nodes.clear()
        _give_defaults(group, _add_sockets(group))
        _add_nodes(group, binding)
        arrange(group)
        for name in OLD_PROPERTIES:
            group.pop(name, None)
        group[STAMP] = VERSION
        forget_table(group)
    else:
        _follow_nodes(group, binding)


def _is_complete(group) -> bool:
    """Whether the nodes that Blender's own do not replace are all there, and the shader is compiled."""
    return all(name in group.nodes for name in OWN_NODES) and bool(group.nodes[SCRIPT_NODE].bytecode)


def share_closures(group, lobes: int):
    """Tell the group's OSL node how many Glint BSDFs, 1 or more, share the closures of a shading point with it."""
    _set_constant(group, "Lobes", lobes)


def limit_visits(group, visits: int):
    """Tell the group's OSL node how many elements of the map a sample visits at most, 1 to 4096 (osl/query.h)."""
    _set_constant(group, "Visits", visits)


def _set_constant(group, name, value):
    """Groups that no camera sees stay as an older version made them, and may have no such input."""
    script = group.nodes.get(SCRIPT_NODE)
    socket = script.inputs.get(name) if script is not None else None
    if socket is not None and socket.default_value != value:
        socket.default_value = value


def _old_binding(group) -> MapBinding:
    """What a group of version 9 or before reads; its node has the image where the property has lost it."""
    texture = group.nodes.get(IMAGE_NODE)
    return MapBinding(
        group.get(OLD_IMAGE) or (texture.image if texture is not None else None),
        group[OLD_INTERPOLATION],
        group.get(OLD_CONVENTION, "OPENGL"),
        group.get(OLD_DISTRIBUTION, "BECKMANN"),
        stored_text(group, OLD_UV_MAP),
        group.get(OLD_EXTENSION, "REPEAT"),  # groups of version 3 and before have none
    )


def _check_sockets(group):
    present = {item.name for item in group.interface.items_tree}
    lost = [name for name, *_ in SOCKETS if name not in present]
    if lost:
        raise SceneError(f'Node group "{group.name}" has lost its socket "{lost[0]}": add its material anew.')


def _node(group, name):
    node = group.nodes.get(name)
    if node is None:
        raise SceneError(f'Node group "{group.name}" has lost its node "{name}": add its material anew.')
    return node


def _add_sockets(group) -> list[str]:
    """Add the sockets that the group lacks, a new group all; returns the names of these inputs."""
    present = {item.name for item in group.interface.items_tree}
    if "BSDF" not in present:
        add_output(group, "BSDF", "NodeSocketShader")
    added = [name for name, *_ in SOCKETS if name not in present]
    for name, kind, settings in SOCKETS:
        if name in added:
            add_input(group, name, kind, **settings)
    # Without a value to show, a socket that is not connected gives textures their own coordinates: the UV map.
    group.interface.items_tree["Vector"].hide_value = True
    return added


def _give_defaults(group, names):
    """Let all nodes that use the group have the defaults of inputs that were added: Blender leaves them at 0."""
    defaults = {name: group.interface.items_tree[name].default_value for name in names}
    trees = [material.node_tree for material in bpy.data.materials] + list(bpy.data.node_groups)
    for node in (node for tree in trees if tree is not None and tree.library is None for node in tree.nodes):
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree == group:
            for name, value in defaults.items():
                node.inputs[name].default_value = value


def _add_nodes(group, binding):
    source = add_node(group, "NodeGroupInput")
    output = add_node(group, "NodeGroupOutput")
    glossy = _add_native_nodes(group, binding, source)
    script = add_script_node(group, "glint.osl", SCRIPT_NODE)
    if script is None:
        group.links.new(glossy, output.inputs["BSDF"])
        return

    lights = add_node(group, "ShaderNodeGroup", LIGHTS_NODE, node_tree=glint_lights.build())
    # Where nothing is connected to Vector: the active UV map, which the Image Texture then takes by itself.
    coordinates = add_node(group, "ShaderNodeUVMap", UV_NODE)
    _follow_nodes(group, binding)
    links = [(source.outputs[name], script.inputs[name]) for name in ("Color", "Roughness", "Strength")]
    links.append((source.outputs["Vector"], script.inputs["UV"]))
    links.append((coordinates.outputs["UV"], script.inputs["MapUV"]))
    links.append((glossy, script.inputs["Fallback"]))
    for name in (glint_lights.SAMPLES, glint_lights.CLOSURES):
        links.append((lights.outputs[name], script.inputs[name]))
    caustics = add_node(group, "ShaderNodeValue", CAUSTICS_NODE).outputs["Value"]
    write_number(caustics, CAUSTICS)
    links.append((caustics, script.inputs["Caustics"]))
    for index in range(1, glint_lights.HINT_COUNT + 1):
        links.append((lights.outputs[f"Light {index}"], script.inputs[f"Light{index}"]))
        links.append((lights.outputs[f"Shape {index}"], script.inputs[f"Shape{index}"]))
        links.append((lights.outputs[f"Axis {index}"], script.inputs[f"Axis{index}"]))

    # Without OSL the Script node vanishes and the factor takes its own value, 0: Blender's own nodes.
    mix = add_node(group, "ShaderNodeMixShader", MIX_NODE, inputs={"Factor": 0.0})
    links.append((script.outputs["Active"], mix.inputs["Factor"]))
    links.append((glossy, mix.inputs[1]))
    links.append((script.outputs["BSDF"], mix.inputs[2]))
    links.append((mix.outputs[0], output.inputs["BSDF"]))
    for one, other in links:
        group.links.new(one, other)


def _follow_nodes(group, binding):
    """Let the OSL node, if there is one, read the map as Blender's own nodes do."""
    script = group.nodes.get(SCRIPT_NODE)
    if script is None:
        return
    prefix = f"{binding.uv_map}." if binding.uv_map else "geom:"
    for name, value in {
        "Linear": int(binding.interpolation == "LINEAR"),
        "Repeats": int(binding.extension == "REPEAT"),
        "GGX": int(binding.distribution == "GGX"),
        "TangentName": f"{prefix}tangent",
        "SignName": f"{prefix}tangent_sign",
    }.items():
        if script.inputs[name].default_value != value:
            script.inputs[name].default_value = value


def _add_native_nodes(group, binding, source):
    """Blender's own nodes for the same surface; returns the BSDF output."""
    texture = add_node(group, "ShaderNodeTexImage", IMAGE_NODE, interpolation=binding.interpolation.capitalize(),
                       extension=binding.extension)
    _read_map(group, binding.image)
    normal_map = add_node(group, "ShaderNodeNormalMap", NORMAL_NODE, uv_map=binding.uv_map,
                          convention=binding.convention)
    glossy = add_node(group, "ShaderNodeBsdfAnisotropic", FACETS_NODE, distribution=binding.distribution)
    group.links.new(source.outputs["Vector"], texture.inputs["Vector"])
    group.links.new(source.outputs["Strength"], normal_map.inputs["Strength"])
    if binding.image is not None:
        group.links.new(texture.outputs["Color"], normal_map.inputs["Color"])
    group.links.new(normal_map.outputs["Normal"], glossy.inputs["Normal"])
    group.links.new(source.outputs["Color"], glossy.inputs["Color"])
    group.links.new(source.outputs["Roughness"], glossy.inputs["Roughness"])
    return glossy.outputs["BSDF"]


def follow_map(group, states=None):
    """Let the group read its map as data and as it is now: where it is shown as colour, a copy that is up to date.

    states: `ImageStates`, where they are known or are to be. Raises MapError if its pixels cannot be copied.
    """
    if group.nodes.get(IMAGE_NODE) is not None and map_of(group) is not None:
        _read_map(group, map_of(group), states)


def _read_map(group, image, states=None):
    texture, original = group.nodes[IMAGE_NODE], group.nodes.get(ORIGINAL_NODE)
    wanted = data_image(image, texture.image, states) if image is not None else None
    if texture.image != wanted:
        texture.image = wanted
    if texture.image != image:
        original = original or add_node(group, "ShaderNodeTexImage", ORIGINAL_NODE)
        if original.image != image:
            original.image = image
    elif original is not None:
        group.nodes.remove(original)
