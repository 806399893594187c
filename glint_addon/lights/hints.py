"""Which lights of a scene get a hint, and why the others get none.

Glints of a light without a hint are right in the mean, with the noise of Blender's own nodes.
"""

from __future__ import annotations

import bpy

from ..animation.curves import is_animated
from .emitters import mesh_emitters
from .hint import Hint
from .instances import instance_hints
from .lamps import lamp_hints
from .receivers import Bounds, CopiedPlaces, glint_objects, world_bounds
from .world.hints import world_hints


def rendered_layers(scene: bpy.types.Scene, *, update: bool = True) -> list[bpy.types.ViewLayer]:
    """The view layers of `scene` that are switched on for rendering.

    update: bring them up to date, for matrices, and for the collections of a scene never shown.
    """
    layers = [layer for layer in scene.view_layers if layer.use]
    for layer in layers if update else ():
        layer.update()
    return layers


def scene_candidates(
    scene: bpy.types.Scene, layers: list[bpy.types.ViewLayer], copied: CopiedPlaces
) -> tuple[list[Hint], list[tuple[str, str]]]:
    """`candidates` for all objects with glints that the view layers `layers` of `scene`, up to date, render.

    copied: `receivers.copied_places` of these layers.
    """
    shown = shown_objects(layers)
    receivers = glint_objects([*shown, *sorted(copied.keys() - set(shown), key=lambda thing: thing.name_full)], layers)
    bounds = world_bounds(receivers or [thing for thing in shown if thing.type == "MESH"], copied)
    return candidates(scene, layers, receivers, bounds)


def candidates(
    scene: bpy.types.Scene, layers: list[bpy.types.ViewLayer], receivers: list[bpy.types.Object], bounds: Bounds
) -> tuple[list[Hint], list[tuple[str, str]]]:
    """Every light of `scene` worth a hint, by name, and the others as (name, reason in words).

    layers: the view layers that count, which must be up to date; receivers: objects with glints; bounds: low and high
    corners (n, 3) of their boxes in world space [m], or of what stands in for them where there are none.
    """
    rendered = rendered_objects(layers)
    found, skipped = lamp_hints(scene, rendered, receivers, bounds)
    meshes, dark = mesh_emitters(scene, layers, rendered, receivers, bounds)
    shown, hidden = instance_hints(scene, layers, shown_objects(layers), receivers, bounds)
    of_world, unseen = world_hints(scene, layers)
    return sorted(found + meshes + shown + of_world, key=lambda hint: hint.order), sorted(
        skipped + dark + hidden + unseen)


def shown_objects(layers: list[bpy.types.ViewLayer]) -> list[bpy.types.Object]:
    """Objects that at least one of the view layers renders, at some frame, by name."""
    rendered = (thing for thing in rendered_objects(layers)
                if not thing.hide_render or is_animated(thing, "hide_render"))
    return sorted(rendered, key=lambda thing: thing.name_full)


def rendered_objects(layers: list[bpy.types.ViewLayer]) -> set[bpy.types.Object]:
    """Objects in collections that at least one of the view layers renders, whatever their own visibility."""
    found: set[bpy.types.Object] = set()
    for layer in layers:
        _collect(layer.layer_collection, found)
    return found


def _collect(layer_collection: bpy.types.LayerCollection, found: set[bpy.types.Object]) -> None:
    # A collection disabled in renders hides its children too; an excluded one does not.
    if layer_collection.collection.hide_render:
        return
    if not layer_collection.exclude:
        found.update(layer_collection.collection.objects)
    for child in layer_collection.children:
        _collect(child, found)
