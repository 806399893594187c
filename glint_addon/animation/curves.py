"""Whether and how far a property moves over time, read from actions and drivers."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
from bpy_extras.anim_utils import action_get_channelbag_for_slot


def is_animated(owner: bpy.types.ID, path: str, index: int = 0) -> bool:
    """Whether property `path` of data-block `owner` has keys or a driver, or strips (NLA) that may hold keys.

    index: which of a vector's numbers.
    """
    animation = owner.animation_data
    if animation is None:
        return False
    return bool(_curve(owner, path, index) or animation.drivers.find(path, index=index) or animation.nla_tracks)


def peak_value(owner: bpy.types.ID, path: str, index: int = 0) -> float:
    """Largest of the property's keys, its present value if it has none; index: which of a vector's numbers."""
    curve = _curve(owner, path, index)
    if curve and curve.keyframe_points:
        return max(key.co.y for key in curve.keyframe_points)
    value = owner.path_resolve(path)
    return value if isinstance(value, (int, float)) else value[index]


def values_over(scene: bpy.types.Scene, owner: bpy.types.ID, paths: list[str]) -> tuple[range, list[tuple[float, ...]]]:
    """The frames of `scene`, and the values of the properties `paths` of data-block `owner` at each of them.

    Where more than keys moves one, every frame is set, and the present one again.
    """
    frames = range(scene.frame_start, scene.frame_end + 1)
    curves = [_curve(owner, path, 0) for path in paths]
    present = [owner.path_resolve(path) for path in paths]
    animation = owner.animation_data
    is_plain = animation.action_influence == 1.0 and animation.action_blend_type == "REPLACE"
    if is_plain and not animation.nla_tracks and not any(animation.drivers.find(path) for path in paths):
        pairs = list(zip(curves, present, strict=True))
        return frames, [tuple(curve.evaluate(frame) if curve else now for curve, now in pairs) for frame in frames]
    return frames, _values_at_set_frames(scene, owner, paths, frames)


def _values_at_set_frames(
    scene: bpy.types.Scene, owner: bpy.types.ID, paths: list[str], frames: Iterable[int]
) -> list[tuple[float, ...]]:
    frame, subframe, values = scene.frame_current, scene.frame_subframe, []
    try:
        for number in frames:
            scene.frame_set(number)
            values.append(tuple(owner.path_resolve(path) for path in paths))
    finally:
        scene.frame_set(frame, subframe=subframe)
    return values


def _curve(owner: bpy.types.ID, path: str, index: int) -> bpy.types.FCurve | None:
    animation = owner.animation_data
    if animation is None or animation.action is None or animation.action_slot is None:
        return None
    bag = action_get_channelbag_for_slot(animation.action, animation.action_slot)
    return bag.fcurves.find(path, index=index) if bag else None
