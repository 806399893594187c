"""How lights move while the shutter is open, relative to their places at the frame, where drivers put the hints.

Cycles blurs emissive meshes, but renders lamps unblurred at their place in the middle of the shutter. This differs from
the place at the frame only if the scene's shutter starts or ends at the frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ..animation.places import places
from ..nodes.driven import Keyed
from ..nodes.glint_lights import KIND_SUN
from .hint import Hint, Numbers, Pose

# Middle of the shutter after the frame, in shutters.
MIDDLES = {"CENTER": 0.0, "START": 0.5, "END": -0.5}
# Least way [m, or of a unit vector]: shorter ways are rounding of matrices.
LEAST_WAY = 1e-5


@dataclass(frozen=True)
class Way:
    """Offsets of a hint's place, X, Y, Z in its unit: `shift` in the middle of the shutter, `shift + reach` when it
    closes, `shift - reach` when it opens."""

    shift: Numbers
    reach: Numbers


def shutter_ways(scene: bpy.types.Scene, layers: list[bpy.types.ViewLayer], hints: Iterable[Hint]) -> dict[Hint, Way]:
    """The ways of those of `hints` that move while the shutter is open, over the frames of `scene`.

    None without motion blur. Matrices must be current. If a light or one of its parents is moved by more than keys,
    every frame is set, and then the present frame again. `layers` are the view layers that count.
    """
    if not scene.render.use_motion_blur:
        return {}
    frames = np.arange(scene.frame_start, scene.frame_end + 1)
    opens, middle, closes = (MIDDLES[scene.render.motion_blur_position] + side for side in (-0.5, 0.0, 0.5))
    # Look at the frame and at three times in the shutter: a hint that stays at the frame misses its light: decision 48.
    shutter = scene.render.motion_blur_shutter
    offsets = {hint: shutter * np.array([0.0, *((opens, middle, closes) if is_blurred(hint) else (middle,) * 3)])
               for hint in hints if hint.direction is None}
    moving = {hint: offset for hint, offset in offsets.items() if offset.any()}
    found = _hint_places(scene, layers, frames, moving)
    ways = {hint: _way(frames, points) for hint, points in found.items()}
    return {hint: way for hint, way in ways.items() if way is not None}


def is_blurred(hint: Hint) -> bool:
    """Whether Cycles blurs a light that moves: a mesh, unless its motion blur is off."""
    source = hint.source
    return source is not None and source.type != "LIGHT" and source.cycles.use_motion_blur


def _way(frames: np.ndarray, points: np.ndarray) -> Way | None:
    """The way of a light at `points` (f, 4, 3): at each of the f frames, and as the shutter opens, is half open and
    closes then."""
    at_frame, first, half_way, last = points.swapaxes(0, 1)
    # Find the straight way at a steady speed that differs least from the two straight pieces of Cycles.
    shift, reach = (first + 2 * half_way + last) / 4 - at_frame, (last - first) / 2
    if max(np.abs(shift).max(), np.abs(reach).max()) < LEAST_WAY:
        return None
    return Way(*(tuple(_over(frames, side[:, axis]) for axis in range(3)) for side in (shift, reach)))


def _over(frames: np.ndarray, numbers: np.ndarray) -> Keyed | float:
    """Keys at the frames, or one number where all are the same."""
    rounded = np.where(np.ptp(numbers) < LEAST_WAY, numbers[0], numbers)
    rounded = np.where(np.abs(rounded) < LEAST_WAY, 0.0, rounded)
    if (rounded == rounded[0]).all():
        return float(rounded[0])
    return Keyed(tuple(map(int, frames)), tuple(map(float, rounded)))


def _hint_places(
    scene: bpy.types.Scene, layers: list[bpy.types.ViewLayer], frames: np.ndarray, offsets: dict[Hint, np.ndarray]
) -> dict[Hint, np.ndarray]:
    """Where each hint is, (f, k, 3), at the k `offsets` {hint: (k,)} of the f frames."""
    times = {hint: frames[:, None] + offset for hint, offset in offsets.items()}
    found: dict[Hint, np.ndarray] = {}
    unknown: dict[Hint, np.ndarray] = {}
    for hint, at in times.items():
        if hint.instance and hint.instance.poses:
            found[hint] = _of_poses(hint.instance.poses, at)
            continue
        things = _things(hint)
        known = [each for each in (places(thing, at.ravel()) for thing in things) if each is not None]
        if len(known) < len(things):
            unknown[hint] = at
        else:
            found[hint] = np.array([_place(hint, each) for each in zip(*known, strict=True)]).reshape(*at.shape, 3)
    return found | _at_set_frames(scene, layers, unknown)


def _things(hint: Hint) -> list[bpy.types.Object]:
    """The objects that place a hint: the empty that instances its collection, if one does, and what shines."""
    instancer = hint.instance.instancer if hint.instance else None
    return [thing for thing in (instancer, hint.source) if thing is not None]


def _place(hint: Hint, matrices: Sequence[Matrix | np.ndarray]) -> np.ndarray:
    """The place as drivers compute it (`lights.drivers`): from the world matrix of the hint's object, or from those of
    the empty that instances its collection and of the object in the collection."""
    matrix = np.array(matrices[0])
    instancer = hint.instance.instancer if hint.instance else None
    if instancer is not None:
        offset = np.eye(4)
        offset[:3, 3] = -np.array(instancer.instance_collection.instance_offset)
        matrix = matrix @ offset @ np.array(matrices[1])
    if hint.kind == KIND_SUN:
        return matrix[:3, 2] / max(np.linalg.norm(matrix[:3, 2]), np.finfo(float).tiny)
    return np.array(hint.middle(matrix))


def _of_poses(poses: tuple[Pose, ...], times: np.ndarray) -> np.ndarray:
    """Places of a copy between whole frames, on straight lines between the known places at whole frames, as of keys."""
    shown = [pose for pose in poses if pose.place is not None]
    frames, points = [pose.frame for pose in shown], np.array([pose.place for pose in shown])
    return np.stack([np.interp(times, frames, points[:, axis]) for axis in range(3)], axis=-1)


def _at_set_frames(
    scene: bpy.types.Scene, layers: list[bpy.types.ViewLayer], times: dict[Hint, np.ndarray]
) -> dict[Hint, np.ndarray]:
    """Places of hints at `times` {hint: (f, k)}, read after each of these times was set."""
    found = {hint: np.zeros((*at.shape, 3)) for hint, at in times.items()}
    present, subframe = scene.frame_current, scene.frame_subframe
    try:
        for time in sorted({time for at in times.values() for time in at.ravel().tolist()}):
            whole = int(time // 1)
            scene.frame_set(whole, subframe=time - whole)
            for layer in layers:
                layer.update()
            for hint, at in times.items():
                found[hint][at == time] = _place(hint, [thing.matrix_world for thing in _things(hint)])
    finally:
        if times:
            scene.frame_set(present, subframe=subframe)
            for layer in layers:
                layer.update()
    return found
