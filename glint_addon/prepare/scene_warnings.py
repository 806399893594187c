"""Warnings about a scene: what keeps its glints from being rendered as they should be, and what helps."""

from __future__ import annotations

import bpy

from ..nodes.glint_bsdf import lights_of
from ..nodes.glint_lights import set_of
from ..nodes.map_tables import MapTables
from ..nodes.script_node import osl_available
from .real_size import size_warnings
from .shading_system import ENGINES, NO_OSL, ON_GPU
from .stored_tables import is_missing
from .uses import Uses, shown_map, unknown_materials


def scene_warnings(scene: bpy.types.Scene, uses: Uses) -> list[str]:
    """Sentences on settings, maps and materials. uses: {group: [(object, material), ...]} of all groups shown."""
    return (_setting_warnings(scene) + _missing_maps(uses) + _hidden_warnings(scene) + _linked_warnings(uses)
            + size_warnings(scene, uses))


def device(scene: bpy.types.Scene) -> str:
    """What Cycles renders `scene` on, "CPU" or "GPU"."""
    return scene.cycles.device if hasattr(scene, "cycles") else "CPU"


def reads_scene(group: bpy.types.ShaderNodeTree) -> bool:
    """Whether a Glint BSDF group of another file reads the lights of the scene being rendered."""
    lights = lights_of(group)
    return lights is not None and set_of(lights) > 0


def _setting_warnings(scene: bpy.types.Scene) -> list[str]:
    warnings = []
    if not osl_available():
        warnings.append(NO_OSL)
    if scene.render.engine not in ENGINES:
        warnings.append(f"The render engine is {scene.render.engine}: choose Cycles or EEVEE to render glints.")
    if device(scene) == "GPU":
        warnings.append(ON_GPU)
    if scene.render.use_simplify and getattr(scene.cycles, "texture_limit_render", "OFF") != "OFF":
        warnings.append("Simplify limits texture sizes, which garbles the glint tables: set its limit to No Limit.")
    if scene.render.use_simplify and getattr(scene.cycles, "texture_resolution_render", 1.0) < 1.0:
        warnings.append("Simplify scales textures down, which garbles the glint tables: set their resolution to 1.")
    return warnings


def _missing_maps(uses: Uses) -> list[str]:
    """Sentences on maps that are not to be had, one for each group that reads them, by the groups' names."""
    lost = [group for group in uses if group.library is None and is_missing(group)]
    return [f'The normal map "{shown_map(group).name}" is missing: find it with File > External Data.'
            for group in sorted(lost, key=lambda group: group.name_full)]


def _hidden_warnings(scene: bpy.types.Scene) -> list[str]:
    """Sentences on objects whose materials cannot be found."""
    return [f'The materials that geometry nodes give to "{name}" are unknown while it, or its modifier, is hidden in '
            "the viewport: show it there and prepare again." for name in unknown_materials(scene)]


def _linked_warnings(uses: Uses) -> list[str]:
    """Sentences on glints of other files, which cannot be prepared here; one for each material."""
    return sorted({_linked_words(material.name, group) for group, pairs in uses.items() if group.library is not None
                   and not (MapTables.of(group).path and reads_scene(group)) for _, material in pairs})


def _linked_words(name: str, group: bpy.types.ShaderNodeTree) -> str:
    linked = f'The glints of "{name}" are linked from {group.library.filepath}'
    local = "make them local with Object > Relations > Make Local > All"
    if not reads_scene(group):
        return (f"{linked}, saved with an older version of Glint, and look for the lights of that file alone: "
                f"prepare them in that file again, or {local}.")
    return (f"{linked}, where they were not prepared, and have the noise of Blender's own nodes: "
            f"prepare them in that file, or {local}.")
