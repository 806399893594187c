"""What each material of a scene looks for: by its own objects, and by the facets of its own map."""

from __future__ import annotations

from collections.abc import Collection
from math import inf

import bpy

from ..animation.frames import chosen_frames
from ..lights.hint import Hint
from ..lights.receivers import CopiedPlaces, lit_objects
from ..seen.scene_views import scene_views
from .close_views import CLOSE_UP, is_close_up
from .families import Family
from .noise import boxes_over, noise_in_remainder
from .ranking import Choice, choose
from .reach import facets_of, judgements

SHARPEST = 0.01  # alpha for which lights are ranked where a material's roughness is not known


def material_choices(
    scene: bpy.types.Scene, families: list[Family], found: list[Hint], copied: CopiedPlaces
) -> list[Choice]:
    """What each family looks for of the hints `found`; copied: `receivers.copied_places` of the layers rendered."""
    frames, views = chosen_frames(scene), scene_views(scene)
    everything = {thing for family in families for thing in family.objects}
    lit = {hint: set(_lit(hint, everything)) for hint in found}
    chosen = []
    for family in families:
        facets = facets_of(family.held)
        alpha = facets.alpha if facets else SHARPEST
        shared: dict[tuple[bpy.types.Object, ...], list[Hint]] = {}
        for hint in found:
            shared.setdefault(tuple(thing for thing in family.objects if thing in lit[hint]), []).append(hint)
        values: dict[Hint, float] = {}
        reached: set[Hint] = set()
        soft: set[Hint] = set()
        for objects, hints in shared.items():
            boxes = boxes_over(objects, frames, copied)
            judged = judgements(scene, views, objects, facets, hints)
            for hint in hints:
                values[hint] = noise_in_remainder(hint, boxes, frames, alpha)
                if judged is None or judged[hint].reached:
                    reached.add(hint)
                if judged is not None and 0.0 <= values[hint] < inf:
                    values[hint] = judged[hint].noise
                    if judged[hint].is_soft:
                        soft.add(hint)
        choice = choose(found, [values[hint] for hint in found], reached, soft)
        if choice.hints and is_close_up(scene, views, family):
            choice = Choice((), choice.left + tuple((hint.name, CLOSE_UP) for hint in choice.hints))
        chosen.append(choice)
    return chosen


def _lit(hint: Hint, objects: Collection[bpy.types.Object]) -> list[bpy.types.Object]:
    source = hint.source
    return lit_objects(source, objects) if source is not None else list(objects)
