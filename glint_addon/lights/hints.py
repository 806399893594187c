"""Light objects -> hints: which lights of a scene the glint lobe looks for, and why the others are left out.

A light left out still lights glints correctly, only as noisily as Blender's own nodes would show it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import bpy

from ..motion import copies_others, has_fixed_box, is_fixed
from ..nodes.glint_lights import HINT_COUNT, KIND_LOCAL, KIND_SUN
from .animation import is_animated, peak_value
from .irradiance import irradiance, tint
from .receivers import glint_objects, lit_objects, world_bounds
from .size import light_size

# A sun of this half-angle moves the half vector by half of it, 7.5 degrees, as much as the texels of most normal maps
# do: a normal drawn at random meets such a sun often enough, and the plain lobe is as smooth as the hinted one.
SOFT_HALF_ANGLE = radians(15.0)

TOO_MANY = f"dimmer than the {HINT_COUNT} strongest lights: left to the remainder, which is noisier"
MISSES = "shines past every object with glints, which are outside its cone or behind it"


@dataclass(frozen=True)
class Hint:
    """A light worth looking for.

    kind: KIND_SUN or KIND_LOCAL; power: estimated irradiance [W/m^2] on the glints, for ranking only;
    size: half-angle [rad] of a sun, bounding radius [m] of other lights.
    """

    object: bpy.types.Object
    kind: int
    power: float
    size: float


def scene_hints(scene, view_layer=None) -> tuple[list[Hint], list[tuple[str, str]]]:
    """Hints for the lights of `scene`, by name, and the lights skipped as (name, reason in words).

    Judges what `view_layer` renders, or any view layer switched on for rendering if None. Updates those layers, so that
    matrices are current. The lights' order does not depend on the frame, so an animation does not pop.
    """
    layers = [view_layer] if view_layer else [layer for layer in scene.view_layers if layer.use]
    for layer in layers:
        layer.update()
    rendered = rendered_objects(layers)
    shown = [thing for thing in rendered if not thing.hide_render or is_animated(thing, "hide_render")]
    receivers = glint_objects(shown)
    bounds = world_bounds(receivers or [thing for thing in shown if thing.type == "MESH"])
    lamps = sorted((thing for thing in scene.objects if thing.type == "LIGHT"), key=_full_name)

    # A light that misses all of them now misses them always, if nothing moves.
    is_still = bool(receivers) and all(has_fixed_box(thing) for thing in receivers)
    is_still = is_still and not any(copies_others(thing) for thing in scene.objects)

    candidates, skipped = [], _instanced_lights(shown)
    for lamp in lamps:
        lit = lit_objects(lamp, receivers)
        reason = _reason_to_skip(lamp, lamp in rendered, bool(lit) or not receivers)
        hint = _hint(lamp, bounds if len(lit) == len(receivers) else world_bounds(lit))
        if not reason and hint.power == 0 and is_still and is_fixed(lamp):
            reason = MISSES
        if reason:
            skipped.append((lamp.name, reason))
        else:
            candidates.append(hint)

    # Keep the strongest, in order of name.
    strongest = set(sorted(candidates, key=lambda hint: (-hint.power, _full_name(hint.object)))[:HINT_COUNT])
    skipped += [(hint.object.name, TOO_MANY) for hint in candidates if hint not in strongest]
    return [hint for hint in candidates if hint in strongest], skipped


def rendered_objects(layers) -> set[bpy.types.Object]:
    """Objects in collections that at least one of the view layers renders, whatever their own visibility."""
    found = set()
    for layer in layers:
        _collect(layer.layer_collection, found)
    return found


def _collect(layer_collection, found):
    # A collection disabled in renders hides its children too; an excluded one does not.
    if layer_collection.collection.hide_render:
        return
    if not layer_collection.exclude:
        found.update(layer_collection.collection.objects)
    for child in layer_collection.children:
        _collect(child, found)


def _reason_to_skip(lamp, in_rendered_collection: bool, lights_receivers: bool) -> str:
    """Why the light needs no hint, in words, or an empty string."""
    light = lamp.data
    half_angle = light.angle / 2 if light.type == "SUN" else 0.0
    checks = (
        (not in_rendered_collection, "its collections are hidden in renders or excluded from the view layer"),
        (lamp.hide_render and not is_animated(lamp, "hide_render"), "hidden in renders"),
        (light.energy <= 0 and not _may_shine_later(light), "its energy is zero or negative"),
        (max(tint(light)) <= 0 and not is_animated(light, "color"), "its colour is black"),
        (not lamp.visible_glossy, "not visible to glossy rays"),
        (light.type == "AREA" and light.cycles.is_portal, "a portal, which sends out no light of its own"),
        (half_angle > SOFT_HALF_ANGLE, "so wide a sun that plain sampling is already smooth"),
        (not lights_receivers, "light linking excludes every object with glints"),
        (_instances_children(lamp.parent), f'instanced by "{lamp.parent and lamp.parent.name}": no driver can follow'),
    )
    return next((reason for applies, reason in checks if applies), "")


def _may_shine_later(light) -> bool:
    """Whether animation may raise a light's energy above zero: keys say so; a driver or strip may."""
    return is_animated(light, "energy") and (peak_value(light, "energy") > 0 or not _has_only_keys(light))


def _has_only_keys(light) -> bool:
    animation = light.animation_data
    return not animation.nla_tracks and animation.drivers.find("energy") is None


def _hint(lamp, bounds) -> Hint:
    kind = KIND_SUN if lamp.data.type == "SUN" else KIND_LOCAL
    power = irradiance(lamp, *bounds, peak_value(lamp.data, "energy"))
    return Hint(lamp, kind, power, light_size(lamp))


def _instances_children(parent) -> bool:
    return parent is not None and parent.instance_type in {"VERTS", "FACES"}


def _instanced_lights(objects) -> list[tuple[str, str]]:
    """Lights that come into the scene inside instanced collections, with the reason why they get no hint."""
    found = []
    for empty in sorted(objects, key=_full_name):
        if empty.instance_type == "COLLECTION" and empty.instance_collection:
            inside = [thing for thing in empty.instance_collection.all_objects if thing.type == "LIGHT"]
            reason = f'instanced by "{empty.name}": no driver can follow it, left to the remainder'
            found += [(thing.name, reason) for thing in sorted(inside, key=_full_name)]
    return found


def _full_name(thing):
    """Sorts objects by name, then by the library they come from."""
    return thing.name, thing.library.filepath if thing.library else ""
