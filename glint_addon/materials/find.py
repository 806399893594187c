"""Which materials have glints: the Glint BSDF groups with a map that they hold, at any depth."""

from __future__ import annotations

from collections.abc import Iterator

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


def glint_lobes(material) -> int:
    """How many Glint BSDFs with a map a material may sum; those inside a group count as often as it is used."""

    def count(tree):
        inner = [node.node_tree for node in tree.nodes if node.bl_idname == "ShaderNodeGroup" and node.node_tree]
        return sum(map_of(each) is not None if is_glint_group(each) else count(each) for each in inner)

    return count(material.node_tree)
