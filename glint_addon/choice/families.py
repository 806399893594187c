"""Which materials look for the same lights.

Materials that hold their glints inside one group of the user's share what is in that group: they look for one set of
lights. A group that only one material uses, once, is that material's own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import bpy

from ..materials.find import HeldNode, held_nodes
from ..nodes.glint_bsdf import lights_of
from ..nodes.glint_lights import set_of


@dataclass(frozen=True)
class Family:
    """Materials that look for the same lights. objects: with any of them; held: their Glint BSDF nodes; nodes: the same
    where their groups may be replaced, none if the materials' groups must stay as they are; groups: the Glint BSDF
    groups in use; sets: numbers of the sets of lights that those of another file read, which must stay too."""

    materials: tuple[bpy.types.Material, ...]
    objects: tuple[bpy.types.Object, ...]
    held: tuple[HeldNode, ...]
    nodes: tuple[bpy.types.ShaderNode, ...]
    groups: tuple[bpy.types.ShaderNodeTree, ...]
    sets: frozenset[int] = frozenset()


def material_families(
    uses: Mapping[bpy.types.ShaderNodeTree, list[tuple[bpy.types.Object, bpy.types.Material]]]
) -> list[Family]:
    """Families by the name of their first material; those of materials that must stay as they are first."""
    pairs = sorted({(material.name_full, thing.name_full, material, thing) for group in uses
                    for thing, material in uses[group]}, key=lambda pair: pair[:2])
    groups: dict[bpy.types.Material, tuple[bpy.types.ShaderNodeTree, ...]] = {}
    objects: dict[bpy.types.Material, list[bpy.types.Object]] = {}
    for *_, material, thing in pairs:
        objects.setdefault(material, []).append(thing)
        groups[material] = tuple(group for group in uses if any(each == material for _, each in uses[group]))
    held = [material for material in objects if not _is_free(material, groups[material])]
    families = [_held_family(materials, sets, objects, groups) for sets, materials in _by_sets(held, groups)]
    for material in (material for material in objects if material not in held):
        nodes = tuple(held_nodes(material))
        families.append(Family((material,), tuple(objects[material]), nodes, tuple(each.node for each in nodes),
                               groups[material]))
    return families


def _by_sets(
    materials: Iterable[bpy.types.Material], groups: dict[bpy.types.Material, tuple[bpy.types.ShaderNodeTree, ...]]
) -> list[tuple[frozenset[int], list[bpy.types.Material]]]:
    """Materials that must stay, parted by the sets of lights of another file that they read."""
    parts: list[tuple[frozenset[int], list[bpy.types.Material]]] = []
    for material in materials:
        sets = frozenset(set_of(lights_of(group)) for group in groups[material]
                         if group.library is not None and lights_of(group) is not None)
        same = [part for part in parts if part[0] & sets or not part[0] | sets]
        parts = [part for part in parts if part not in same]
        together = [each for part in same for each in part[1]]
        parts.append((sets.union(*(part[0] for part in same)), [*together, material]))
    return parts


def _held_family(
    materials: list[bpy.types.Material],
    sets: frozenset[int],
    objects: dict[bpy.types.Material, list[bpy.types.Object]],
    groups: dict[bpy.types.Material, tuple[bpy.types.ShaderNodeTree, ...]],
) -> Family:
    things = dict.fromkeys(thing for material in materials for thing in objects[material])
    shared = dict.fromkeys(group for material in materials for group in groups[material])
    nodes = tuple(each for material in materials for each in held_nodes(material))
    return Family(tuple(materials), tuple(things), nodes, (), tuple(shared), sets)


def _is_free(material: bpy.types.Material, groups: tuple[bpy.types.ShaderNodeTree, ...]) -> bool:
    """Whether each of `groups` of a material may be replaced by another, in the material itself or in groups of the
    user's that nobody else uses."""
    nodes = held_nodes(material)
    own = {each.group for each in nodes if _is_alone(each)}
    return (material.library is None and material.override_library is None and set(groups) <= own
            and all(map(_is_alone, nodes)))


def _is_alone(held: HeldNode) -> bool:
    """Whether the groups around a node are of this file, and only used there."""
    return all(node.node_tree.library is None and node.node_tree.users == 1 for node in held.outer)
