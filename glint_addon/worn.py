"""The materials that objects show: those of their slots, and those that geometry nodes give them."""

from __future__ import annotations

import bpy


def worn_materials(thing, layers) -> list[bpy.types.Material]:
    """Materials of all that object `thing` shows in the view layers, which must be up to date; each once.

    Geometry nodes may set others than its slots hold, and place objects and meshes that have materials of their own.
    """
    found = [slot.material for slot in thing.material_slots]
    if _has_nodes(thing):
        for layer in layers:
            evaluated = thing.evaluated_get(layer.depsgraph)
            if evaluated.is_evaluated:
                found += _materials(evaluated.evaluated_geometry())
    return [material for material in dict.fromkeys(found) if material is not None]


def hides_materials(thing, layers) -> bool:
    """Whether geometry nodes may give `thing` materials that cannot be found, because only renders evaluate them."""
    nodes = [modifier for modifier in thing.modifiers if modifier.type == "NODES" and modifier.show_render
             and _sets_materials(modifier.node_group, set())]
    if not nodes:
        return False
    is_evaluated = any(thing.evaluated_get(layer.depsgraph).is_evaluated for layer in layers)
    return not is_evaluated or not all(modifier.show_viewport for modifier in nodes)


def _has_nodes(thing) -> bool:
    return any(modifier.type == "NODES" for modifier in thing.modifiers)


def _materials(geometry) -> list:
    """Materials of a geometry set and of the instances in it, originals."""
    parts = (geometry.mesh, geometry.curves, geometry.pointcloud, geometry.volume)
    found = [material.original for part in parts if part is not None for material in part.materials if material]
    for reference in geometry.instance_references():
        if isinstance(reference, bpy.types.GeometrySet):
            found += _materials(reference)
            continue
        things = [reference] if isinstance(reference, bpy.types.Object) else reference.all_objects
        found += [slot.material.original for thing in things for slot in thing.material_slots if slot.material]
    return found


def _sets_materials(tree, seen: set) -> bool:
    if tree is None or tree in seen:
        return False
    seen.add(tree)
    return any(node.bl_idname == "GeometryNodeSetMaterial" or _sets_materials(getattr(node, "node_tree", None), seen)
               for node in tree.nodes)
