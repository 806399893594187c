"""Half vectors between a light and a camera on patches of a surface: how far they are from its normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..lights.hint import Hint
from ..nodes.glint_lights import KIND_SUN
from ..seen.cameras import CameraView
from ..seen.surface import Patches

# Angle between light and view from which on every facet counts as one that mirrors the light to the camera: half
# vectors change ever faster across a patch as the two directions become opposite.
OPPOSITE = np.radians(170.0)


@dataclass(frozen=True)
class Meeting:
    """How patches (n,) meet a light: angle [rad] between half vectors and the nearest shading normal, blur [rad] that
    is half the light's angular radius, cosine of the light to the patch's normal on the camera's side."""

    angle: np.ndarray
    blur: np.ndarray
    light_cosine: np.ndarray


def meeting(hint: Hint, matrix: np.ndarray, view: CameraView, patches: Patches) -> Meeting:
    """How the patches meet a light whose world matrix is `matrix`, in a camera's view (`seen.cameras.CameraView`)."""
    light, light_spread, half_angle = _directions(matrix, hint, patches)
    sight, sight_spread = _sights(view, patches)
    between = np.arccos(np.clip((light * sight).sum(axis=1), -1.0, 1.0)) + light_spread + sight_spread
    half_vector = light + sight
    half_vector /= np.maximum(np.linalg.norm(half_vector, axis=1, keepdims=True), 1e-12)

    # A surface that is seen from behind has the opposite normal. Between two lights the half vector changes by half of
    # the angle between them, and across the plane of incidence by 1 / (2 cos) of that angle.
    cosine = np.abs((half_vector * patches.normals).sum(axis=1))
    growth = 0.5 / np.cos(np.minimum(between, OPPOSITE) / 2)
    angle = np.arccos(np.clip(cosine, 0.0, 1.0)) - patches.spreads - growth * (light_spread + sight_spread)
    angle = np.where((between < OPPOSITE) & np.isfinite(angle), angle, 0.0)
    sides = np.sign((sight * patches.normals).sum(axis=1))[:, None] * patches.normals
    return Meeting(np.maximum(angle, 0.0), growth * half_angle, (light * sides).sum(axis=1))


def _directions(matrix: np.ndarray, hint: Hint, patches: Patches) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors to a light (n, 3), how far they differ on a patch (n,), angular radius of the light (n,) [rad]."""
    count = len(patches.centres)
    if hint.kind == KIND_SUN:
        return np.tile(matrix[:3, 2], (count, 1)), np.zeros(count), np.full(count, hint.size)
    offset = matrix[:3, 3] - patches.centres
    distance = np.linalg.norm(offset, axis=1)
    nearest = np.maximum(distance - patches.radii, 0.0)
    return offset / np.maximum(distance, 1e-12)[:, None], _cone(patches.radii, distance), _cone(hint.size, nearest)


def _sights(view: CameraView, patches: Patches) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors to a camera (n, 3), how far they differ on a patch (n,) and over the lens [rad]."""
    to_world = np.linalg.inv(view.inverse)
    if not view.is_perspective:
        return np.tile(to_world[:3, 2], (len(patches.centres), 1)), np.zeros(len(patches.centres))
    offset = to_world[:3, 3] - patches.centres
    distance = np.linalg.norm(offset, axis=1)
    return offset / np.maximum(distance, 1e-12)[:, None], _cone(patches.radii + view.aperture, distance)


def _cone(radius: np.ndarray | float, distance: np.ndarray) -> np.ndarray:
    """Half-angle [rad] under which a ball is seen from `distance` to its middle; pi from within it."""
    is_outside = distance > radius
    return np.where(is_outside, np.arcsin(np.where(is_outside, radius / np.maximum(distance, 1e-12), 0.0)), np.pi)
