"""How lights move while the shutter is open, relative to their places at the frame, where drivers put the hints.

Cycles blurs emissive meshes, but renders lamps unblurred at their place in the middle of the shutter. This differs from
the place at the frame only if the scene's shutter starts or ends at the frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..animation.places import places
from ..nodes.driven import Keyed
from ..nodes.glint_lights import KIND_SUN
from .hint import Hint

# Middle of the shutter after the frame, in shutters.
MIDDLES = {"CENTER": 0.0, "START": 0.5, "END": -0.5}
# Least way [m, or of a unit vector]: shorter ways are rounding of matrices.
LEAST_WAY = 1e-5

Numbers = tuple[Keyed | float, ...]


@dataclass(frozen=True)
class Way:
    """Offsets of a hint's place, X, Y, Z in its unit: `shift` in the middle of the shutter, `shift + reach` when it
    closes, `shift - reach` when it opens."""

    shift: Numbers
    reach: Numbers


def shutter_ways(scene, layers, hints) -> dict[Hint, Way]:
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


def is_blurred(hint) -> bool:
    """Whether Cycles blurs a light that moves: a mesh, unless its motion blur is off."""
    source = hint.source
    return source is not None and source.type != "LIGHT" and source.cycles.use_motion_blur


def _way(frames, points) -> Way | None:
    """The way of a light at `points` (f, 4, 3): at each of the f frames, and as the shutter opens, is half open and
    closes then."""
    at_frame, first, half_way, last = points.swapaxes(0, 1)
    # Find the straight way at a steady speed that differs least from the two straight pieces of Cycles.
    shift, reach = (first + 2 * half_way + last) / 4 - at_frame, (last - first) / 2
    if max(np.abs(shift).max(), np.abs(reach).max()) < LEAST_WAY:
        return None
    return Way(*(tuple(_over(frames, side[:, axis]) for axis in range(3)) for side in (shift, reach)))


def _over(frames, numbers) -> Keyed | float:
    """Keys at the frames, or one number where all are the same."""
    rounded = np.where(np.ptp(numbers) < LEAST_WAY, numbers[0], numbers)
    rounded = np.where(np.abs(rounded) < LEAST_WAY, 0.0, rounded)
    if (rounded == rounded[0]).all():
        return float(rounded[0])
    return Keyed(tuple(map(int, frames)), tuple(map(float, rounded)))


def _hint_places(scene, layers, frames, offsets) -> dict[Hint, np.ndarray]:
    """Where each hint is, (f, k, 3), at the k `offsets` {hint: (k,)} of the f frames."""
    times = {hint: frames[:, None] + offset for hint, offset in offsets.items()}
    found, unknown = {}, {}
    for hint, at in times.items():
        if hint.instance and hint.instance.poses:
            found[hint] = _of_poses(hint, at)
            continue
        things = [hint.instance.instancer, hint.instance.source] if hint.instance else [hint.object]
        matrices = [places(thing, at.ravel()) for thing in things]
        if any(matrix is None for matrix in matrices):
            unknown[hint] = at
        else:
            found[hint] = np.array([_place(hint, each) for each in zip(*matrices, strict=True)]).reshape(*at.shape, 3)
    return found | _at_set_frames(scene, layers, unknown)


def _place(hint, matrices) -> np.ndarray:
    """The place as drivers compute it (`lights.drivers`): from the world matrix of the hint's object, or from those of
    the empty that instances its collection and of the object in the collection."""
    matrix = np.array(matrices[0])
    if hint.instance:
        offset = np.eye(4)
        offset[:3, 3] = -np.array(hint.instance.instancer.instance_collection.instance_offset)
        matrix = matrix @ offset @ np.array(matrices[1])
    if hint.kind == KIND_SUN:
        return matrix[:3, 2] / max(np.linalg.norm(matrix[:3, 2]), np.finfo(float).tiny)
    return np.array(hint.middle(matrix))


def _of_poses(hint, times) -> np.ndarray:
    """Places of a copy between whole frames, on straight lines between the known places at whole frames, as of keys."""
    shown = [pose for pose in hint.instance.poses if pose.place is not None]
    frames, points = [pose.frame for pose in shown], np.array([pose.place for pose in shown])
    return np.stack([np.interp(times, frames, points[:, axis]) for axis in range(3)], axis=-1)


def _at_set_frames(scene, layers, times) -> dict[Hint, np.ndarray]:
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
                things = [hint.instance.instancer, hint.instance.source] if hint.instance else [hint.object]
                found[hint][at == time] = _place(hint, [thing.matrix_world for thing in things])
    finally:
        if times:
            scene.frame_set(present, subframe=subframe)
            for layer in layers:
                layer.update()
    return found
