"""Whether an object may move, change its shape or show up elsewhere: what is judged at one frame must hold at all."""

from __future__ import annotations

import bpy

# Modifiers that leave a mesh within its box, or very nearly.
KEEPS_THE_BOX = {"BEVEL", "EDGE_SPLIT", "SUBSURF", "TRIANGULATE", "WEIGHTED_NORMAL"}
MODIFIERS_THAT_COPY = {"BOOLEAN", "PARTICLE_SYSTEM"}
NODES_THAT_COPY = {"GeometryNodeCollectionInfo", "GeometryNodeObjectInfo"}


def is_fixed(thing: bpy.types.Object, *, shape: bool = True) -> bool:
    """Whether object `thing` stays as it is at every frame, as far as can be told; False in doubt.

    shape: whether its shape must stay too, or only its place.
    """
    return (
        not _is_animated(thing)
        and keeps_its_place(thing)
        and (not shape or keeps_its_shape(thing))
        and (thing.parent is None or thing.parent_type == "OBJECT" and is_fixed(thing.parent, shape=shape))
    )


def keeps_its_place(thing: bpy.types.Object) -> bool:
    """Whether nothing but its own animation and its parent moves an object."""
    return not thing.constraints and thing.rigid_body is None


def keeps_its_shape(thing: bpy.types.Object) -> bool:
    """Whether the data of an object, and its modifiers unless they are animated, stay as they are."""
    shapes = getattr(thing.data, "shape_keys", None)
    return not any(_is_animated(block) for block in (thing.data, shapes)) and all(
        modifier.type in KEEPS_THE_BOX for modifier in thing.modifiers
    )


def has_fixed_box(thing: bpy.types.Object) -> bool:
    """Whether the object's box holds at every frame all that is rendered of it."""
    return is_fixed(thing) and has_rigid_box(thing)


def has_rigid_box(thing: bpy.types.Object) -> bool:
    """Whether the object's box, wherever it moves to, holds all that is rendered of it."""
    moves_surface = any(
        slot.material is not None and slot.material.displacement_method != "BUMP" for slot in thing.material_slots
    )
    return thing.type == "MESH" and keeps_its_shape(thing) and not moves_surface


def copies_others(thing: bpy.types.Object) -> bool:
    """Whether the object may show other objects elsewhere."""
    trees = [modifier.node_group for modifier in thing.modifiers if modifier.type == "NODES"]
    return (
        thing.instance_type != "NONE"
        or any(modifier.type in MODIFIERS_THAT_COPY for modifier in thing.modifiers)
        or any(_has_copying_nodes(tree, set()) for tree in trees)
    )


def _is_animated(block: bpy.types.ID | None) -> bool:
    animation = getattr(block, "animation_data", None)
    return animation is not None and bool(animation.action or animation.nla_tracks or animation.drivers)


def _has_copying_nodes(tree: bpy.types.NodeTree | None, seen: set[bpy.types.NodeTree]) -> bool:
    if tree is None or tree in seen:
        return False
    seen.add(tree)
    return any(
        node.bl_idname in NODES_THAT_COPY or _has_copying_nodes(getattr(node, "node_tree", None), seen)
        for node in tree.nodes
    )
