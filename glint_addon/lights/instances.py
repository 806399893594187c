"""Copies of lights and emissive meshes -> hints: of instanced collections, geometry nodes, particles, faces.

Drivers follow a light in a collection that an empty instances: they multiply both matrices. Drivers cannot follow other
copies (geometry nodes, particles, instances within instances): their places are constants, or keys at all frames of the
scene if anything that places them may move and a copy is shown at the present frame. The scene must be prepared again
when these change.
"""

from __future__ import annotations

import bpy
from mathutils import Matrix

from ..animation.curves import is_animated
from ..nodes.glint_lights import KIND_SUN
from .copies import Copy, copies, matrices_over, may_move
from .emitters import Shine, mesh_hint, shine, shines
from .emitters import reason_to_skip as reason_to_skip_mesh
from .hint import Hint, Instance, Pose
from .kind import lamp_at
from .lamps import lamp_hint
from .lamps import reason_to_skip as reason_to_skip_lamp
from .reasons import INVISIBLE, UNLINKED
from .receivers import Bounds, lit_objects, world_bounds


class _Finder:
    """Hints of copies; each source is judged once, whatever the number of its copies."""

    def __init__(self, layers: list[bpy.types.ViewLayer], receivers: list[bpy.types.Object], bounds: Bounds) -> None:
        self.layers, self.receivers, self.bounds = layers, receivers, bounds
        self.radiances: dict[bpy.types.Material, float] = {}
        self.reasons: dict[bpy.types.Object, str] = {}
        self.shines: dict[bpy.types.Object, Shine | None] = {}
        self.boxes: dict[bpy.types.Object, Bounds] = {}
        self.hints: list[Hint] = []
        self.skipped: list[tuple[str, str]] = []

    def is_light(self, thing: bpy.types.Object) -> bool:
        return thing.type == "LIGHT" or shines(thing, self.layers, self.radiances)

    def add(
        self, name: str, source: bpy.types.Object, shower: bpy.types.Object, matrix: Matrix, instance: Instance
    ) -> None:
        """Judge the copy of `source` that object `shower` shows at `matrix`; note its hint or the reason for none."""
        reason = self._reason(source) or ("" if shower.visible_glossy else INVISIBLE)
        if reason:
            self.skipped.append((name, reason))
            return
        boxes = self.boxes[source]
        if source.type == "LIGHT":
            self.hints.append(lamp_hint(name, lamp_at(source, matrix), boxes, instance=instance))
            return
        found = self.shines[source]
        if found is not None:
            self.hints.append(mesh_hint(name, matrix, found, boxes, instance=instance))

    def pose(self, source: bpy.types.Object, frame: int, matrix: Matrix | None) -> Pose:
        """Where a copy of `source` is at a frame, None for a matrix if it is not shown then."""
        if matrix is None or self._reason(source):
            return Pose(frame, None, 0.0)
        if source.type == "LIGHT":
            hint = lamp_hint("", lamp_at(source, matrix), self.boxes[source])
            x, y, z = matrix.col[2].to_3d().normalized() if hint.kind == KIND_SUN else matrix.translation
            return Pose(frame, (x, y, z), hint.size)
        found = self.shines[source]
        if found is None:
            return Pose(frame, None, 0.0)
        hint = mesh_hint("", matrix, found, self.boxes[source])
        return Pose(frame, hint.middle(matrix), hint.size)

    def _reason(self, source: bpy.types.Object) -> str:
        if source not in self.reasons:
            lit = lit_objects(source, self.receivers)
            self.boxes[source] = self.bounds if len(lit) == len(self.receivers) else world_bounds(lit)
            reason = UNLINKED if self.receivers and not lit else ""
            if source.type == "LIGHT":
                reason = reason or reason_to_skip_lamp(source)
            else:
                reason = reason or reason_to_skip_mesh(source)
                self.shines[source] = None if reason else shine(source, self.layers, self.radiances)
            self.reasons[source] = reason
        return self.reasons[source]


def instance_hints(
    scene: bpy.types.Scene,
    layers: list[bpy.types.ViewLayer],
    shown: list[bpy.types.Object],
    receivers: list[bpy.types.Object],
    bounds: Bounds,
) -> tuple[list[Hint], list[tuple[str, str]]]:
    """Hints for the copies of lights in `scene`, named "light in what shows it", and those skipped with the reason.

    shown: objects that `layers` render; receivers: objects with glints; bounds: their boxes, or others' where there are
    none. Matrices must be current. Where copies may move, all frames of the scene are visited.
    """
    finder = _Finder(layers, receivers, bounds)
    for empty in shown:
        if empty.instance_type != "COLLECTION" or empty.instance_collection is None:
            continue
        to_world = empty.matrix_world @ Matrix.Translation(-empty.instance_collection.instance_offset)
        for thing in sorted(rendered_members(empty.instance_collection), key=lambda thing: thing.name_full):
            if finder.is_light(thing):
                name = f"{thing.name} in {empty.name}"
                finder.add(name, thing, empty, to_world @ thing.matrix_world, Instance(thing, empty))

    found = {copy: matrix for copy, matrix in copies(layers, shown).items() if finder.is_light(copy.source)}
    moving = {copy: matrix for copy, matrix in found.items() if may_move(copy)}
    over = matrices_over(scene, layers, shown, finder.is_light) if moving else {}
    for name, copy in _named(found.keys() | over.keys()):
        matrix = found.get(copy)
        # The present frame may lie outside the range, and a copy that moves be shown at none within.
        is_over = copy in over and (copy in moving or matrix is None)
        frames = over[copy] if is_over else {scene.frame_current: matrix}
        poses = tuple(finder.pose(copy.source, frame, each) for frame, each in frames.items())
        shown_somewhere = matrix or next((each for each in frames.values() if each is not None), None)
        finder.add(name, copy.source, copy.parent, shown_somewhere, Instance(copy.source, None, poses))
    return finder.hints, finder.skipped


def rendered_members(collection: bpy.types.Collection) -> set[bpy.types.Object]:
    """Objects that an instance of `collection` shows in renders."""
    if collection.hide_render:
        return set()
    own = {thing for thing in collection.objects if not thing.hide_render or is_animated(thing, "hide_render")}
    return own.union(*(rendered_members(child) for child in collection.children))


def _named(found: set[Copy]) -> list[tuple[str, Copy]]:
    """Copies with names of their own, in an order that is the same at every frame."""
    ordered = sorted(found, key=lambda copy: (copy.source.name_full, copy.parent.name_full, copy.number))
    counts: dict[str, int] = {}
    named = []
    for copy in ordered:
        name = f"{copy.source.name} in {copy.parent.name}"
        counts[name] = counts.get(name, 0) + 1
        named.append((name if counts[name] == 1 else f"{name} {counts[name]}", copy))
    return named
