"""Which frames of an animation are looked at: what is judged there holds, with a margin, in between."""

from __future__ import annotations

import bpy
import numpy as np

FRAMES = 17  # of an animation that are looked at; lights are ranked, so what lies between changes little


def chosen_frames(scene: bpy.types.Scene) -> np.ndarray:
    """Frames at which lights are judged: of the scene's range, never the current one alone."""
    count = min(FRAMES, scene.frame_end - scene.frame_start + 1)
    return np.linspace(scene.frame_start, scene.frame_end, max(count, 1))


def scene_frames(scene: bpy.types.Scene, count: int) -> np.ndarray:
    """At most `count` frames of the scene's range, evenly spread, its ends and the current frame among them."""
    spread = np.linspace(scene.frame_start, scene.frame_end, min(count, scene.frame_end - scene.frame_start + 1))
    return np.unique(np.append(spread, scene.frame_current))
