"""Give Glint BSDF nodes another group, which may have other sockets."""

from __future__ import annotations

from dataclasses import replace

import bpy

from ..images import flake_images, parts, recipe_of
from ..nodes.flake_nodes import BASE
from ..nodes.glint_bsdf import group_binding, group_for, is_glint_group
from ..nodes.map_binding import map_of
from ..nodes.surface_kinds import KINDS, surface_of
from .build import link_base


def follow_generated(image: bpy.types.Image) -> None:
    """Let all Glint BSDF nodes whose map is the generated `image` read it as its recipe says now: between its texels or
    not, and with the images of its flakes where the user chose no others."""
    recipe = recipe_of(image)
    if recipe is None:
        return
    for group in [each for each in bpy.data.node_groups if is_glint_group(each) and map_of(each) == image]:
        before = group_binding(group) if group.library is None else None
        if before is None:
            continue
        flakes = flake_images(image)
        for name in flakes:
            own = getattr(before, name)
            if own is not None and own not in parts(image).values():
                flakes[name] = own  # the user's choice
        if KINDS[before.surface].color is None:
            flakes["flake_color"] = None
        binding = replace(before, interpolation=recipe.generator.interpolation, **flakes)
        if binding != before:
            _replace_everywhere(group, binding)


def _replace_everywhere(group, binding):
    new = group_for(binding)
    trees = [material.node_tree for material in bpy.data.materials] + list(bpy.data.node_groups)
    for node in (node for tree in trees if tree is not None and tree.library is None for node in tree.nodes):
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree == group:
            replace_group(node, new)
    if group.users == 0:
        bpy.data.node_groups.remove(group)


def replace_group(node, group) -> None:
    """Let `node` use another Glint BSDF group: sockets of the same name keep their value and link, the colour of one
    kind of surface becomes that of the other, and new sockets have their defaults, Base a Principled BSDF."""
    before, after = (KINDS[surface_of(each)].color for each in (node.node_tree, group))
    if [socket.name for socket in node.inputs] == [item.name for item in _inputs(group)]:
        node.node_tree = group  # Blender keeps what belongs to the sockets of the same place
        return
    renamed = {before.name: after.name} if before is not None and after is not None else {}
    kept = {renamed.get(socket.name, socket.name): _state(socket) for socket in node.inputs}
    tree = node.id_data
    for link in [link for socket in node.inputs for link in socket.links]:
        tree.links.remove(link)
    node.node_tree = group
    for socket, item in zip(node.inputs, _inputs(group), strict=True):
        kind, value, source = kept.get(socket.name, ("", None, None))
        if kind != socket.bl_idname:
            value, source = getattr(item, "default_value", None), None
        if value is not None:
            socket.default_value = value
        if source is not None:
            tree.links.new(source, socket)
    base = node.inputs.get(BASE.name)
    if base is not None and not base.is_linked:
        link_base(tree, base)


def _inputs(group) -> list:
    return [item for item in group.interface.items_tree if item.item_type == "SOCKET" and item.in_out == "INPUT"]


def _state(socket) -> tuple:
    """(type, value or None, socket that is linked to it or None)."""
    value = getattr(socket, "default_value", None)
    value = value[:] if hasattr(value, "__len__") else value
    return socket.bl_idname, value, socket.links[0].from_socket if socket.is_linked else None
