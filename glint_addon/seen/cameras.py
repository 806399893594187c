"""What Blender's cameras see at a frame: the one place that reads frustum, pixel and lens of a camera object."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..animation.curves import is_animated
from ..animation.motion import keeps_its_shape
from ..animation.poses import poses

# The frustum is judged as a square this much wider than its longer side: for the pixel filter, which looks a few pixels
# beyond the edge, and for a resolution that changes after the scene was prepared.
MARGIN = 1.25


@dataclass(frozen=True)
class CameraView:
    """What one camera sees at one frame.

    Frustum: inverse: (4, 4), world to camera, which looks along -Z; low, high: (2,) its bounds in X and Y with the
    margin, for a perspective camera at depth 1; near, far: depths between which the camera sees [m]. Pixel: width of
    one [m], for a perspective camera at depth 1; least_cosine: of a ray to the axis, 1 if orthographic. Lens: aperture:
    its radius [m], 0 for a pinhole; focus: depth that is sharp [m], None where another object says it.
    """

    inverse: np.ndarray
    low: np.ndarray
    high: np.ndarray
    near: float
    far: float
    is_perspective: bool
    pixel: float
    least_cosine: float
    aperture: float
    focus: float | None

    def planes(self) -> np.ndarray:
        """Planes (4, 4) around the frustum in camera space: n . p + d >= 0 inside."""
        sides = np.zeros((4, 4))
        sides[(0, 2), 0] = sides[(1, 3), 1] = 1.0, -1.0
        bound = np.concatenate([-self.low, self.high])
        sides[:, 2 if self.is_perspective else 3] = -bound if self.is_perspective else bound
        return sides


def camera_objects(scene: bpy.types.Scene) -> set[bpy.types.Object]:
    """The camera objects that `scene` has or may be rendered with."""
    cameras = {thing for thing in scene.objects if thing.type == "CAMERA"}
    cameras |= {marker.camera for marker in scene.timeline_markers if marker.camera}
    return cameras | {scene.camera} - {None}


def camera_views(
    camera: bpy.types.Object, scene: bpy.types.Scene, frames: Collection[float]
) -> list[CameraView] | None:
    """What object `camera` sees at each of the `frames`, None if it may see anything: all around, by a lens that
    changes, or from a place that more than keys decides. Matrices must be current."""
    data = camera.data
    # Blender renders from any object, but only a camera has a lens.
    if camera.type != "CAMERA" or data.type not in {"PERSP", "ORTHO"} or not keeps_its_shape(camera):
        return None
    matrices = poses(camera, frames)
    if matrices is None:
        return None
    is_perspective = data.type == "PERSP"
    low, high = _picture_bounds(data, scene)
    half = MARGIN * (high - low).max() / 2
    farthest = np.maximum(np.abs(low), np.abs(high))
    aperture, focus = _aperture_and_focus(data)
    kept: dict[str, Any] = {
        "low": (low + high) / 2 - half,
        "high": (low + high) / 2 + half,
        "near": data.clip_start,
        "far": data.clip_end,
        "is_perspective": is_perspective,
        "pixel": float(((high - low) / _resolution(scene)).mean()),
        "least_cosine": 1.0 / np.sqrt(1.0 + farthest @ farthest) if is_perspective else 1.0,
        "aperture": aperture,
        "focus": focus,
    }
    return [CameraView(np.array(Matrix(matrix).normalized().inverted_safe()), **kept) for matrix in matrices]


def all_camera_views(scene: bpy.types.Scene, frames: Collection[float]) -> list[list[CameraView]]:
    """What each camera sees at each of the `frames`; none if there are no cameras, or if one may see anything."""
    unsure = scene.render.use_multiview or not hasattr(scene, "cycles") or is_animated(scene, "cycles.samples")
    views = [] if unsure else [camera_views(camera, scene, frames) for camera in camera_objects(scene)]
    known = [each for each in views if each is not None]
    return known if len(known) == len(views) else []


def _picture_bounds(data: bpy.types.Camera, scene: bpy.types.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corner (2,) of the picture in camera space, for a perspective camera at depth 1."""
    corners = np.array([corner[:] for corner in data.view_frame(scene=scene)])
    if data.type == "PERSP":
        corners = corners[:, :2] / -corners[:, 2:]
    return corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)


def _resolution(scene: bpy.types.Scene) -> np.ndarray:
    """Pixels of the picture, width and height."""
    render = scene.render
    return render.resolution_percentage / 100 * np.array([render.resolution_x, render.resolution_y])


def _aperture_and_focus(data: bpy.types.Camera) -> tuple[float, float | None]:
    if not data.dof.use_dof:
        return 0.0, 1.0
    # As Cycles: half the focal length over the f-number, in metres; bokeh may stretch it.
    length = data.lens * 1e-3 if data.type == "PERSP" else 1.0
    aperture = length / (2 * data.dof.aperture_fstop) * max(1.0, 1.0 / data.dof.aperture_ratio)
    return aperture, max(data.dof.focus_distance, 1e-6) if data.dof.focus_object is None else None
