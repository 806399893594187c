"""Which materials have glints: the Glint BSDF groups with a map that they hold, at any depth."""

from __future__ import annotations

import bpy

from ..nodes.glint_bsdf import is_glint_group
from ..nodes.map_binding import map_of


def is_glint_material(material) -> bool:
    """Whether the material's node tree holds a Glint BSDF group with a map."""
    return bool(glint_groups(material))


def glint_groups(material) -> list[bpy.types.ShaderNodeTree]:
    """The Glint BSDF groups with a map that a material uses, also inside other groups; each once."""
    found = []
    seen = set()

    def search(tree):
        for node in tree.nodes if tree is not None else ():
            inner = node.node_tree if node.bl_idname == "ShaderNodeGroup" else None
            if inner is None or inner.name_full in seen:
                continue
            seen.add(inner.name_full)
            if is_glint_group(inner):
                if map_of(inner) is not None:
                    found.append(inner)
            else:
                search(inner)

    search(material.node_tree if material is not None else None)
    return found


def glint_lobes(material) -> int:
    """How many Glint BSDFs with a map a material may sum; those inside a group count as often as it is used."""

    def count(tree):
        inner = [node.node_tree for node in tree.nodes if node.bl_idname == "ShaderNodeGroup" and node.node_tree]
        return sum(map_of(each) is not None if is_glint_group(each) else count(each) for each in inner)

    return count(material.node_tree)
