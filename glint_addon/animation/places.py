"""Where objects are at other frames, objects too that are held still by what does not move."""

from __future__ import annotations

from collections.abc import Collection

import bpy
import numpy as np

from .motion import is_fixed
from .poses import poses

# Constraints that move nothing by themselves: what holds them still holds the object still.
STILL_CONSTRAINTS = {"TRACK_TO", "DAMPED_TRACK", "LOCKED_TRACK", "COPY_LOCATION", "COPY_ROTATION", "COPY_SCALE",
                     "COPY_TRANSFORMS", "LIMIT_LOCATION", "LIMIT_ROTATION", "LIMIT_SCALE", "LIMIT_DISTANCE", "CHILD_OF"}


def places(thing: bpy.types.Object, frames: Collection[float]) -> np.ndarray | None:
    """World matrices (f, 4, 4) of an object at the f `frames`, None if they cannot be told from keys alone."""
    if _is_settled(thing):
        return np.tile(np.array(thing.matrix_world), (len(frames), 1, 1))
    return poses(thing, frames)


def is_still(matrices: np.ndarray) -> bool:
    """Whether matrices or points, (f, ...), are the same at all frames."""
    return bool((matrices == matrices[0]).all())


def _is_settled(thing: bpy.types.Object) -> bool:
    """Whether an object stays in its place at every frame: constraints to what stays count as nothing."""
    if is_fixed(thing, shape=False):
        return True
    animation = thing.animation_data
    moves = animation is not None and bool(animation.action or animation.nla_tracks or animation.drivers)
    parents = [thing.parent] * (thing.parent is not None)
    targets = [target for each in thing.constraints if (target := getattr(each, "target", None)) is not None]
    return (
        not moves
        and thing.rigid_body is None
        and (thing.parent is None or thing.parent_type == "OBJECT")
        and all(each.type in STILL_CONSTRAINTS and not getattr(each, "subtarget", "") for each in thing.constraints)
        and all(is_fixed(each, shape=False) for each in parents + targets)
    )
