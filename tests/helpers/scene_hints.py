"""The lights of a whole scene, chosen as for one material whose facets reach all of them."""

from __future__ import annotations

from glint_addon.choice.ranking import choose
from glint_addon.lights import hints
from glint_addon.lights.receivers import copied_places


def scene_hints(scene, view_layer=None) -> tuple[list[hints.Hint], list[tuple[str, str]]]:
    """The strongest hints of `scene` for all its glints together, by name, and the others as (name, reason in words).

    Judges what `view_layer` renders, or any view layer switched on for rendering if None.
    """
    found, skipped = all_candidates(scene, view_layer)
    choice = choose(found, [hint.power for hint in found], negligible=0.0)
    return list(choice.hints), skipped + list(choice.left)


def all_candidates(scene, view_layer=None) -> tuple[list[hints.Hint], list[tuple[str, str]]]:
    """Every light worth a hint, by name, and the others as (name, reason in words), of the layers of `scene_hints`."""
    updated = hints.rendered_layers(scene)
    layers = [view_layer] if view_layer else updated
    return hints.scene_candidates(scene, layers, copied_places(scene, layers))
