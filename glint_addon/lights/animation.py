"""Whether and how far a property moves over time, read from actions and drivers."""

from __future__ import annotations

from bpy_extras.anim_utils import action_get_channelbag_for_slot


def is_animated(owner, path: str, index: int = 0) -> bool:
    """Whether property `path` of data-block `owner` has keys or a driver, or strips (NLA) that may hold keys.

    index: which of a vector's numbers.
    """
    animation = owner.animation_data
    if animation is None:
        return False
    return bool(_curve(owner, path, index) or animation.drivers.find(path, index=index) or animation.nla_tracks)


def peak_value(owner, path: str, index: int = 0) -> float:
    """Largest of the property's present value and its keys; index: which of a vector's numbers."""
    curve = _curve(owner, path, index)
    keys = [key.co.y for key in curve.keyframe_points] if curve else []
    value = owner.path_resolve(path)
    return max([value if isinstance(value, (int, float)) else value[index], *keys])


def _curve(owner, path, index):
    animation = owner.animation_data
    if animation is None or animation.action is None or animation.action_slot is None:
        return None
    bag = action_get_channelbag_for_slot(animation.action, animation.action_slot)
    return bag.fcurves.find(path, index=index) if bag else None
