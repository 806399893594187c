"""Small bright lights of the world: spots of environment textures, the suns of sky textures."""

from __future__ import annotations

from collections.abc import Iterable
from math import dist
from typing import Any

import bpy
import numpy as np

from ...images import is_still
from ...nodes.driven import Driven
from ...nodes.glint_lights import HINT_COUNT, KIND_NONE, KIND_SUN
from ..hint import Hint
from ..reasons import INVISIBLE
from ..softness import SOFT_HALF_ANGLE, TOO_SOFT
from .direction import UnreadableMappingError, in_world
from .picture import linear_pixels
from .sky_sun import SKIES_WITH_SUN, sun_irradiance, sun_now, sun_over_time
from .spots import Spot, bright_spots
from .textures import Texture, world_textures
from .trigonometry import Angles, constant

# Without the world's sampling a hint leaves the noise as it is: decision 46.
MET_BY_CHANCE = "its light is met by chance alone, where no hint helps: set World > Settings > Sampling to Auto"
LEFT = "small lights in it are left to chance, which is noisier"

# What `Hint` is made of, by its fields' names, but for name and kind.
Settings = dict[str, Any]


def world_hints(
    scene: bpy.types.Scene, layers: Iterable[bpy.types.ViewLayer] = ()
) -> tuple[list[Hint], list[tuple[str, str]]]:
    """Hints for the small bright lights of the world of `scene`, and the skipped ones as (name, reason in words).

    layers: view layers whose override of the world counts. Textures that cannot be read are skipped without an error.
    """
    worlds = [layer.world_override or scene.world for layer in layers] or [scene.world]
    hints, skipped = [], []
    for world in dict.fromkeys(worlds):
        if world is not None and world.node_tree is not None:
            found, left = _hints_of(scene, world)
            hints += found
            skipped += left
    return hints, skipped


def _hints_of(scene: bpy.types.Scene, world: bpy.types.World) -> tuple[list[Hint], list[tuple[str, str]]]:
    textures, reasons = world_textures(world)
    for applies, reason in (
        (not world.cycles_visibility.glossy, INVISIBLE),
        (world.cycles.sampling_method == "NONE", MET_BY_CHANCE),
    ):
        if textures and applies:
            return [], [(world.name, reason)]
    skipped = [(world.name, reason) for reason in reasons]

    spots, suns = [], []
    for texture in textures:
        try:
            if texture.node.bl_idname == "ShaderNodeTexSky":
                suns += _sun(scene, texture)
            else:
                found, left = _spots(world, texture)
                spots += found
                skipped += left
        except UnreadableMappingError as reason:
            skipped.append((world.name, f"{reason}: {LEFT}"))
    return _named(world, "sun", suns) + _named(world, "spot", _merged(spots)[:HINT_COUNT]), skipped


def _merged(spots: list[Settings]) -> list[Settings]:
    """Spots' settings, strongest first. A spot within another, as of one picture behind two nodes, is added to it."""
    merged: list[Settings] = []
    for spot in sorted(spots, key=lambda spot: -spot["power"]):
        same = next((other for other in merged if other["live"] == spot["live"]
                     and dist(other["direction"], spot["direction"]) < other["size"]), None)
        if same is None:
            merged.append(dict(spot))
        else:
            same["power"] += spot["power"]
    return sorted(merged, key=lambda spot: -spot["power"])


def _named(world: bpy.types.World, word: str, parts: list[Settings]) -> list[Hint]:
    """Hints with the names "<world> sun", or "<world> sun 1" and so on if there are more."""
    names = [f"{world.name} {word}" + (f" {index}" if len(parts) > 1 else "") for index in range(1, len(parts) + 1)]
    return [Hint(name, KIND_SUN, **part) for name, part in zip(names, parts, strict=True)]


def _sun(scene: bpy.types.Scene, texture: Texture) -> list[Settings]:
    """The sun of a Sky Texture as settings of one hint or none. A Mapping before it changes nothing, as in Cycles."""
    node = texture.node
    *direction, kind, half_angle = map(_socket_number, sun_now(node))
    live = sun_over_time(scene, node)
    if node.sky_type not in SKIES_WITH_SUN or not node.sun_disc or live is None and kind == KIND_NONE:
        return []
    if half_angle > SOFT_HALF_ANGLE and live is None:
        return []
    power = texture.factor * sun_irradiance(node)
    return [{"power": power, "size": half_angle, "direction": tuple(direction), "live": live}]


def _spots(world: bpy.types.World, texture: Texture) -> tuple[list[Settings], list[tuple[str, str]]]:
    """The spots of an Environment Texture as settings of hints, and the skipped ones."""
    image = texture.node.image
    if image is None:
        return [], []
    if not is_still(image):
        return [], [(world.name, f'"{image.name}" is a {image.source.lower()}, no still image: {LEFT}')]
    pixels = linear_pixels(image)
    if pixels is None:
        return [], [(world.name, f'"{image.name}" has no pixels: find its file with File > External Data')]
    found, wide = bright_spots(pixels, texture.node.projection, SOFT_HALF_ANGLE)
    parts = [_settings(world, texture, spot) for spot in found]
    return parts, [(world.name, f'{wide} bright areas of "{image.name}": {TOO_SOFT}')] if wide else []


def _settings(world: bpy.types.World, texture: Texture, spot: Spot) -> Settings:
    """The settings of a hint for a spot of an Environment Texture."""
    angles = Angles()
    vector = in_world(world, texture, constant(spot.direction), angles)
    numbers = angles.over_time(vector)
    if numbers is None:
        raise UnreadableMappingError(f'too many of the Mapping nodes of "{texture.node.name}" move')
    size = _socket_number(spot.half_angle)
    live = (*numbers, KIND_SUN, size) if any(isinstance(entry, Driven) for entry in numbers) else None
    direction = tuple(map(_socket_number, angles.now(vector)))
    return {"power": texture.factor * spot.irradiance, "size": size, "direction": direction, "live": live}


def _socket_number(number: float) -> float:
    """A number as sockets hold it, in 32 bits."""
    return float(np.float32(number))
