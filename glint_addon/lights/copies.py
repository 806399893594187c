"""Copies of objects that exist only in an evaluated scene: of geometry nodes, particles, faces, nested collections."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
from mathutils import Matrix

from ..animation.motion import KEEPS_THE_BOX, is_fixed

NO_ID = 2**31 - 1  # Blender's filler for unused places of a persistent id
# Nodes whose result depends on the frame by itself.
NODES_OF_TIME = {"GeometryNodeInputSceneTime", "GeometryNodeSimulationOutput", "GeometryNodeInputActiveCamera"}


@dataclass(frozen=True)
class Copy:
    """A copy of object `source` that object `parent` shows; number: Blender's id, the same at every frame."""

    source: bpy.types.Object
    parent: bpy.types.Object
    number: tuple[int, ...]


def copies(layers: list[bpy.types.ViewLayer], shown: list[bpy.types.Object]) -> dict[Copy, Matrix]:
    """World matrices of all copies by the objects `shown` in the view layers, but for those that `is_plain`.

    Copies that are hidden in the viewport are missing, because Blender evaluates them only while it renders.
    """
    parents = set(shown)
    found: dict[Copy, Matrix] = {}
    for layer in layers:
        for entry in layer.depsgraph.object_instances:
            if entry.is_instance and entry.show_self and entry.parent.original in parents:
                numbers = tuple(number for number in entry.persistent_id if number != NO_ID)
                copy = Copy(entry.instance_object.original, entry.parent.original, numbers)
                # Leave out the mesh that a curve makes of itself.
                if not _is_plain(copy) and copy.source != copy.parent:
                    found.setdefault(copy, entry.matrix_world.copy())
    return found


def matrices_over(
    scene: bpy.types.Scene,
    layers: list[bpy.types.ViewLayer],
    shown: list[bpy.types.Object],
    wanted: Callable[[bpy.types.Object], bool],
) -> dict[Copy, dict[int, Matrix | None]]:
    """World matrices by frame of the copies whose source is `wanted`, over the frames of `scene`; None while not shown.

    Sets every frame, and the present one again.
    """
    present, subframe = scene.frame_current, scene.frame_subframe
    frames = range(scene.frame_start, scene.frame_end + 1)
    over: dict[Copy, dict[int, Matrix | None]] = {}
    try:
        for frame in frames:
            scene.frame_set(frame)
            for layer in layers:
                layer.update()
            for copy, matrix in copies(layers, shown).items():
                if wanted(copy.source):
                    over.setdefault(copy, dict.fromkeys(frames))[frame] = matrix
    finally:
        scene.frame_set(present, subframe=subframe)
        for layer in layers:
            layer.update()
    return over


def may_move(copy: Copy) -> bool:
    """Whether a copy may be elsewhere at other frames; True in doubt."""
    parent = copy.parent
    things = {parent, copy.source}
    if parent.instance_type == "COLLECTION":
        things |= _nested(parent.instance_collection, set())
    if parent.particle_systems or not all(is_fixed(thing, shape=False) for thing in things):
        return True
    shapes = getattr(parent.data, "shape_keys", None)
    modifiers = [modifier for modifier in parent.modifiers if modifier.type not in KEEPS_THE_BOX]
    return shapes is not None or any(modifier.type != "NODES" or _modifier_may_move(modifier) for modifier in modifiers)


def _is_plain(copy: Copy) -> bool:
    """Whether the copy is an object of the collection that its parent instances, of no collection within that."""
    return copy.parent.instance_type == "COLLECTION" and len(copy.number) == 1


def _nested(collection: bpy.types.Collection, found: set[bpy.types.Object]) -> set[bpy.types.Object]:
    """Objects of a collection and of those that its objects instance."""
    for thing in set(collection.all_objects) - found:
        found.add(thing)
        if thing.instance_type == "COLLECTION" and thing.instance_collection:
            _nested(thing.instance_collection, found)
    return found


def _modifier_may_move(modifier: bpy.types.Modifier) -> bool:
    inputs = modifier.properties.inputs
    known = [entry.identifier for entry in inputs.bl_rna.properties if entry.identifier.startswith("Socket_")]
    values = [getattr(getattr(inputs, name), "value", None) for name in known]
    return any(_input_may_move(value) for value in values) or _tree_may_move(modifier.node_group, set())


def _tree_may_move(tree: bpy.types.NodeTree | None, seen: set[bpy.types.NodeTree]) -> bool:
    if tree is None or tree in seen:
        return False
    seen.add(tree)
    sockets = (socket for node in tree.nodes for socket in node.inputs if hasattr(socket, "default_value"))
    return (
        tree.animation_data is not None
        or any(node.bl_idname in NODES_OF_TIME for node in tree.nodes)
        or any(_input_may_move(socket.default_value) for socket in sockets)
        or any(_tree_may_move(getattr(node, "node_tree", None), seen) for node in tree.nodes)
    )


def _input_may_move(value: object) -> bool:
    """Whether what a node or modifier takes in moves: an object, or a collection of them."""
    if isinstance(value, bpy.types.Collection):
        return not all(is_fixed(thing) for thing in value.all_objects)
    return isinstance(value, bpy.types.Object) and not is_fixed(value)
