"""Which objects no camera of a scene can see, at any frame. In doubt an object is seen.

What only a mirror or a shadow shows is unseen here: it renders through Blender's own nodes, right and noisy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..animation.motion import copies_others, has_fixed_box, is_fixed

# The view is judged as a square this much wider than its longer side: for the pixel filter, which looks a few pixels
# beyond the edge, and for a resolution that changes after the scene was prepared.
MARGIN = 1.25


@dataclass(frozen=True)
class View:
    """What a camera sees. inverse: (4, 4), world to camera, which looks along -Z; low, high: (2,) bounds of x and y,
    for a perspective camera over the depth; aperture: radius of the lens [scene units], 0 for a pinhole."""

    inverse: np.ndarray
    low: np.ndarray
    high: np.ndarray
    is_perspective: bool
    aperture: float
    focus: float

    def meets(self, corners) -> bool:
        """Whether the view may meet the convex hull of `corners`, (n, 3) in world space; errs on the side of yes."""
        local = corners @ self.inverse[:3, :3].T + self.inverse[:3, 3]
        depth = -local[:, 2]
        # Out of focus the view is blurred by the lens, behind the focus by more than its own size.
        blur = self.aperture * max(1.0, float(depth.max()) / self.focus)
        if depth.max() < -blur:
            return False
        spread = depth[:, None] if self.is_perspective else np.ones((len(corners), 1))
        # A point is within the frustum where all four are negative; beyond one plane no part of the hull can be.
        beyond = np.hstack([local[:, :2] - self.high * spread, self.low * spread - local[:, :2]])
        slant = np.hstack([self.high, self.low]) if self.is_perspective else np.zeros(4)
        return bool((beyond.min(axis=0) <= blur * np.sqrt(1.0 + slant**2)).all())


def unseen_objects(scene, things) -> set:
    """Those of the objects `things` that no camera of `scene` can see. Matrices must be current.

    Nothing is unseen in a scene without a camera, with one that may move or look all around, or where objects or
    nodes place copies of others.
    """
    cameras = scene_cameras(scene)
    if not cameras or scene.render.use_multiview or any(copies_others(thing) for thing in scene.objects):
        return set()
    views = [_view(camera, scene) for camera in cameras]
    if None in views:
        return set()
    judged = [thing for thing in things if has_fixed_box(thing)]
    return {thing for thing in judged if not any(view.meets(_corners(thing)) for view in views)}


def scene_cameras(scene) -> set:
    """The cameras that `scene` has or may be rendered with."""
    cameras = {thing for thing in scene.objects if thing.type == "CAMERA"}
    cameras |= {marker.camera for marker in scene.timeline_markers if marker.camera}
    return cameras | {scene.camera} - {None}


def _view(camera, scene) -> View | None:
    """The view of a camera object, or None if it may be any."""
    data = camera.data
    # Blender renders from any object; only cameras say how.
    if camera.type != "CAMERA" or data.type not in {"PERSP", "ORTHO"} or not is_fixed(camera):
        return None
    is_perspective = data.type == "PERSP"
    frame = np.array([corner[:] for corner in data.view_frame(scene=scene)])
    if is_perspective:
        frame = frame[:, :2] / -frame[:, 2:]
    low, high = frame[:, :2].min(axis=0), frame[:, :2].max(axis=0)
    half = MARGIN * (high - low).max() / 2
    aperture, focus = 0.0, 1.0
    if data.dof.use_dof:
        if data.dof.focus_object is not None:
            return None
        # As Cycles: half the focal length over the f-number, in metres; bokeh may stretch it.
        length = data.lens * 1e-3 if is_perspective else 1.0
        aperture = length / (2 * data.dof.aperture_fstop) * max(1.0, 1.0 / data.dof.aperture_ratio)
        focus = max(data.dof.focus_distance, 1e-6)
    inverse = np.array(camera.matrix_world.normalized().inverted_safe())
    return View(inverse, (low + high) / 2 - half, (low + high) / 2 + half, is_perspective, aperture, focus)


def _corners(thing) -> np.ndarray:
    """Corners (8, 3) of the object's box in world space."""
    matrix = np.array(thing.matrix_world)
    return np.array(thing.bound_box) @ matrix[:3, :3].T + matrix[:3, 3]
