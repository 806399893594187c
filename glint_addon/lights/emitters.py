"""Objects with emissive faces -> hints: bulbs, tubes, neon signs. Large ones light glints well enough without.

What a mesh sends out is estimated: all faces of one material alike, without textures, shadows or cosines.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..animation.motion import KEEPS_THE_BOX, is_fixed, keeps_its_shape
from ..materials.worn import worn_materials
from ..nodes.glint_lights import KIND_LOCAL
from .emission import sampled_radiance
from .hint import Ball, Hint
from .irradiance import NEAREST
from .reasons import INVISIBLE, reason_here
from .receivers import Bounds, are_still, lit_objects, world_bounds
from .softness import SOFT_HALF_ANGLE, TOO_SOFT, least_half_angle

EMITTERS = {"MESH", "CURVE", "FONT", "SURFACE"}
# Modifiers that make a mesh another, but always the same from the same.
MAKES_THE_SAME = KEEPS_THE_BOX | {"DECIMATE", "REMESH", "SCREW", "SOLIDIFY", "WELD", "WIREFRAME"}

DEFORMS = "its shape may change, which no driver can follow: left to chance"


@dataclass(frozen=True)
class Shine:
    """The faces of an object that shine. ball: around them; area [m^2] in the object's own space; radiance: mean over
    them [W/(m^2 sr)]."""

    ball: Ball
    area: float
    radiance: float


def mesh_emitters(
    scene: bpy.types.Scene,
    layers: list[bpy.types.ViewLayer],
    rendered: set[bpy.types.Object],
    receivers: list[bpy.types.Object],
    bounds: Bounds,
) -> tuple[list[Hint], list[tuple[str, str]]]:
    """Hints for the emissive objects of `scene`, and those skipped as (name, reason in words).

    rendered: objects in collections that `layers` render; receivers: objects with glints; bounds: their boxes, or
    others' where there are none. Matrices must be current.
    """
    is_still = are_still(receivers, scene)
    hints: list[Hint] = []
    skipped: list[tuple[str, str]] = []
    known: dict[bpy.types.Material, float] = {}
    for thing in scene.objects:
        if not shines(thing, layers, known):
            continue
        lit = lit_objects(thing, receivers)
        reason = reason_here(thing, thing in rendered, bool(lit) or not receivers) or reason_to_skip(thing)
        found = None if reason else shine(thing, layers, known)
        if found is not None:
            boxes = bounds if len(lit) == len(receivers) else world_bounds(lit)
            hint = mesh_hint(thing.name, thing.matrix_world, found, boxes, object=thing)
            if is_still and is_fixed(thing) and _is_soft(hint, thing.matrix_world, found, boxes):
                reason = TOO_SOFT
            else:
                hints.append(hint)
        if reason:
            skipped.append((thing.name, reason))
    return hints, skipped


def shines(thing: bpy.types.Object, layers: list[bpy.types.ViewLayer], known: dict[bpy.types.Material, float]) -> bool:
    """Whether Cycles samples an object as a light; `known` remembers each material's radiance."""
    materials = worn_materials(thing, layers) if thing.type in EMITTERS else []
    for material in materials:
        if material not in known:
            known[material] = sampled_radiance(material)
    return any(known[material] > 0.0 for material in materials)


def reason_to_skip(thing: bpy.types.Object) -> str:
    """Why an emissive object needs no hint wherever it is, in words, or an empty string."""
    if not thing.visible_glossy:
        return INVISIBLE
    return "" if _keeps_its_shape(thing) else DEFORMS


def shine(
    thing: bpy.types.Object, layers: list[bpy.types.ViewLayer], known: dict[bpy.types.Material, float]
) -> Shine | None:
    """The faces of an object that shine, None if there are none in the view layers."""
    depsgraph = next((layer.depsgraph for layer in layers if thing.name in layer.objects), layers[0].depsgraph)
    evaluated = thing.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    if mesh is None:
        return None
    try:
        return _shine(thing, mesh, known)
    finally:
        evaluated.to_mesh_clear()


def mesh_hint(name: str, matrix: Matrix, found: Shine, boxes: Bounds, **where: Any) -> Hint:
    """The hint of an object with emissive faces whose world matrix is `matrix`; where: its object or instance."""
    scale = _largest_scale(matrix)
    size = found.ball.radius * scale
    hint = Hint(name, KIND_LOCAL, 0.0, size, ball=found.ball, **where)
    middle = np.array(hint.middle(matrix))
    low, high = boxes
    distance = np.maximum(np.linalg.norm(np.clip(middle, low, high) - middle, axis=1), max(NEAREST, size))
    power = float((found.radiance * _cross_section(found, scale) / distance**2).max(initial=0.0))
    return Hint(name, KIND_LOCAL, power, size, ball=found.ball, **where)


def _keeps_its_shape(thing: bpy.types.Object) -> bool:
    """Whether the object's faces stay where they are in its own space, as far as can be told."""
    if all(modifier.type in KEEPS_THE_BOX for modifier in thing.modifiers):
        return keeps_its_shape(thing)
    animation = thing.animation_data
    return animation is None and all(modifier.type in MAKES_THE_SAME for modifier in thing.modifiers)


def _shine(thing: bpy.types.Object, mesh: bpy.types.Mesh, known: dict[bpy.types.Material, float]) -> Shine | None:
    # Find the faces that shine.
    values = np.array([known[slot.material] for slot in thing.material_slots])
    faces = len(mesh.polygons)
    slots, areas = np.zeros(faces, np.int32), np.zeros(faces, np.float32)
    mesh.polygons.foreach_get("material_index", slots)
    mesh.polygons.foreach_get("area", areas)
    radiances = values[np.minimum(slots, len(values) - 1)]
    power = float(radiances @ areas)
    if not power > 0.0:
        return None

    # Bound them by a ball around the middle of their box.
    corners, starts = np.zeros(len(mesh.loops), np.int32), np.zeros(faces, np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.polygons.foreach_get("loop_start", starts)
    points = np.zeros(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    sizes = np.diff(np.append(starts, len(corners)))
    points = points.reshape(-1, 3)[corners[np.repeat(radiances > 0.0, sizes)]].astype(float)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    area = float(areas[radiances > 0.0].sum())
    x, y, z = middle.tolist()
    return Shine(Ball((x, y, z), radius), area, power / area)


def _cross_section(found: Shine, scale: float) -> float:
    """Area [m^2] that the faces show from afar: half of a thin sheet's, which has one side for each, and never more
    than the disk of their ball, which is a ball's."""
    return min(found.area / 2, pi * found.ball.radius**2) * scale**2


def _is_soft(hint: Hint, matrix: Matrix, found: Shine, boxes: Bounds) -> bool:
    section = _cross_section(found, _largest_scale(matrix))
    return least_half_angle(np.array(hint.middle(matrix)), section, *boxes) > SOFT_HALF_ANGLE


def _largest_scale(matrix: Matrix) -> float:
    """As the driver has it (`DrivenMatrix.largest_scale`)."""
    return sqrt(max(matrix.col[axis].to_3d().length_squared for axis in range(3)))
