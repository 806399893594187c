"""Blender's own nodes for flakes in a Glint BSDF group: which texels are flakes, and the colour of each.

A presence image says where flakes are; elsewhere lies the Base, whatever shader that is. A colour image multiplies the
colour of the surface. Both are read texel by texel, as the normal map of flakes is.
"""

from __future__ import annotations

import bpy

from ..images import data_image, is_data_copy
from .builder import Socket, add_math, add_node
from .map_choices import FACETS_NODE
from .surface_kinds import KINDS, surface_of

PRESENCE_NODE, PRESENCE_ORIGINAL, FLAKE_COLOR_NODE = "Presence Image", "Presence Original", "Flake Color Image"
BASE_MIX = "Base or flake"
BASE = Socket("Base", "NodeSocketShader", help="What lies between the flakes")
# From which value on a texel is a flake.
THRESHOLD = 0.5


def presence_of(group) -> bpy.types.Image | None:
    """The presence image of a Glint BSDF group: the user's own image, though the group may read a copy of it."""
    return original_image(group, PRESENCE_NODE, PRESENCE_ORIGINAL)


def presence_read(group) -> bpy.types.Image | None:
    """The image whose pixels say where the flakes of a Glint BSDF group are: its presence image, or a copy as data."""
    node = group.nodes.get(PRESENCE_NODE)
    return node.image if node is not None else None


def flake_color_of(group) -> bpy.types.Image | None:
    """The image with the colours of a Glint BSDF group's flakes."""
    node = group.nodes.get(FLAKE_COLOR_NODE)
    return node.image if node is not None else None


def add_flake_color(group, source, coordinates, image):
    """Let each flake have the colour of `image`, read at `coordinates`, times that of the surface; source: the group's
    inputs."""
    socket = KINDS[surface_of(group)].color
    texture = _add_texture(group, coordinates, FLAKE_COLOR_NODE)
    texture.image = image
    product = add_math(group, "MULTIPLY", source.outputs[socket.name], texture.outputs["Color"], vector=True)
    group.links.new(product, group.nodes[FACETS_NODE].inputs[socket.name])


def add_presence(group, source, coordinates, image, surface):
    """Let the shader `surface` be seen where there are flakes in `image`, read at `coordinates`, and the group's Base
    elsewhere; returns the shader."""
    texture = _add_texture(group, coordinates, PRESENCE_NODE)
    read_as_data(group, PRESENCE_NODE, PRESENCE_ORIGINAL, image)
    is_flake = add_math(group, "GREATER_THAN", texture.outputs["Color"], THRESHOLD, label="Is Flake")
    mix = add_node(group, "ShaderNodeMixShader", BASE_MIX)
    for socket, shader in zip(mix.inputs, (is_flake, source.outputs[BASE.name], surface), strict=True):
        group.links.new(shader, socket)
    return mix.outputs[0]


def _add_texture(group, coordinates, name):
    texture = add_node(group, "ShaderNodeTexImage", name, interpolation="Closest")
    group.links.new(coordinates, texture.inputs["Vector"])
    return texture


def original_image(group, name: str, original_name: str) -> bpy.types.Image | None:
    """The user's own image that the node `name` shows; the node `original_name` has it where that shows a copy."""
    texture, original = group.nodes.get(name), group.nodes.get(original_name)
    if texture is None:
        return None
    if original is not None and original.image is not None and is_data_copy(texture.image):
        return original.image
    return texture.image


def read_as_data(group, name: str, original_name: str, image, states=None) -> None:
    """Let the node `name` show the values of `image` as they are now, by a copy where it is shown as colour elsewhere;
    the node `original_name` then has the image itself. states: `ImageStates`, where they are known or are to be.

    Raises MapError if its pixels cannot be copied.
    """
    texture, original = group.nodes[name], group.nodes.get(original_name)
    wanted = data_image(image, texture.image, states) if image is not None else None
    if texture.image != wanted:
        texture.image = wanted
    if wanted != image:
        original = original or add_node(group, "ShaderNodeTexImage", original_name)
        if original.image != image:
            original.image = image
    elif original is not None:
        group.nodes.remove(original)
