"""How noisy a light's glints are without a hint, where they are met by chance, over all frames: the lights' rank.

Nothing here depends on the current frame. Noise that is not known is infinite.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from math import asin, hypot, inf, pi

import bpy
import numpy as np

from ..animation.curves import peak_value
from ..animation.motion import has_fixed_box, has_rigid_box, is_fixed
from ..animation.places import is_still, places
from ..lights.hint import Hint
from ..lights.irradiance import irradiance
from ..lights.kind import lamp_at
from ..lights.kinds import may_change_power
from ..lights.receivers import CopiedPlaces
from ..nodes.glint_lights import KIND_SUN

NEVER = -1.0  # the value of a light that never shines on the material
# Objects whose shape may change are taken to be this much larger than their mesh at rest.
SHAPE_MARGIN = 1.5


@dataclass(frozen=True)
class Boxes:
    """Low and high corners, (n, f, 3) each, of the boxes of n objects at f frames in world space [m].

    are_fixed: whether the boxes hold all that is rendered of the objects at every frame, not only at these.
    """

    low: np.ndarray
    high: np.ndarray
    are_fixed: bool


def noise_in_remainder(hint: Hint, boxes: Boxes, frames: np.ndarray, alpha: float) -> float:
    """Standard deviation, up to a factor common to all hints, of the light's glints where they are met by chance.

    boxes: of the objects it lights, at the f `frames`; alpha: of a facet. Infinite where the light's place or power
    at other frames is not known, because in doubt a light is looked for; negative if it never shines on the boxes.
    """
    if not len(boxes.low):
        return NEVER
    if hint.kind == KIND_SUN and hint.direction is not None:
        return _noise(hint.power, hint.size, alpha)
    lamp, matrices = hint.source, _places_of(hint, frames)
    if lamp is None or matrices is None or _may_be_brighter(lamp.data):
        return inf
    if lamp.type != "LIGHT" or hint.instance and hint.instance.poses:
        # Its power is known for the present frame alone.
        are_still = is_still(matrices) and all(is_still(side.swapaxes(0, 1)) for side in (boxes.low, boxes.high))
        return _noise(hint.power, 0.0, alpha) if are_still else inf
    energy = peak_value(lamp.data, "energy")
    if is_still(matrices):
        pairs = [(matrices[0], boxes.low.reshape(-1, 3), boxes.high.reshape(-1, 3))]
    else:
        pairs = [(matrix, boxes.low[:, frame], boxes.high[:, frame]) for frame, matrix in enumerate(matrices)]
    value = max(_noise_at(hint, matrix, low, high, energy, alpha) for matrix, low, high in pairs)
    return NEVER if value == 0.0 and boxes.are_fixed and not hint.instance and is_fixed(lamp) else value


def boxes_over(objects: Collection[bpy.types.Object], frames: np.ndarray, copied: CopiedPlaces | None = None) -> Boxes:
    """Boxes of objects at the `frames`; those whose place is not known are a point in the middle of the others.

    copied: `receivers.copied_places` of those that have copies, which are taken to stay where they are.
    """
    copied = {thing: copied[thing] for thing in objects if thing in copied} if copied else {}
    known = {thing: places(thing, frames) for thing in objects if thing not in copied}
    placed = [(thing, matrices) for thing, matrices in known.items() if matrices is not None]
    placed += [(thing, np.tile(each, (len(frames), 1, 1))) for thing in copied for each in copied[thing]]
    boxes = [_box_over(thing, matrices) for thing, matrices in placed]
    low, high = (np.array([box[side] for box in boxes]).reshape(-1, len(frames), 3) for side in (0, 1))
    if any(matrices is None for matrices in known.values()):
        middle = (low.min(axis=0) + high.max(axis=0)) / 2 if boxes else np.zeros((len(frames), 3))
        low, high = np.append(low, middle[None], axis=0), np.append(high, middle[None], axis=0)
    return Boxes(low, high, not copied and all(has_fixed_box(thing) for thing in objects))


def _places_of(hint: Hint, frames: np.ndarray) -> np.ndarray | None:
    """World matrices (f, 4, 4) of a light at the frames, None if they are not known. A copy that no driver
    follows and that never moves has the unit matrix at all frames, because only its motion is asked for."""
    if not hint.instance:
        return places(hint.object, frames)
    instancer = hint.instance.instancer
    if hint.instance.poses or instancer is None:
        is_known = len(hint.instance.poses) == 1
        return np.tile(np.eye(4), (len(frames), 1, 1)) if is_known else None
    outer, inner = places(instancer, frames), places(hint.instance.source, frames)
    if outer is None or inner is None:
        return None
    inner = inner.copy()
    inner[:, :3, 3] -= np.array(instancer.instance_collection.instance_offset)
    return outer @ inner


def _noise_at(hint: Hint, matrix: np.ndarray, low: np.ndarray, high: np.ndarray, energy: float, alpha: float) -> float:
    """`noise_in_remainder` of boxes (n, 3) under the light at one place, `matrix` (4, 4)."""
    power = irradiance(lamp_at(hint.source, matrix), low, high, energy)
    half_angle = hint.size
    if hint.kind != KIND_SUN and len(low):
        distance = np.linalg.norm(np.clip(matrix[:3, 3], low, high) - matrix[:3, 3], axis=1).min()
        half_angle = asin(hint.size / distance) if hint.size < distance else pi / 2
    return _noise(power, half_angle, alpha)


def _noise(power: float, half_angle: float, alpha: float) -> float:
    """Standard deviation of the glints of a light of irradiance `power`, met by random facets.

    The chance that a facet mirrors the light grows with the solid angle of lobe and light, and its brightness falls
    with it: the deviation goes as the inverse of the solid angle's root. Normals differ by half as much as directions
    to lights do.
    """
    return power / max(hypot(alpha, half_angle / 2), float(np.finfo(np.float32).tiny))


def _may_be_brighter(light: bpy.types.ID) -> bool:
    """Whether a light may become brighter by more than keys of its energy: by drivers, other keys, or its nodes."""
    tree = getattr(light, "node_tree", None)  # meshes have none
    if tree is not None and tree.animation_data is not None:
        return True
    animation = light.animation_data
    if animation is None:
        return False
    return bool(animation.drivers or animation.nla_tracks) or may_change_power(light)


def _box_over(thing: bpy.types.Object, matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corners (f, 3) of an object's box at its places (f, 4, 4)."""
    corners = np.array(thing.bound_box)
    if thing.type == "MESH" and not has_rigid_box(thing) and len(thing.data.vertices):
        points = np.empty(3 * len(thing.data.vertices), np.float32)
        thing.data.vertices.foreach_get("co", points)
        low, high = points.reshape(-1, 3).min(axis=0), points.reshape(-1, 3).max(axis=0)
        middle, half = (low + high) / 2, SHAPE_MARGIN * (high - low) / 2
        corners = np.where(np.indices((2, 2, 2)).reshape(3, 8).T, middle + half, middle - half)
    world = corners @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]
    return world.min(axis=1), world.max(axis=1)
