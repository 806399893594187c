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


def hidden_materials(things, layers) -> dict:
    """{object: materials} that geometry nodes may give to objects of `things`, besides those that are worn: it cannot
    be told, because only renders evaluate the object or the modifier.
    """
    hidden = [thing for thing in things if _hides_nodes(thing, layers)]
    used = {}
    for block, users in (bpy.data.user_map() if hidden else {}).items():
        for user in users:
            used.setdefault(user, set()).add(block)
    return {thing: _reached(used.get(thing, set()) - {thing.parent}, used) - set(worn_materials(thing, layers))
            for thing in hidden}


def _hides_nodes(thing, layers) -> bool:
    """Whether geometry nodes change `thing` in renders that do not in the view layers."""
    shown = [modifier.show_viewport for modifier in thing.modifiers
             if modifier.type == "NODES" and modifier.show_render and modifier.node_group is not None]
    is_evaluated = any(thing.evaluated_get(layer.depsgraph).is_evaluated for layer in layers)
    return bool(shown) and not (is_evaluated and all(shown))


def _reached(blocks, used) -> set:
    """The materials among data-blocks and all that these use; used: {data-block: what it uses}."""
    seen, coming = set(), set(blocks)
    while coming:
        seen |= coming
        inner = [used.get(block, set()) for block in coming if not isinstance(block, bpy.types.Material)]
        coming = set().union(*inner) - seen
    return {block for block in seen if isinstance(block, bpy.types.Material)}


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
        for thing in things:
            found += [slot.material.original for slot in thing.material_slots if slot.material]
            if _has_nodes(thing) and thing.is_evaluated:
                found += _materials(thing.evaluated_geometry())
    return found
