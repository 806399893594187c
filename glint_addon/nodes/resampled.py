"""The surface of a Glint BSDF by nodes alone, with less noise than plain nodes: one of several places is kept.

A sample keeps one normal of its footprint, see `places`, with the colour of the flake there, and adds Blender's plain
nodes at the hit point with the weight that is left. Where that is of no use these remain alone.
"""

from __future__ import annotations

from functools import partial

from . import places
from .builder import add_math, add_node, feed, vector_or
from .flake_nodes import FLAKE_COLOR_NODE, PRESENCE_NODE, THRESHOLD
from .map_choices import FACETS_NODE, IMAGE_NODE, NORMAL_NODE, SHUFFLE_NODE
from .reflectance import add_reflectance
from .surface_kinds import KINDS, surface_of
from .tiles import PLACES_SHUFFLE, add_shuffle

WIDE_NODE = "Wider than a texel"
# The places' own copies of the nodes that read the map, and what chooses between them and plain nodes.
PLACES_IMAGE, TANGENT_NODE, BITANGENT_NODE = "Places Image", "Tangent", "Bitangent"
KEPT_NORMAL, KEPT_FACETS, OWN_MIX, PLACES_MIX = "Kept Normal", "Kept Facets", "Own Facets", "Places or plain"
KEPT_PRESENCE, KEPT_COLOR = "Kept Presence", "Kept Color"
NODES = (*places.NODES, PLACES_IMAGE, TANGENT_NODE, BITANGENT_NODE, KEPT_NORMAL, KEPT_FACETS, OWN_MIX, WIDE_NODE,
         PLACES_MIX)
# Of Blender's own nodes of a group their copies, which read the map in the same way.
COPIES = {IMAGE_NODE: (PLACES_IMAGE,), FACETS_NODE: (KEPT_FACETS,),
          NORMAL_NODE: (TANGENT_NODE, BITANGENT_NODE, KEPT_NORMAL), PRESENCE_NODE: (KEPT_PRESENCE,),
          FLAKE_COLOR_NODE: (KEPT_COLOR,)}
# Colours that a normal map has for its two axes.
AXES = {TANGENT_NODE: (1.0, 0.5, 0.5, 1.0), BITANGENT_NODE: (0.5, 1.0, 0.5, 1.0)}


def add_surface(group, source, lights, coordinates, way, plain):
    """Add the surface and the choice between it and `plain`, Blender's own nodes; returns the shader.

    source: the group's inputs; lights: the node "Glint Lights"; coordinates: of the active UV map; way: whether the OSL
    lobe renders.
    """
    roughness, strength = (source.outputs[name] for name in ("Roughness", "Strength"))
    coordinates = vector_or(group, source.outputs["Vector"], coordinates)
    texture = add_node(group, "ShaderNodeTexImage", PLACES_IMAGE, image=group.nodes[IMAGE_NODE].image)
    frame = [add_node(group, "ShaderNodeNormalMap", name, inputs={"Color": colour}).outputs["Normal"]
             for name, colour in AXES.items()]
    own = group.nodes[IMAGE_NODE].outputs["Color"]
    read_at = partial(_shuffled, group) if SHUFFLE_NODE in group.nodes else None
    found = places.add_places(group, texture, own, frame, lights, {
        "Coordinates": coordinates, "Roughness": roughness, "Strength": strength}, read_at)
    kept_normal = add_node(group, "ShaderNodeNormalMap", KEPT_NORMAL)
    group.links.new(found.kept, kept_normal.inputs["Color"])
    group.links.new(strength, kept_normal.inputs["Strength"])
    lobes = add_node(group, "ShaderNodeAddShader")
    group.links.new(_kept_lobe(group, source, found, kept_normal), lobes.inputs[0])
    group.links.new(_own_lobe(group, found, plain), lobes.inputs[1])
    return _add_choice(group, found, way, plain, lobes.outputs[0])


def _shuffled(group, place):
    return add_shuffle(group, place, PLACES_SHUFFLE)


def _kept_lobe(group, source, found, normal):
    """The lobe of the normal that was kept, with the weight that it stands for."""
    presence, color = (_copy(group, name, found.kept_place) for name in (PRESENCE_NODE, FLAKE_COLOR_NODE))
    lobe = add_node(group, "ShaderNodeBsdfAnisotropic", KEPT_FACETS)
    kind = KINDS[surface_of(group)]
    inputs = {socket.name: source.outputs[socket.name] for socket in kind.sockets}
    weight = found.kept_weight
    if color is not None:
        inputs[kind.color.name] = add_math(
            group, "MULTIPLY", inputs[kind.color.name], color.outputs["Color"], vector=True)
    if presence is not None:
        weight = add_math(group, "MULTIPLY", weight, _is_flake(group, presence))
    reflected = add_reflectance(group, surface_of(group), found.kept_cosine, inputs)
    feed(group, lobe.inputs["Color"], add_math(group, "SCALE", reflected, weight, vector=True))
    feed(group, lobe.inputs["Roughness"], source.outputs["Roughness"])
    feed(group, lobe.inputs["Normal"], normal.outputs["Normal"])
    return lobe.outputs["BSDF"]


def _copy(group, name, place):
    """A node that reads the image of the node `name` at a place, or None if the group has no such node."""
    if name not in group.nodes:
        return None
    node = add_node(group, "ShaderNodeTexImage", COPIES[name][0], image=group.nodes[name].image,
                    interpolation="Closest")
    group.links.new(place, node.inputs["Vector"])
    return node


def _own_lobe(group, found, plain):
    """Blender's own nodes with the weight of the normal at the hit point; what lies between flakes with weight 1."""
    weight = found.own_weight
    if PRESENCE_NODE in group.nodes:
        between = add_math(group, "SUBTRACT", 1.0, _is_flake(group, group.nodes[PRESENCE_NODE]))
        weight = add_math(group, "MAXIMUM", weight, between)
    mix = add_node(group, "ShaderNodeMixShader", OWN_MIX)
    group.links.new(weight, mix.inputs["Factor"])
    group.links.new(plain, mix.inputs[2])
    return mix.outputs[0]


def _is_flake(group, presence):
    return add_math(group, "GREATER_THAN", presence.outputs["Color"], THRESHOLD)


def _add_choice(group, found, way, plain, chosen):
    """The shader `chosen` where places are of use, else `plain`."""
    # After a diffuse bounce the view comes from so near and wide that a footprint would blur; Cycles skips what is
    # behind a factor of 0, and compiles none of it where the factor is 0 before the render.
    bounced = add_node(group, "ShaderNodeLightPath").outputs["Is Diffuse Ray"]
    is_useful = add_math(group, "MULTIPLY", found.is_useful, add_math(group, "SUBTRACT", 1.0, bounced))
    is_wide = add_node(group, "ShaderNodeValue", WIDE_NODE).outputs["Value"]
    by_nodes = add_math(group, "MULTIPLY", is_wide, add_math(group, "SUBTRACT", 1.0, way))
    mix = add_node(group, "ShaderNodeMixShader", PLACES_MIX)
    for socket, shader in zip(mix.inputs, (add_math(group, "MULTIPLY", by_nodes, is_useful), plain, chosen),
                              strict=True):
        group.links.new(shader, socket)
    return mix.outputs[0]


def follow_images(group):
    """Let the copies read the same images as Blender's own nodes in the group."""
    for name in (IMAGE_NODE, PRESENCE_NODE, FLAKE_COLOR_NODE):
        for copy in COPIES[name]:
            node = group.nodes.get(copy)
            if node is not None and node.image != group.nodes[name].image:
                node.image = group.nodes[name].image
