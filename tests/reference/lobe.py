"""Numpy twin of osl/lobe.h, composed of the other twins, without counts, index and pixel grid.

Hints are one HalfVector for each of the lights; where a hint is not used, its radius is -1, so that it selects nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from . import footprint as footprints
from . import light_hint, query, table
from .light_hint import REGION

LARGEST_FOOTPRINT_TURN = 1.0
SPARE_TURN = 0.25
FAR_TURN = 2.0
LARGEST_VISIT = 4096


@dataclass
class Surface:
    """What OSL knows of each shading point: (n, 3), and the view's turn (n,) in radians per metre."""

    dpdx: np.ndarray
    dpdy: np.ndarray
    position: np.ndarray
    view: np.ndarray
    normal: np.ndarray
    view_turn: np.ndarray


def round_footprint(surface, texels, samples, diffuse_distance):
    """Validity (n,) and the footprint of each sample; texels: (n, 2, 2) texel coordinates by dpdx and dpdy."""
    radius = footprints.footprint_radius(samples)
    after_bounce = diffuse_distance > 0
    towards = np.where(after_bounce[:, None], surface.normal, surface.view)
    cone = footprints.cone_on_surface(surface.dpdx, surface.dpdy, towards, surface.normal, radius)
    valid, footprint = footprints.surface_footprint(cone, texels)
    metres = radius * np.linalg.norm(surface.dpdx, axis=1)
    scale = footprints.caustic_scale(footprint.area, metres, diffuse_distance)
    return valid, footprints.scale_footprint(np.where(after_bounce, scale, 1.0), footprint)


def footprint_scale(hints, area, samples, largest_turn=LARGEST_FOOTPRINT_TURN):
    """By how much (n,) to make footprints smaller for the hints that are used, which may turn by `largest_turn`."""
    scale, spare = np.ones(len(area)), np.ones(len(area))
    for hint in hints:
        used = hint.radius > 0
        turn = np.maximum(hint.turn, 1e-30)
        widest = np.where(samples > 1.0, SPARE_TURN, 0.999 * FAR_TURN) * hint.radius
        scale = np.where(used, np.minimum(scale, largest_turn / turn), scale)
        spare = np.where(used, np.minimum(spare, widest / turn), spare)
    return np.where(area > LARGEST_VISIT, np.minimum(scale, np.maximum(spare, np.sqrt(LARGEST_VISIT / area))), scale)


def add_hints(lights, shapes, alpha, frame, surface, footprint):
    """The hints of lights (n, lights, 3)."""
    hints = []
    for light, shape in zip(np.moveaxis(lights, 1, 0), np.moveaxis(shapes, 1, 0), strict=True):
        valid, hint = light_hint.half_vector(light, shape, REGION * alpha, frame, footprint, surface.view_turn,
                                             surface.position, surface.view, surface.normal)
        hints.append(replace(hint, radius=np.where(valid, hint.radius, -1.0)))
    return hints


def keep_reached(hints, footprint, low, high, strength):
    """The hints that some normal of a map with slopes between low and high (2,) can reach within the footprint: all,
    where high is above low nowhere. And the distance (n,) of the closest of these answers from its limit."""
    kept, margin = [], np.full(len(footprint.ux), np.inf)
    for hint in hints:
        hint = light_hint.turn_over(footprint, hint)
        if (high > low).any():
            bounds = table.strengthened_bounds(low, high, strength)
            box = (np.broadcast_to(bound, (len(margin), 2)) for bound in bounds)
            reached, distance = light_hint.map_reaches_hint(hint, *box)
            margin = np.where(hint.radius > 0, np.minimum(margin, np.abs(distance)), margin)
            hint = replace(hint, radius=np.where(reached, hint.radius, -1.0))
        kept.append(hint)
    return kept, margin


def used(hints):
    """Number (n,) of hints that are used."""
    return sum((hint.radius > 0).astype(int) for hint in hints)


def fit_footprint(hints, footprint, samples, low, high, strength):
    """The footprint of each query and its hints, of those that add_hints found; margin: as keep_reached."""
    hints, first = keep_reached(hints, footprint, low, high, strength)
    scale = np.where(used(hints) > 0, footprint_scale(hints, footprint.area, samples), 1.0)
    footprint = footprints.scale_footprint(scale, footprint)
    hints, second = keep_reached(hints, footprint, low, high, strength)
    return footprint, hints, np.minimum(first, second)


def query_modes(footprint, visits):
    """How each footprint is queried, one of MODE_..."""
    return query.query_mode(footprint.long_axis, footprint.short_axis, footprint.area, visits)
