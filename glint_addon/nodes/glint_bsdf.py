"""Glint BSDF: a normal map's glints, through OSL where Cycles has it, else by nodes (`places`).

The map belongs to the group, not to a socket: OSL needs its table's file name as a constant, and node groups have no
string sockets. So there is one group for each map and way of reading it: "Glint BSDF", "Glint BSDF.001", ...
Blender's own nodes inside the group say which image it reads and how (`map_binding`).
"""

from __future__ import annotations

import bpy

from ..errors import MapError, SceneError
from ..images import image_shape, is_several
from ..properties import OLD_INTERPOLATION, OLD_PROPERTIES, STAMP
from . import glint_lights, places, resampled, tiles
from .builder import (
    Socket,
    add_input,
    add_math,
    add_node,
    add_output,
    arrange,
    local_group,
    new_group,
    vector_or,
    version_of,
)
from .driven import Driven, Variable, driver_curve, write_number
from .flake_nodes import (
    BASE,
    PRESENCE_NODE,
    PRESENCE_ORIGINAL,
    add_flake_color,
    add_presence,
    presence_of,
    read_as_data,
)
from .map_binding import ORIGINAL_NODE, MapBinding, is_old, map_of, nodes_binding, write_reading
from .map_choices import CHOICES, FACETS_NODE, IMAGE_NODE, NORMAL_NODE, SHUFFLE_NODE
from .map_tables import SCRIPT_NODE, forget_table
from .script_node import add_script_node, osl_available
from .surface_kinds import KINDS, add_facets, surface_of

NAME = "Glint BSDF"
VERSION = 15
LIGHTS_NODE = "Lights"
CAUSTICS_NODE = "Caustics"
GRID_NODE = "OnGrid"
UV_NODE = "UV Map"
MIX_NODE = "OSL or native"
WAY_NODE = "OSL renders"
OSL_NODES = (SCRIPT_NODE, CAUSTICS_NODE, GRID_NODE, MIX_NODE)
OWN_NODES = (LIGHTS_NODE, UV_NODE, WAY_NODE)

# Whether Cycles runs the OSL lobe, in the scene that is being rendered: on a GPU it has too few closures.
OSL_RENDERS = Driven(
    "1 if device < 1 and osl > 0 else 0",
    (
        Variable("device", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.device"),
        Variable("osl", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.shading_system"),
    ),
)

# Whether glints are enumerated after diffuse bounces too, in the scene that is being rendered: where Cycles shows what
# facets throw on their neighbours, and does not blur it by Filter Glossy, which leaves nothing to gain.
CAUSTICS = Driven(
    "1 if caustics > 0 and blur <= 0 else 0",
    (
        Variable("caustics", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.caustics_reflective"),
        Variable("blur", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.blur_glossy"),
    ),
)

# Whether the OSL lobe can follow the grid of pixels (osl/pixel_grid.h): the filter is Blender's own (2 is
# Blackman-Harris), and the camera rests while a picture is taken and is perspective (0) or orthographic (1).
PIXEL_GRID = Driven(
    "1 if filter > 1 and filter < 3 and width > 1.49 and width < 1.51 and blur < 1 and camera < 2 else 0",
    (
        Variable("filter", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.pixel_filter_type"),
        Variable("width", "CONTEXT_PROP", "ACTIVE_SCENE", "cycles.filter_width"),
        Variable("blur", "CONTEXT_PROP", "ACTIVE_SCENE", "render.use_motion_blur"),
        Variable("camera", "CONTEXT_PROP", "ACTIVE_SCENE", "camera.data.type", 2.0),
    ),
)

ROUGHNESS = Socket(
    "Roughness", "NodeSocketFloat", default=0.1, low=0.0, high=1.0, subtype="FACTOR",
    help="Roughness of a single facet; its alpha is the square. Smaller: sharper, rarer, brighter glints",
    setting_help="Roughness of each facet between the map's texels, as in Glossy BSDF; alpha is its square",
)
STRENGTH = Socket(
    "Strength", "NodeSocketFloat", default=1.0, low=0.0, high=10.0,
    help="Scale of the map's slopes, as in the Normal Map node",
    setting_help="How much of the map's tilt is used, as in the Normal Map node",
)
VECTOR = Socket("Vector", "NodeSocketVector", help="Texture coordinates; the UV map if nothing is connected")
# Of all kinds of surface, below those of the kind.
COMMON = (ROUGHNESS, STRENGTH, VECTOR)
BSDF = Socket("BSDF", "NodeSocketShader")


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
        _add_sockets(group, binding)
        _add_nodes(group, binding)
        arrange(group)
    except Exception:
        bpy.data.node_groups.remove(group)
        raise
    return group


def is_glint_group(group) -> bool:
    """Whether a node tree is a Glint BSDF group."""
    return group is not None and STAMP in group and (IMAGE_NODE in group.nodes or OLD_INTERPOLATION in group)


def inputs_of(surface: str, *, has_base: bool = False) -> tuple[Socket, ...]:
    """Inputs of the groups with a kind of surface, in their order; has_base: whether not all texels are flakes."""
    return (*KINDS[surface].sockets, *COMMON, *((BASE,) if has_base else ()))


def lights_of(group):
    """The group "Glint Lights" that a Glint BSDF group reads, or None."""
    node = group.nodes.get(LIGHTS_NODE)
    return node.node_tree if node is not None else None


def group_binding(group) -> MapBinding:
    """What a Glint BSDF group reads, and how.

    Raises MapError for a way of reading that glints cannot follow, SceneError if a socket or one of the nodes that say
    it is missing.
    """
    if not is_old(group):
        _check_sockets(group)
    return nodes_binding(group)


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
    if version_of(group) != VERSION or not _is_complete(group):
        count = places.count_of(group)
        group.nodes.clear()
        _give_defaults(group, _add_sockets(group, binding))
        _add_nodes(group, binding)
        places.keep_count(group, count)
        arrange(group)
        for name in OLD_PROPERTIES:
            group.pop(name, None)
        group[STAMP] = VERSION
        forget_table(group)
    else:
        _follow_nodes(group, binding)


def _is_complete(group) -> bool:
    """Whether the nodes that Blender's own do not replace are all there, and the shader, if any, is compiled."""
    has_map = map_of(group) is not None
    names = (*OWN_NODES, *(resampled.NODES if has_map else ()))
    if osl_available():
        names = (*OSL_NODES, *names)
    are_there = all(name in group.nodes for name in names) and (not has_map or tiles.is_whole(group))
    return are_there and (not osl_available() or bool(group.nodes[SCRIPT_NODE].bytecode))


def _has_places(group) -> bool:
    """Whether the group has the nodes that choose among places of its map."""
    return map_of(group) is not None and all(name in group.nodes for name in resampled.NODES)


def share_closures(group, lobes: int):
    """Tell the group's OSL node how many Glint BSDFs, 1 or more, share the closures of a shading point with it."""
    _set_constant(group, "Lobes", lobes)


def limit_visits(group, visits: int):
    """Tell the group's OSL node how many elements of the map a sample visits at most, 1 to 4096 (osl/query.h)."""
    _set_constant(group, "Visits", visits)


def _set_constant(group, name, value):
    """Set an input of the OSL node, if it has one: groups that no camera sees stay as an older version made them."""
    script = group.nodes.get(SCRIPT_NODE)
    socket = script.inputs.get(name) if script is not None else None
    if socket is not None and socket.default_value != value:
        socket.default_value = value


def _check_sockets(group):
    present = {item.name for item in group.interface.items_tree}
    wanted = inputs_of(surface_of(group), has_base=presence_of(group) is not None)
    lost = [socket.name for socket in wanted if socket.name not in present]
    if lost:
        raise SceneError(f'Node group "{group.name}" has lost its socket "{lost[0]}": add its material anew.')


def _add_sockets(group, binding) -> list[str]:
    """Add the sockets that the group lacks (a new group lacks all); returns the names of these inputs."""
    present = {item.name for item in group.interface.items_tree}
    if BSDF.name not in present:
        add_output(group, BSDF)
    wanted = inputs_of(binding.surface, has_base=binding.presence is not None)
    lacking = [socket for socket in wanted if socket.name not in present]
    for socket in lacking:
        add_input(group, socket)
    # Without a value to show, a socket that is not connected gives textures their own coordinates: the UV map.
    group.interface.items_tree[VECTOR.name].hide_value = True
    return [socket.name for socket in lacking]


def _give_defaults(group, names):
    """Let all nodes that use the group have the defaults of inputs that were added: Blender leaves them at 0."""
    items = {name: group.interface.items_tree[name] for name in names}
    defaults = {name: item.default_value for name, item in items.items() if hasattr(item, "default_value")}
    trees = [material.node_tree for material in bpy.data.materials] + list(bpy.data.node_groups)
    for node in (node for tree in trees if tree is not None and tree.library is None for node in tree.nodes):
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree == group:
            for name, value in defaults.items():
                node.inputs[name].default_value = value


def _add_nodes(group, binding):
    source = add_node(group, "NodeGroupInput")
    output = add_node(group, "NodeGroupOutput")
    # Where nothing is connected to Vector: the active UV map, which the Image Texture then takes by itself.
    coordinates = add_node(group, "ShaderNodeUVMap", UV_NODE).outputs["UV"]
    glossy = _add_native_nodes(group, binding, source, coordinates)
    lights = add_node(group, "ShaderNodeGroup", LIGHTS_NODE, node_tree=glint_lights.build())
    way = add_node(group, "ShaderNodeValue", WAY_NODE).outputs["Value"]
    choose_way(group)
    native = glossy
    if binding.image is not None:
        native = resampled.add_surface(group, source, lights, coordinates, way, glossy)
        height, width, _ = image_shape(group.nodes[IMAGE_NODE].image)
        follow_footprints(group, (width, height), are_wide=True)
    script = add_script_node(group, "glint.osl", SCRIPT_NODE)
    if script is None:
        _follow_nodes(group, binding)
        group.links.new(native, output.inputs[BSDF.name])
        return

    _follow_nodes(group, binding)
    inputs = {ROUGHNESS: ROUGHNESS.name, STRENGTH: STRENGTH.name, **KINDS[binding.surface].sockets}
    links = [(source.outputs[socket.name], script.inputs[name]) for socket, name in inputs.items()]
    links.append((source.outputs[VECTOR.name], script.inputs["UV"]))
    links.append((coordinates, script.inputs["MapUV"]))
    links.append((glossy, script.inputs["Fallback"]))
    if binding.presence is not None:
        links.append((source.outputs[BASE.name], script.inputs["Base"]))
    for name in glint_lights.output_names():
        # The shader's names have no spaces: Light1.
        links.append((lights.outputs[name], script.inputs[name.replace(" ", "")]))
    for name, number in ((CAUSTICS_NODE, CAUSTICS), (GRID_NODE, PIXEL_GRID)):
        value = add_node(group, "ShaderNodeValue", name).outputs["Value"]
        write_number(value, number)
        links.append((value, script.inputs[name]))

    # Without OSL the Script node vanishes and the factor takes its own value, 0: by nodes. Cycles knows a product with
    # 0 before the render, so that only one of both ways is compiled.
    factor = add_math(group, "MULTIPLY", 0.0, way)
    links.append((script.outputs["Active"], factor.node.inputs[0]))
    mix = add_node(group, "ShaderNodeMixShader", MIX_NODE, inputs={"Factor": 0.0})
    links.append((factor, mix.inputs["Factor"]))
    links.append((native, mix.inputs[1]))
    links.append((script.outputs["BSDF"], mix.inputs[2]))
    links.append((mix.outputs[0], output.inputs[BSDF.name]))
    for one, other in links:
        group.links.new(one, other)


def takes_lobe(group) -> bool:
    """Whether the OSL lobe can read a Glint BSDF group's map here: a table holds one image, as it is at all frames."""
    image = map_of(group)
    return osl_available() and (image is None or not is_several(image))


def choose_way(group, *, by_nodes: bool = False):
    """Let the group render through OSL where it can and the scene's settings say so, or always `by_nodes`."""
    way = group.nodes.get(WAY_NODE)
    if way is not None:
        write_number(way.outputs["Value"], OSL_RENDERS if takes_lobe(group) and not by_nodes else 0.0)


def is_by_nodes(group, scene) -> bool:
    """Whether a Glint BSDF group that was prepared renders by nodes in `scene`, as it is set now."""
    if not _has_places(group) or WAY_NODE not in group.nodes:
        return False
    return is_way_chosen(group) or not (scene.cycles.device == "CPU" and scene.cycles.shading_system)


def is_way_chosen(group) -> bool:
    """Whether a Glint BSDF group renders by nodes, whatever a scene's settings say: it was prepared for no other."""
    way = group.nodes.get(WAY_NODE)
    return way is not None and driver_curve(way.outputs["Value"]) is None


def follow_footprints(group, size, *, are_wide: bool):
    """Let cuts and places of a Glint BSDF group, if it has any, know its map's `size` (width, height) in texels, and
    places whether a camera sees a footprint wider than a texel: where none does, they are not even compiled."""
    tiles.follow_size(group, size)
    if _has_places(group):
        places.follow_size(group, size)
        write_number(group.nodes[resampled.WIDE_NODE].outputs["Value"], float(are_wide))


def _follow_nodes(group, binding):
    """Let the places and the OSL node, where there are any, read the map as Blender's own nodes do."""
    if _has_places(group):
        write_reading(group, binding, resampled.COPIES)
        places.follow_distribution(group, binding.distribution == "GGX")
    script = group.nodes.get(SCRIPT_NODE)
    if script is None:
        return
    values = {choice.number: choice.value(getattr(binding, name)).number for name, choice in CHOICES.items()
              if choice.number}
    prefix = f"{binding.uv_map}." if binding.uv_map else "geom:"
    values |= {"TangentName": f"{prefix}tangent", "SignName": f"{prefix}tangent_sign"}
    for name, value in values.items():
        if script.inputs[name].default_value != value:
            script.inputs[name].default_value = value


def _add_native_nodes(group, binding, source, coordinates):
    """Blender's own nodes for the same surface; returns the BSDF output. coordinates: of the active UV map."""
    vector = source.outputs[VECTOR.name]
    if binding.variation == "SHUFFLE":
        vector = tiles.add_shuffle(group, vector_or(group, vector, coordinates), SHUFFLE_NODE)
    texture = add_node(group, "ShaderNodeTexImage", IMAGE_NODE)
    _read_map(group, binding.image)
    normal_map = add_node(group, "ShaderNodeNormalMap", NORMAL_NODE)
    facets = add_facets(group, binding.surface, FACETS_NODE)
    group.links.new(vector, texture.inputs["Vector"])
    group.links.new(source.outputs[STRENGTH.name], normal_map.inputs["Strength"])
    if binding.image is not None:
        group.links.new(texture.outputs["Color"], normal_map.inputs["Color"])
    group.links.new(normal_map.outputs["Normal"], facets.inputs["Normal"])
    for socket in (ROUGHNESS, *KINDS[binding.surface].sockets):
        group.links.new(source.outputs[socket.name], facets.inputs[socket.name])
    surface = facets.outputs["BSDF"]
    if binding.flake_color is not None:
        add_flake_color(group, source, vector, binding.flake_color)
    if binding.presence is not None:
        surface = add_presence(group, source, vector, binding.presence, surface)
    write_reading(group, binding)
    return surface


def follow_map(group, states=None):
    """Let the group read its map and its presence image as data and as they are now: where one is shown as colour, a
    copy that is up to date.

    states: `ImageStates`, where they are known or are to be. Raises MapError if pixels cannot be copied.
    """
    if group.nodes.get(IMAGE_NODE) is not None and map_of(group) is not None:
        _read_map(group, map_of(group), states)
    if presence_of(group) is not None:
        read_as_data(group, PRESENCE_NODE, PRESENCE_ORIGINAL, presence_of(group), states)
        resampled.follow_images(group)


def _read_map(group, image, states=None):
    read_as_data(group, IMAGE_NODE, ORIGINAL_NODE, image, states)
    resampled.follow_images(group)
