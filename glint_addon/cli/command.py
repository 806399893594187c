"""The command line: `blender --command glint prepare|render|info FILE.blend`; exits with 0 done, 1 failed, 2 misuse."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from typing import Any

import bpy

from ..errors import GlintError, SceneError
from .arguments import parser
from .blend_file import check_copy, chosen_scene, open_file, save_file
from .frame_list import checked_frame, frame_ranges
from .pictures import check_output, is_numbered, render_frames, render_still, set_output
from .render_settings import set_engine_option, set_number, set_resolution, set_samples, use_view_layers
from .streams import blender_talks_to_stderr
from .terminal import terminal_progress

COMMAND = "glint"
_handles: list[Any] = []  # of Blender's, one for each command


def register():
    """Offer the command `glint` to Blender's command line."""
    _handles.append(bpy.utils.register_cli_command(COMMAND, main))


def unregister():
    """Take the command back."""
    bpy.utils.unregister_cli_command(_handles.pop())


def main(arguments: list[str], program: str = f"blender --command {COMMAND}") -> int:
    """Run one command; results go to standard output, everything else to standard error. Returns the exit code."""
    actions = {"prepare": prepare_file, "render": render_file, "info": describe_file}
    try:
        options = parser(program, actions).parse_args(arguments)
    except SystemExit as stop:  # argparse has said what is wrong, or printed the help
        return int(stop.code or 0)
    try:
        with blender_talks_to_stderr():
            lines = options.action(options)
    except GlintError as error:
        print(f"{COMMAND}: {error}", file=sys.stderr)
        return 1
    print("\n".join(lines))
    return 0


def prepare_file(options: Namespace) -> list[str]:
    """Prepare a .blend file for glints and save it."""
    if options.save_as is not None:
        check_copy(options.file, options.save_as)
    open_file(options.file)
    scene = chosen_scene(options.scene)
    choose_baking(scene, options)
    lines = prepare(scene)
    save_file(options.file, options.save_as)
    return [*lines, f"Saved {options.save_as or options.file}"]


def render_file(options: Namespace) -> list[str]:
    """Prepare a .blend file and render a still, frames or its animation; the file itself is not changed."""
    ranges = None if options.frames is None else frame_ranges(options.frames)
    frame = None if options.frame is None else checked_frame(options.frame)
    open_file(options.file)
    scene = chosen_scene(options.scene)
    if scene.camera is None:
        raise SceneError(f'Scene "{scene.name}" has no camera: add one and try again.')
    if options.animation:
        ranges = [range(scene.frame_start, scene.frame_end + 1, max(scene.frame_step, 1))]
    change_settings(scene, options, numbered=ranges is not None)
    check_output(scene, ranges)
    if frame is not None:
        scene.frame_set(frame)
    lines = [f"Changed: {sentence}" for sentence in changes_of(scene)] + prepare(scene)
    if ranges is None:
        return lines + render_still(scene, numbered=options.output is None or is_numbered(options.output))
    return lines + render_frames(scene, ranges)


def change_settings(scene, options: Namespace, *, numbered: bool):
    """Let `scene` render as the command line says; `numbered`: each picture is named by its frame.

    All of it before the scene is prepared: tables fit its view layers and resolution.
    """
    if options.samples is not None:
        set_samples(scene, options.samples)
    for words in options.engine_option:
        set_engine_option(scene, words)
    if options.resolution is not None:
        set_resolution(scene, options.resolution)
    if options.view_layer:
        use_view_layers(scene, options.view_layer)
    if options.output is not None:
        set_output(scene, options.output, numbered=numbered)
    choose_baking(scene, options)


def choose_baking(scene, options: Namespace):
    """Set what the scene's tables may hold, on the scene itself: the panel then shows what the saved file holds."""
    if options.bake_unseen is not None:
        scene.glint.bake_unseen = options.bake_unseen
    if options.table_budget is not None:
        words = f"A table budget of {options.table_budget} MiB"
        set_number(scene.glint, "table_budget", options.table_budget, words)


def describe_file(options: Namespace) -> list[str]:
    """Say which glint materials a .blend file holds; the file is not changed."""
    open_file(options.file)
    facts: dict[str, Any] = {"file": str(options.file), "materials": material_facts(), "scenes": scene_facts()}
    if options.json:
        return [json.dumps(facts, indent=2)]
    lines = []
    for material in facts["materials"]:
        for used in material["maps"]:
            lines.append(f"Material {material['name']}: map {used['image']}, table {used['table'] or 'not baked'}")
    for scene in facts["scenes"]:
        words = (
            f"OSL {'on' if scene['osl'] else 'off'}, {scene['device']}, lights: {', '.join(scene['hints']) or 'none'}"
        )
        lines.append(f"Scene {scene['name']}: {words if scene['prepared'] else 'not prepared'}")
        lines += [f"Changed: {sentence}" for sentence in scene["changes"] if scene["prepared"]]
        lines += [f"Warning: {sentence}" for sentence in scene["warnings"]]
        lines += [f"Note: {sentence}" for sentence in scene["notes"]]
        lines += [f"Advice: {sentence}" for sentence in scene["advice"]]
    return lines


def material_facts() -> list[dict[str, Any]]:
    """Each glint material of the open file with its maps; a table that is not on disk counts as not baked."""
    from ..bake.float_image import is_whole
    from ..materials.find import glint_groups, is_glint_material
    from ..nodes.map_binding import map_of
    from ..nodes.map_tables import MapTables
    from ..paths import disk_path

    facts = []
    for material in filter(is_glint_material, bpy.data.materials):
        maps = []
        for group in glint_groups(material):
            image, table = map_of(group), MapTables.of(group).path
            found = bool(table) and is_whole(disk_path(table))
            maps.append({"image": image.name if image else None, "table": table if found else ""})
        facts.append({"name": material.name, "maps": maps})
    return facts


def scene_facts() -> list[dict[str, Any]]:
    """What the last preparation of each scene found, and advice on its settings."""
    from ..operators.keep_glints import ADVICE, softens_glints
    from ..prepare.shading_system import is_on

    facts = []
    for scene in bpy.data.scenes:
        state = scene.glint
        facts.append(
            {
                "name": scene.name,
                "prepared": state.prepared,
                "changes": changes_of(scene),
                "osl": is_on(scene),
                "device": scene.cycles.device if hasattr(scene, "cycles") else "",
                "hints": [line.name for line in state.hints],
                "skipped_lights": [[line.name, line.detail] for line in state.skipped_lights],
                "warnings": [line.name for line in state.warnings],
                "notes": [line.name for line in state.notes],
                "advice": [ADVICE] if state.prepared and softens_glints(scene) else [],
            }
        )
    return facts


def changes_of(scene) -> list[str]:
    """What changed since `scene` was prepared; nothing has been evaluated yet in a file that was just opened."""
    from ..prepare.changes import changes_since_prepared
    from ..prepare.uses import rendered_layers

    rendered_layers(scene)
    return changes_since_prepared(scene)


def prepare(scene) -> list[str]:
    """Prepare `scene`, keep the report on it, and return it as lines."""
    from ..operators.prepare import counts_line, summary
    from ..operators.scene_state import store_report
    from ..prepare.jobs import finished
    from ..prepare.scene import preparation

    with terminal_progress() as progress:
        report = finished(preparation(scene), progress)
    store_report(scene, report)
    return [summary(report), counts_line(report), *(f"Warning: {sentence}" for sentence in report.warnings),
            *(f"Note: {sentence}" for sentence in report.notes)]
