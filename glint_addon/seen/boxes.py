"""Boxes of objects in a camera's frustum: between which depths they are seen, and whether the camera is within."""

from __future__ import annotations

from itertools import combinations, product

import bpy
import numpy as np

from .cameras import CameraView

ROUNDING = 1e-6  # of coordinates relative to the scene's size
FLATNESS = 1e-4  # thickness given to flat boxes, relative to their diagonal
PARALLEL = 1e-12  # least volume that three planes' unit normals span


def is_inside(view: CameraView, thing: bpy.types.Object, matrix: np.ndarray) -> bool:
    """Whether a camera is within the box of an object; matrix: (4, 4), object to world."""
    return bool((_box(thing, matrix, view)[1][:, 3] > 0.0).all())


def depth_range(
    view: CameraView, thing: bpy.types.Object, matrix: np.ndarray, seen_in_mirrors: bool
) -> tuple[float, float] | None:
    """Nearest and farthest depth [m] at which a camera sees the box of an object, or None if it does not see it.

    matrix: (4, 4), object to world.
    """
    corners, normals = _box(thing, matrix, view)
    if seen_in_mirrors:
        # The way over a mirror is never shorter than the straight one, which may lie outside the frustum.
        nearest = np.clip(0.0, corners.min(axis=0), corners.max(axis=0))
        return max(float(np.linalg.norm(nearest)) * view.least_cosine, view.near), np.inf

    # The nearest and farthest points are among the corners of what box and frustum have in common: where three of their
    # planes meet, on the right side of all others.
    planes = np.vstack([normals, view.planes()])
    triples = np.array(list(combinations(range(len(planes)), 3)))
    with np.errstate(invalid="ignore", over="ignore"):
        usable = np.abs(np.linalg.det(planes[triples][:, :, :3])) > PARALLEL
        chosen = planes[triples[usable]]
        points = np.linalg.solve(chosen[:, :, :3], -chosen[:, :, 3:])[..., 0]
    reach = ROUNDING * (1.0 + np.abs(corners).max())
    inside = (points @ planes[:, :3].T + planes[:, 3] >= -reach).all(axis=1)
    depth = -points[inside, 2]
    if not inside.any() or depth.max() < view.near or depth.min() > view.far:
        return None
    return max(float(depth.min()), view.near), min(float(depth.max()), view.far)


def _box(thing: bpy.types.Object, to_world: np.ndarray, view: CameraView) -> tuple[np.ndarray, np.ndarray]:
    """Corners (8, 3) and planes (6, 4), inside positive, of an object's box in the camera's space."""
    corners = np.array(thing.bound_box)
    low, high = corners.min(axis=0), corners.max(axis=0)
    thickness = max(FLATNESS * float(np.linalg.norm(high - low)), 1e-9)
    low, high = low - thickness, high + thickness
    matrix = view.inverse @ to_world
    local = np.array(list(product(*np.stack([low, high], axis=1))))
    to_local = np.linalg.inv(matrix)
    planes = np.vstack([to_local[:3], -to_local[:3]])
    planes[:, 3] += np.concatenate([-low, high])
    planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    return local @ matrix[:3, :3].T + matrix[:3, 3], planes
