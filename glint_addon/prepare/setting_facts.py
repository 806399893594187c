"""What a preparation takes from a scene's settings, in JSON's types, and what changed in them since."""

from __future__ import annotations

import bpy

from ..lights.hints import rendered_layers
from .shading_system import is_on

# Footprints have a margin for so much more or less resolution (`footprints.MARGIN`).
LARGEST_ZOOM = 2.0


def setting_facts(scene: bpy.types.Scene) -> dict[str, str | int]:
    """What a preparation takes from the scene's settings, by the words for it."""
    render, cycles, layers = scene.render, scene.cycles, rendered_layers(scene, update=False)
    limits = "no limit"
    if render.use_simplify:
        limits = f"{cycles.texture_limit_render} at {cycles.texture_resolution_render:g}"
        limits = "no limit" if limits == "OFF at 1" else limits
    overrides = sorted({layer.material_override.name_full for layer in layers if layer.material_override})
    cameras = sorted(thing.name_full for thing in scene.objects if thing.type == "CAMERA")
    blur = f"{render.motion_blur_shutter:g} {render.motion_blur_position}" if render.use_motion_blur else "off"
    return {
        "Render Engine": render.engine,
        "Device": cycles.device,
        "Open Shading Language": "on" if is_on(scene) else "off",
        "The texture limit of Simplify": limits,
        "View layers": ", ".join(layer.name for layer in layers),
        "The material override": ", ".join(overrides) or "none",
        "Cameras": ", ".join(cameras) or "none",
        "The frame range": f"{scene.frame_start} to {scene.frame_end}",
        "Motion blur": blur,
        "Pixels of the picture": _pixels(render),
    }


def changed_settings(before: dict[str, str | int], now: dict[str, str | int]) -> list[str]:
    """Sentences on settings; a picture little larger or smaller needs nothing."""
    sentences = []
    for name, new in now.items():
        old = before.get(name)
        if isinstance(new, int) and isinstance(old, int):
            if max(new, old) <= LARGEST_ZOOM**2 * max(min(new, old), 1):
                continue
        elif new == old:
            continue
        sentences.append(f"{name}: {new} now, {old} before.")
    return sentences


def _pixels(render: bpy.types.RenderSettings) -> int:
    return render.resolution_x * render.resolution_y * render.resolution_percentage**2 // 10000
