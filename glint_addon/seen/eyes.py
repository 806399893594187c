"""The cameras of a scene as far as they decide the footprints: how wide a pixel is, and how near and far they see."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from mathutils import Matrix

from ..animation.curves import is_animated
from ..animation.motion import keeps_its_shape
from ..animation.poses import poses
from .visibility import MARGIN, scene_cameras

ROUNDING = 1e-6  # of coordinates relative to the scene's size
FLATNESS = 1e-4  # thickness given to flat boxes, relative to their diagonal
PARALLEL = 1e-12  # least volume that three planes' unit normals span


@dataclass(frozen=True)
class Eye:
    """What decides a camera's footprints. inverse: (4, 4), world to camera, which looks along -Z; low, high: (2,) the
    frame a little widened, for a perspective camera at depth 1; pixel: width of a pixel there [m]; cosine: least
    cosine of a ray to the axis, 1 if orthographic; start, end: depths between which the camera sees [m]."""

    inverse: np.ndarray
    low: np.ndarray
    high: np.ndarray
    pixel: float
    cosine: float
    start: float
    end: float
    is_perspective: bool

    def planes(self) -> np.ndarray:
        """Planes (4, 4) around the view in camera space: n . p + d >= 0 inside."""
        sides = np.zeros((4, 4))
        sides[(0, 2), 0] = sides[(1, 3), 1] = 1.0, -1.0
        bound = np.concatenate([-self.low, self.high])
        sides[:, 2 if self.is_perspective else 3] = -bound if self.is_perspective else bound
        return sides


def scene_eyes(scene, frames) -> list[list[Eye]]:
    """The eyes of each camera at each of the `frames`; none if there are no cameras, or if one may see anything."""
    unsure = scene.render.use_multiview or not hasattr(scene, "cycles") or is_animated(scene, "cycles.samples")
    eyes = [] if unsure else [_eyes(camera, scene, frames) for camera in scene_cameras(scene)]
    return [] if None in eyes else eyes


def _eyes(camera, scene, frames) -> list[Eye] | None:
    data = camera.data
    if camera.type != "CAMERA":  # Blender renders from any object; only cameras say how
        return None
    matrices = poses(camera, frames)
    if data.type not in {"PERSP", "ORTHO"} or not keeps_its_shape(camera) or matrices is None:
        return None
    is_perspective = data.type == "PERSP"
    frame = np.array([corner[:] for corner in data.view_frame(scene=scene)])
    if is_perspective:
        frame = frame[:, :2] / -frame[:, 2:]
    low, high = frame[:, :2].min(axis=0), frame[:, :2].max(axis=0)
    share = scene.render.resolution_percentage / 100
    pixels = share * np.array([scene.render.resolution_x, scene.render.resolution_y])
    farthest = np.maximum(np.abs(low), np.abs(high))
    view = (
        (low + high) / 2 - MARGIN * (high - low).max() / 2,
        (low + high) / 2 + MARGIN * (high - low).max() / 2,
        float(((high - low) / pixels).mean()),
        1.0 / np.sqrt(1.0 + farthest @ farthest) if is_perspective else 1.0,
        data.clip_start,
        data.clip_end,
        is_perspective,
    )
    return [Eye(np.array(Matrix(matrix).normalized().inverted_safe()), *view) for matrix in matrices]


def is_inside(eye, thing, matrix) -> bool:
    """Whether an eye is within the box of an object; matrix: (4, 4), object to world."""
    return bool((_box(thing, matrix, eye)[1][:, 3] > 0.0).all())


def depth_range(eye, thing, matrix, seen_in_mirrors) -> tuple[float, float] | None:
    """Nearest and farthest depth [m] at which an eye sees the box of an object, or None if it does not see it.

    matrix: (4, 4), object to world.
    """
    corners, normals = _box(thing, matrix, eye)
    if seen_in_mirrors:
        # The way over a mirror is never shorter than the straight one, which may lie outside the view.
        nearest = np.clip(0.0, corners.min(axis=0), corners.max(axis=0))
        return max(float(np.linalg.norm(nearest)) * eye.cosine, eye.start), np.inf

    # The nearest and farthest points are among the corners of what box and view have in common: where three of their
    # planes meet, on the right side of all others.
    planes = np.vstack([normals, eye.planes()])
    triples = np.array(list(combinations(range(len(planes)), 3)))
    with np.errstate(invalid="ignore", over="ignore"):
        usable = np.abs(np.linalg.det(planes[triples][:, :, :3])) > PARALLEL
        chosen = planes[triples[usable]]
        points = np.linalg.solve(chosen[:, :, :3], -chosen[:, :, 3:])[..., 0]
    reach = ROUNDING * (1.0 + np.abs(corners).max())
    inside = (points @ planes[:, :3].T + planes[:, 3] >= -reach).all(axis=1)
    depth = -points[inside, 2]
    if not inside.any() or depth.max() < eye.start or depth.min() > eye.end:
        return None
    return max(float(depth.min()), eye.start), min(float(depth.max()), eye.end)


def _box(thing, to_world, eye) -> tuple[np.ndarray, np.ndarray]:
    """Corners (8, 3) and planes (6, 4), inside positive, of an object's box in the camera's space."""
    corners = np.array(thing.bound_box)
    low, high = corners.min(axis=0), corners.max(axis=0)
    thickness = max(FLATNESS * float(np.linalg.norm(high - low)), 1e-9)
    low, high = low - thickness, high + thickness
    matrix = eye.inverse @ to_world
    local = np.array(list(product(*np.stack([low, high], axis=1))))
    to_local = np.linalg.inv(matrix)
    planes = np.vstack([to_local[:3], -to_local[:3]])
    planes[:, 3] += np.concatenate([-low, high])
    planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    return local @ matrix[:3, :3].T + matrix[:3, 3], planes
