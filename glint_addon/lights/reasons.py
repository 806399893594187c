"""Why a light needs no hint, where the words are the same for lamps, emissive objects, their copies and worlds."""

from __future__ import annotations

import bpy

from ..animation.curves import is_animated

INVISIBLE = "not visible to glossy rays"
UNLINKED = "light linking excludes every object with glints"


def reason_here(thing: bpy.types.Object, in_rendered_collection: bool, lights_receivers: bool) -> str:
    """Why a light object, or an emissive one, needs no hint where it is, in words, or an empty string."""
    checks = (
        (not in_rendered_collection, "its collections are hidden in renders or excluded from the view layer"),
        (thing.hide_render and not is_animated(thing, "hide_render"), "hidden in renders"),
        (not lights_receivers, UNLINKED),
        (_instances_children(thing.parent), f'shown by "{thing.parent and thing.parent.name}" alone, on its faces'),
    )
    return next((reason for applies, reason in checks if applies), "")


def _instances_children(parent: bpy.types.Object | None) -> bool:
    return parent is not None and parent.instance_type in {"VERTS", "FACES"}
