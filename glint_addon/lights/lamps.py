"""Light objects -> hints, and why the others need none."""

from __future__ import annotations

from typing import Any

import bpy

from ..animation.curves import is_animated, peak_value
from ..animation.motion import is_fixed
from ..nodes.glint_lights import KIND_LOCAL, KIND_SUN
from .emission import lamp_factor
from .hint import Hint
from .irradiance import irradiance, tint
from .kind import Lamp, Local
from .kinds import kind_of
from .reasons import INVISIBLE, reason_here
from .receivers import Bounds, are_still, lit_objects, world_bounds
from .softness import SOFT_HALF_ANGLE, TOO_SOFT, least_half_angle

MISSES = "shines past every object with glints, which are outside its cone or behind it"


def lamp_hints(
    scene: bpy.types.Scene, rendered: set[bpy.types.Object], receivers: list[bpy.types.Object], bounds: Bounds
) -> tuple[list[Hint], list[tuple[str, str]]]:
    """Hints for the light objects of `scene`, and those skipped as (name, reason in words).

    rendered: objects in collections that are rendered; receivers: objects with glints; bounds: their boxes, or others'
    where there are none. Matrices must be current.
    """
    # A light that misses all of them now misses them always, if nothing moves.
    is_still = are_still(receivers, scene)

    hints, skipped = [], []
    for lamp in (thing for thing in scene.objects if thing.type == "LIGHT"):
        lit = lit_objects(lamp, receivers)
        reason = reason_here(lamp, lamp in rendered, bool(lit) or not receivers) or reason_to_skip(lamp)
        boxes = bounds if len(lit) == len(receivers) else world_bounds(lit)
        hint = lamp_hint(lamp.name, lamp, boxes, object=lamp)
        if not reason and is_still and is_fixed(lamp):
            reason = MISSES if hint.power == 0 else TOO_SOFT if _is_soft(lamp, boxes) else ""
        if reason:
            skipped.append((lamp.name, reason))
        else:
            hints.append(hint)
    return hints, skipped


def reason_to_skip(lamp: bpy.types.Object) -> str:
    """Why a light object needs no hint wherever it is, in words, or an empty string."""
    light = lamp.data
    checks = (
        (light.energy <= 0 and not _may_shine_later(light), "its energy is zero or negative"),
        (max(tint(light)) <= 0 and not is_animated(light, "color"), "its colour is black"),
        (max(lamp_factor(light)) <= 0 and not _has_moving_nodes(light), "its nodes send out no light"),
        (not lamp.visible_glossy, INVISIBLE),
    )
    return next((reason for applies, reason in checks if applies), "") or kind_of(lamp).reason_to_skip(light)


def lamp_hint(name: str, lamp: Lamp, boxes: Bounds, **where: Any) -> Hint:
    """The hint of light object `lamp`, or of a `PlacedLamp`; where: its object or instance."""
    kind = kind_of(lamp)
    power = irradiance(lamp, *boxes, peak_value(lamp.data, "energy"))
    return Hint(name, KIND_SUN if kind.is_distant else KIND_LOCAL, power, kind.size(lamp), **where)


def _has_moving_nodes(light: bpy.types.Light) -> bool:
    return light.node_tree is not None and light.node_tree.animation_data is not None


def _may_shine_later(light: bpy.types.Light) -> bool:
    """Whether animation may raise a light's energy above zero: keys say so; a driver or strip may."""
    return is_animated(light, "energy") and (peak_value(light, "energy") > 0 or not _has_only_keys(light))


def _has_only_keys(light: bpy.types.Light) -> bool:
    animation = light.animation_data
    return not animation.nla_tracks and animation.drivers.find("energy") is None


def _is_soft(lamp: Lamp, boxes: Bounds) -> bool:
    kind = kind_of(lamp)
    if not isinstance(kind, Local):
        return False  # `reason_to_skip` judges them, moving or not
    return least_half_angle(lamp.matrix_world.translation, kind.cross_section(lamp), *boxes) > SOFT_HALF_ANGLE
