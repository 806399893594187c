"""What sees the glints of a scene: its cameras at all frames of an animation, and whether mirrors see them too."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np

from ..animation.curves import is_animated
from ..animation.frames import chosen_frames
from ..animation.motion import copies_others
from .cameras import CameraView, all_camera_views
from .mirrors import has_mirrors
from .surface import PatchesOver


@dataclass(frozen=True)
class SceneViews:
    """What the cameras of a scene see over an animation. cameras: a row for each, with what it sees at each of the
    `frames`; has_mirrors: whether facets may be seen from elsewhere as well; surfaces: what `choice.patches` found of
    objects at these frames, kept for the next material."""

    frames: np.ndarray
    cameras: list[list[CameraView]]
    has_mirrors: bool
    surfaces: dict[bpy.types.Object, PatchesOver | None] = field(default_factory=dict)


def scene_views(scene: bpy.types.Scene) -> SceneViews | None:
    """What the cameras of a scene see, None if that is not known, if there are copies of objects, or if diffuse
    surfaces show glints: they see all that is around them."""
    frames = chosen_frames(scene)
    cameras = all_camera_views(scene, frames)
    if not cameras or _shows_caustics(scene) or any(copies_others(thing) for thing in scene.objects):
        return None
    return SceneViews(frames, cameras, has_mirrors(scene, sharp=True))


def _shows_caustics(scene: bpy.types.Scene) -> bool:
    """Whether glints are enumerated after diffuse bounces, at any time: see CAUSTICS of nodes.glint_bsdf."""
    cycles = scene.cycles
    if min(cycles.max_bounces, cycles.diffuse_bounces) == 0:
        return False
    has_caustics = cycles.caustics_reflective or is_animated(scene, "cycles.caustics_reflective")
    return has_caustics and (cycles.blur_glossy <= 0.0 or is_animated(scene, "cycles.blur_glossy"))
