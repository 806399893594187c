"""Where an object is at other frames, read from its keys alone: no frame is set, so nothing in the scene changes."""

from __future__ import annotations

from collections.abc import Collection

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot
from mathutils import Euler, Matrix, Quaternion, Vector

from .motion import is_fixed, keeps_its_place

TRANSFORMS = {"location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale"}


def poses(thing: bpy.types.Object, frames: Collection[float]) -> np.ndarray | None:
    """World matrices (n, 4, 4) of an object at each of the n `frames`, or None if keys alone do not say.

    Drivers, constraints, physics, strips and parts of a mixed action do not; parents may be animated in the same way.
    The shape is not looked at. Matrices must be current.
    """
    if is_fixed(thing, shape=False):
        return np.tile(np.array(thing.matrix_world), (len(frames), 1, 1))
    curves = _curves(thing)
    if curves is None or not keeps_its_place(thing) or _has_deltas(thing):
        return None
    own = np.array([np.array(_basis(thing, curves, frame)) for frame in frames])
    if thing.parent is None:
        return own
    parents = poses(thing.parent, frames) if thing.parent_type == "OBJECT" else None
    return None if parents is None else parents @ np.array(thing.matrix_parent_inverse) @ own


def _curves(thing: bpy.types.Object) -> dict[tuple[str, int], bpy.types.FCurve] | None:
    """Animation curves {(path, index): curve} of an object's place, or None if it is moved by more than an action."""
    animation = thing.animation_data
    if animation is None:
        return {}
    is_mixed = animation.action_influence != 1.0 or animation.action_blend_type != "REPLACE"
    if is_mixed or animation.drivers or animation.nla_tracks:
        return None
    if animation.action is None or animation.action_slot is None:
        return {}
    bag = action_get_channelbag_for_slot(animation.action, animation.action_slot)
    curves = {(curve.data_path, curve.array_index): curve for curve in (bag.fcurves if bag else ()) if not curve.mute}
    return curves if all(path in TRANSFORMS for path, _ in curves) else None


def _has_deltas(thing: bpy.types.Object) -> bool:
    moved = (*thing.delta_location, *thing.delta_rotation_euler, *(scale - 1.0 for scale in thing.delta_scale))
    return any(moved) or tuple(thing.delta_rotation_quaternion) != (1.0, 0.0, 0.0, 0.0)


def _basis(thing: bpy.types.Object, curves: dict[tuple[str, int], bpy.types.FCurve], frame: float) -> Matrix:
    """The object's own transform at a frame."""

    def value(path: str) -> list[float]:
        return [
            curves[path, index].evaluate(frame) if (path, index) in curves else present
            for index, present in enumerate(getattr(thing, path))
        ]

    if thing.rotation_mode == "QUATERNION":
        rotation = Quaternion(value("rotation_quaternion")).normalized()
    elif thing.rotation_mode == "AXIS_ANGLE":
        angle, *axis = value("rotation_axis_angle")
        rotation = Quaternion(axis, angle)
    else:
        rotation = Euler(value("rotation_euler"), thing.rotation_mode)
    return Matrix.LocRotScale(Vector(value("location")), rotation, Vector(value("scale")))
