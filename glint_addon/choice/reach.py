"""Which lights a map's facets can mirror to a camera, at any frame, and how noisy their glints are where met by chance.

In doubt a light counts as mirrored. The test is the shader's (`map_reaches_hint` in osl/light_hint.h) for whole patches
of a surface and all of an animation: a light whose half vectors stay clear of every facet gets no hint.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from math import inf

import bpy
import numpy as np

from ..animation.curves import peak_value
from ..animation.motion import has_rigid_box
from ..animation.places import is_still, places
from ..lights.hint import Hint
from ..lights.irradiance import irradiances
from ..lights.kind import Local, lamp_at
from ..lights.kinds import kind_of, may_change_cone, may_change_size
from ..lights.softness import SOFT_HALF_ANGLE
from ..materials.find import HeldNode
from ..nodes.glint_bsdf import ROUGHNESS, STRENGTH
from ..nodes.glint_lights import KIND_SUN
from ..nodes.map_tables import MapTables
from ..seen.cameras import CameraView
from ..seen.scene_views import SceneViews
from ..seen.surface import Patches, PatchesOver, pixels_filled
from .half_vectors import Meeting, meeting
from .patches import patches_over

# Half-width of the selected region in alpha: REGION in osl/light_hint.h.
REGION = 2.5
# For what the bounds leave out: normals between corners, their change in a footprint, a camera moved a little.
MARGIN = np.radians(3.0)
DEVIATIONS = 3.0  # standard deviations of a map's slopes that its steepest facets are away from the flat
FLATTEST = 1e-4  # slope: a map without facets still has rounding
LEAST_ROUGHNESS = 1e-3  # of a facet: a mirror's glints have no finite noise
STEEPEST = np.radians(89.0)
# Largest part of a light's noise that may be on patches where the light looks smaller than SOFT_HALF_ANGLE, for the
# light to need no hint.
SMALL_NOISE = 0.1
LEAST_SCALING = 1e-3  # relative change of a light's size over an animation that makes its noise another


@dataclass(frozen=True)
class Facets:
    """What a material's facets are: largest slope of the map's facets, alpha of one facet."""

    slope: float
    alpha: float


def facets_of(nodes: tuple[HeldNode, ...]) -> Facets | None:
    """The facets of materials whose glints come from the group nodes `nodes`; None if they are not known."""
    known = [facets for facets in map(_facets, nodes) if facets is not None]
    if len(known) < len(nodes) or not known:
        return None
    return Facets(max(each.slope for each in known), max(each.alpha for each in known))


@dataclass(frozen=True)
class Judgement:
    """reached: whether some facet mirrors the light to a camera; noise: as `noise.noise_in_remainder`, of what
    a camera sees of the object, with the chance that the map has facets which mirror the light; is_soft: whether at
    every frame nearly all of this noise is on patches where the light looks larger than SOFT_HALF_ANGLE."""

    reached: bool
    noise: float
    is_soft: bool


def judgements(
    scene: bpy.types.Scene,
    views: SceneViews | None,
    objects: Collection[bpy.types.Object],
    facets: Facets | None,
    hints: Iterable[Hint],
) -> dict[Hint, Judgement] | None:
    """What `facets` on the objects show of each of the hints, the largest of all objects; None if that is not known.

    Matrices must be current.
    """
    if views is None or facets is None:
        return None
    surfaces = []
    for thing in objects:
        surface = patches_over(scene, thing, views)
        if surface is None:
            return None
        surfaces.append(surface)
    judged = {}
    for hint in hints:
        each = [_judgement(hint, views, surface, facets) for surface in surfaces]
        noise = max((one.noise for one in each), default=0.0)
        judged[hint] = Judgement(any(one.reached for one in each), noise, all(one.is_soft for one in each))
    return judged


def _facets(node: HeldNode) -> Facets | None:
    roughness, strength, tables = node.value(ROUGHNESS.name), node.value(STRENGTH.name), MapTables.of(node.group)
    low, high = tables.slope_low, tables.slope_high
    if roughness is None or strength is None or not tables.has_bounds or low is None or high is None:
        return None
    bounds = np.abs([low, high]).max(axis=0)
    if not bounds.any():
        return None  # the shader does not know them either
    slope = abs(strength) * float(np.linalg.norm(bounds))
    return Facets(max(slope, FLATTEST), max(min(roughness, 1.0), LEAST_ROUGHNESS) ** 2)


def _judgement(hint: Hint, views: SceneViews, moved: PatchesOver, facets: Facets) -> Judgement:
    """Judge a light on an object, whose patches at each frame are `moved`."""
    lamps = _lamps(hint, views.frames)
    if lamps is None:
        return Judgement(True, inf, False)
    reached, noise, is_soft = views.has_mirrors, 0.0, not views.has_mirrors
    nothing_moves = is_still(lamps) and all(patches is moved[0][0] for patches, _ in moved)
    # Leave out patches that are always behind the lamp or outside its cone: they show no glint of it: decision 44.
    lit = _may_be_lit(hint, lamps[0], moved[0][0]) if nothing_moves else slice(None)
    for camera in views.cameras:
        still = nothing_moves and all((view.inverse == camera[0].inverse).all() for view in camera)
        rows = zip(camera[:1] if still else camera, lamps, moved, strict=False)
        gaps = []
        for view, matrix, (patches, stretch) in rows:
            met = meeting(hint, matrix, view, patches)
            gap = met.angle - np.arctan(stretch * facets.slope) - REGION * facets.alpha - met.blur - MARGIN
            gaps.append(gap[lit])
            deviations = _noise(hint, matrix, view, patches, met, facets)
            is_soft = is_soft and _is_soft(hint, matrix, patches, deviations)
            noise = max(noise, float(np.linalg.norm(deviations)))
        # Between two frames a gap may be smaller than at both, by as much as it differs between them.
        change = max((np.abs(after - before).max() for before, after in zip(gaps, gaps[1:], strict=False)), default=0.0)
        reached = reached or bool(min(gap.min() for gap in gaps) <= change)
    return Judgement(reached, noise, is_soft)


def _lamps(hint: Hint, frames: np.ndarray) -> np.ndarray | None:
    """World matrices (f, 4, 4) of a light at each of the frames: for suns with the direction towards it as Z axis, for
    others with their middle as the place. None if that or how it shines is not known."""
    if hint.direction is not None and hint.live is None:
        matrix = np.eye(4)
        matrix[:3, 2] = hint.direction
        return np.tile(matrix, (len(frames), 1, 1))
    lamp = hint.object
    if lamp is None or lamp.data is None or lamp.type == "MESH" and not has_rigid_box(lamp):
        return None
    matrices = places(lamp, frames)
    if matrices is None or may_change_size(lamp.data):
        return None
    lengths = np.maximum(np.linalg.norm(matrices[:, :3, :3], axis=1), 1e-12)
    if (np.ptp(lengths, axis=0) > LEAST_SCALING * lengths[0]).any():
        return None
    matrices = matrices.copy()
    if hint.kind == KIND_SUN:
        matrices[:, :3, 2] /= lengths[:, 2:]
    else:
        matrices[:, :3, 3] = [hint.middle(matrix) for matrix in matrices]
    return matrices


def _noise(
    hint: Hint, matrix: np.ndarray, view: CameraView, patches: Patches, met: Meeting, facets: Facets
) -> np.ndarray:
    """Standard deviations (n,), up to a common factor, that glints which are met by chance on each patch add to that of
    the picture of an object."""
    # One facet sends E / (solid angle of lobe and light); the chance to meet it is the density of facets at the half
    # vector times that angle. The density has a wider tail than a normal distribution: real maps have.
    steepness = np.tan(np.minimum(met.angle, STEEPEST)) / (facets.slope / DEVIATIONS)
    density = 1.0 / (1.0 + steepness**2) ** 2
    lamp = _lamp_of(hint)
    power = hint.power if lamp is None else _patch_powers(lamp, matrix, patches)
    variance = density * (power / np.hypot(facets.alpha, met.blur)) ** 2 * (met.light_cosine > -np.sin(patches.spreads))

    pixels, is_in_picture = pixels_filled(view, patches)
    pixels = pixels * is_in_picture if (pixels * is_in_picture).any() else pixels
    return np.sqrt(variance * pixels / max(pixels.sum(), 1e-30))


def _is_soft(hint: Hint, matrix: np.ndarray, patches: Patches, deviations: np.ndarray) -> bool:
    """Whether nearly all of a light's noise is on patches where the light looks larger than SOFT_HALF_ANGLE."""
    lamp = _lamp_of(hint)
    kind = kind_of(lamp) if lamp is not None else None
    if lamp is None or not isinstance(kind, Local):
        return False  # suns are as large everywhere, and of meshes only the bounds are known here
    radius = np.sqrt(kind.cross_section(lamp_at(lamp, matrix)) / np.pi)
    is_far = np.linalg.norm(matrix[:3, 3] - patches.centres, axis=1) > radius / np.sin(SOFT_HALF_ANGLE)
    noise = float(np.linalg.norm(deviations))
    return noise > 0.0 and float(np.linalg.norm(deviations[is_far])) <= SMALL_NOISE * noise


def _lamp_of(hint: Hint) -> bpy.types.Object | None:
    """The light object that a hint follows; None for the world, meshes and copies."""
    return hint.object if hint.object is not None and hint.object.type == "LIGHT" else None


def _patch_powers(lamp: bpy.types.Object, matrix: np.ndarray, patches: Patches, part: float = 0.5) -> np.ndarray:
    """Irradiance [W/m^2] of a light object on each patch, (n,); part: of the balls' radii that the patches fill."""
    placed = lamp_at(lamp, matrix)
    half = part * patches.radii[:, None]
    return irradiances(placed, patches.centres - half, patches.centres + half, peak_value(lamp.data, "energy"))


def _may_be_lit(hint: Hint, matrix: np.ndarray, patches: Patches) -> np.ndarray:
    """Whether some of each patch (n,) lies where the light can shine; all True if it is dark now or its cone moves."""
    lamp = _lamp_of(hint)
    if lamp is not None and not may_change_cone(lamp.data):
        lit = _patch_powers(lamp, matrix, patches, 1.0) > 0.0
        if lit.any():
            return lit
    return np.ones(len(patches.centres), bool)
