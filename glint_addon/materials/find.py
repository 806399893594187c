"""Which materials have glints: the Glint BSDF groups with a map that they hold, at any depth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy

from ..nodes.glint_bsdf import is_glint_group
from ..nodes.map_binding import map_of


def is_glint_material(material) -> bool:
    """Whether the material's node tree holds a Glint BSDF group with a map."""
    return bool(glint_groups(material))


def glint_groups(material) -> list[bpy.types.ShaderNodeTree]:
    """The Glint BSDF groups with a map that a material uses, also inside other groups; each once."""
    tree = material.node_tree if material is not None else None
    return [group for group in held_groups(tree) if is_glint_group(group) and map_of(group) is not None]


def held_groups(
    tree: bpy.types.NodeTree | None, seen: set[bpy.types.NodeTree] | None = None
) -> Iterator[bpy.types.ShaderNodeTree]:
    """The node groups inside node tree `tree`, or None, each once: at any depth, but not what Glint BSDF groups hold.

    seen: groups to leave out, with all that they hold; those found are added to it.
    """
    seen = set() if seen is None else seen
    for node in tree.nodes if tree is not None else ():
        inner = node.node_tree if node.bl_idname == "ShaderNodeGroup" else None
        if inner is None or inner in seen:
            continue
        seen.add(inner)
        yield inner
        if not is_glint_group(inner):
            yield from held_groups(inner, seen)


@dataclass(frozen=True)
class HeldNode:
    """A Glint BSDF node with a map that a material holds. outer: the group nodes around it, the outermost first."""

    node: bpy.types.ShaderNode
    outer: tuple[bpy.types.ShaderNode, ...] = ()

    @property
    def group(self) -> bpy.types.ShaderNodeTree:
        """The Glint BSDF group."""
        return self.node.node_tree

    @property
    def trees(self) -> tuple[bpy.types.NodeTree, ...]:
        """The material's tree and those of the groups around the node."""
        return tuple(each.id_data for each in (*self.outer, self.node))

    def value(self, name: str) -> float | None:
        """The number that an input of the node has, also where a group around it hands it down; None if others say."""
        socket, _ = handed_down(self.node.inputs[name], self.outer)
        is_animated = any(tree.animation_data is not None for tree in self.trees)
        return None if socket.is_linked or is_animated else socket.default_value


def handed_down(
    socket: bpy.types.NodeSocket, outer: tuple[bpy.types.ShaderNode, ...]
) -> tuple[bpy.types.NodeSocket, tuple[bpy.types.ShaderNode, ...]]:
    """The input whose value `socket` has, if groups around it hand one down, and the group nodes around that."""
    while outer and len(socket.links) == 1 and socket.links[0].from_node.bl_idname == "NodeGroupInput":
        name = socket.links[0].from_socket.identifier
        socket = next(each for each in outer[-1].inputs if each.identifier == name)
        outer = outer[:-1]
    return socket, outer


def held_nodes(material: bpy.types.Material) -> list[HeldNode]:
    """The Glint BSDF nodes with a map that a material holds; those inside a group once for each use of the group."""

    def held(tree, outer):
        for node in tree.nodes:
            inner = node.node_tree if node.bl_idname == "ShaderNodeGroup" else None
            if inner is not None and not is_glint_group(inner):
                yield from held(inner, (*outer, node))
            elif inner is not None and map_of(inner) is not None:
                yield HeldNode(node, outer)

    tree = material.node_tree if material is not None else None
    return list(held(tree, ())) if tree is not None else []


def glint_lobes(material) -> int:
    """How many Glint BSDFs with a map a material may sum; those inside a group count as often as it is used."""
    return len(held_nodes(material))
