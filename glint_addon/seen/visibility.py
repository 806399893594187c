"""Which objects no camera of a scene can see, at any frame. In doubt an object is seen.

One frame stands for all: only cameras and objects that never move or change are judged, depth of field with them. The
frames of an animation are judged by `footprints` and `scene_views`, where a mistake costs noise; here it would cost an
object its preparation. What only a mirror or a shadow shows is unseen here: it renders through Blender's own nodes,
right and noisy.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from ..animation.motion import copies_others, has_fixed_box, is_fixed
from .cameras import CameraView, camera_objects, camera_views


def unseen_objects(scene: bpy.types.Scene, things: Iterable[bpy.types.Object]) -> set[bpy.types.Object]:
    """Those of the objects `things` that no camera of `scene` can see. Matrices must be current.

    Nothing is unseen in a scene without a camera, with one that may move or look all around, or where objects or
    nodes place copies of others.
    """
    cameras = camera_objects(scene)
    if not cameras or scene.render.use_multiview or any(copies_others(thing) for thing in scene.objects):
        return set()
    views = [_fixed_view(camera, scene) for camera in cameras]
    known = [view for view in views if view is not None]
    if len(known) < len(views):
        return set()
    judged = [thing for thing in things if has_fixed_box(thing)]
    return {thing for thing in judged if not any(_may_meet(view, _corners(thing)) for view in known)}


def _fixed_view(camera: bpy.types.Object, scene: bpy.types.Scene) -> CameraView | None:
    """What a camera sees that stays as it is at every frame, or None if it may be anything."""
    views = camera_views(camera, scene, [scene.frame_current]) if is_fixed(camera) else None
    return None if views is None else views[0]


def _may_meet(view: CameraView, corners: np.ndarray) -> bool:
    """Whether a camera may see the convex hull of `corners`, (n, 3) in world space; in doubt it may."""
    if view.focus is None:
        return True
    local = corners @ view.inverse[:3, :3].T + view.inverse[:3, 3]
    depth = -local[:, 2]
    # Out of focus the frustum is blurred by the lens, behind the focus by more than its own size.
    blur = view.aperture * max(1.0, float(depth.max()) / view.focus)
    if depth.max() < -blur:
        return False
    spread = depth[:, None] if view.is_perspective else np.ones((len(corners), 1))
    # A point is within the frustum where all four are negative; beyond one plane no part of the hull can be.
    beyond = np.hstack([local[:, :2] - view.high * spread, view.low * spread - local[:, :2]])
    slant = np.hstack([view.high, view.low]) if view.is_perspective else np.zeros(4)
    return bool((beyond.min(axis=0) <= blur * np.sqrt(1.0 + slant**2)).all())


def _corners(thing: bpy.types.Object) -> np.ndarray:
    """Corners (8, 3) of the object's box in world space."""
    matrix = np.array(thing.matrix_world)
    return np.array(thing.bound_box) @ matrix[:3, :3].T + matrix[:3, 3]
