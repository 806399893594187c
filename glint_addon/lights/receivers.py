"""The objects with glints, their bounds, and which of them a light's linking lets it shine on."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Matrix

from ..animation.motion import copies_others, has_fixed_box
from ..materials.find import held_groups
from ..materials.worn import worn_materials
from ..nodes.glint_bsdf import is_glint_group

MOST_COPIES = 64  # of an object: lights are ranked by its places, and further copies are near those

# World matrices, (4, 4) each, of objects that have copies.
CopiedPlaces = dict[bpy.types.Object, list[np.ndarray]]
# Low and high corners, (n, 3) each, of boxes in world space, in metres.
Bounds = tuple[np.ndarray, np.ndarray]


def glint_objects(objects: Iterable[bpy.types.Object], layers: list[bpy.types.ViewLayer]) -> list[bpy.types.Object]:
    """Those of `objects` that show, in the view layers, a material with a Glint BSDF group, at any depth."""
    known: dict[bpy.types.Material, bool] = {}
    return [
        thing
        for thing in objects
        if any(_shows_glints(material, known) for material in worn_materials(thing, layers))
    ]


def _shows_glints(material: bpy.types.Material, known: dict[bpy.types.Material, bool]) -> bool:
    """Whether a material holds a Glint BSDF group, also one without a map; `known` remembers the materials seen."""
    if material not in known:
        known[material] = any(map(is_glint_group, held_groups(material.node_tree)))
    return known[material]


def are_still(receivers: list[bpy.types.Object], scene: bpy.types.Scene) -> bool:
    """Whether what lamps miss now they miss at every frame: the boxes of `receivers`, which are some, stay where they
    are, and nothing in `scene` may show copies elsewhere."""
    fixed = bool(receivers) and all(has_fixed_box(thing) for thing in receivers)
    return fixed and not any(copies_others(thing) for thing in scene.objects)


def copied_places(scene: bpy.types.Scene, layers: list[bpy.types.ViewLayer]) -> CopiedPlaces:
    """World matrices {object: [(4, 4), ...]} of all objects of which the view layers show copies, at the present frame;
    also of the object itself where it is in the scene, and of a part of its copies where they are many."""
    if not any(copies_others(thing) for thing in scene.objects):
        return {}
    own = set(scene.objects)
    found: dict[bpy.types.Object, list[Matrix]] = {}
    for layer in layers:
        for entry in layer.depsgraph.object_instances:
            if entry.is_instance and entry.show_self:
                source = entry.instance_object.original
                found.setdefault(source, [source.matrix_world] if source in own else []).append(
                    entry.matrix_world.copy())
    return {thing: [np.array(matrix) for matrix in matrices[::1 + len(matrices) // MOST_COPIES]]
            for thing, matrices in found.items()}


def world_bounds(objects: list[bpy.types.Object], copied: CopiedPlaces | None = None) -> Bounds:
    """Low and high corners, (n, 3) each, of the objects' boxes in world space, in metres; the origin for no objects.

    copied: `copied_places` of those that have copies.
    """
    if not objects:
        return np.zeros((1, 3)), np.zeros((1, 3))
    pairs = [(np.array(thing.bound_box), np.array(matrix)) for thing in objects
             for matrix in (copied or {}).get(thing, [thing.matrix_world])]
    corners, matrices = (np.array(side) for side in zip(*pairs, strict=True))
    world = corners @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]
    return world.min(axis=1), world.max(axis=1)


def lit_objects(lamp: bpy.types.Object, objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those of `objects` that light linking lets light object `lamp` shine on.

    A receiver collection with included members lights only those; one with excluded members alone lights all others.
    """
    receivers = lamp.light_linking.receiver_collection
    if receivers is None:
        return list(objects)
    states: dict[bpy.types.Object, str] = {}
    for entry, child in zip(receivers.collection_children, receivers.children, strict=True):
        states.update(dict.fromkeys(child.all_objects, entry.light_linking.link_state))
    for entry, thing in zip(receivers.collection_objects, receivers.objects, strict=True):
        states[thing] = entry.light_linking.link_state
    otherwise = "EXCLUDE" if "INCLUDE" in states.values() else "INCLUDE"
    return [thing for thing in objects if states.get(thing, otherwise) == "INCLUDE"]
