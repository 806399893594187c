"""The command line: `blender --command glint prepare|render|info FILE.blend`; exits with 0 done, 1 failed, 2 misuse."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import bpy

from .blend_file import FORMATS, blender, chosen_scene, open_file, set_output
from .errors import GlintError, SceneError
from .streams import blender_talks_to_stderr
from .terminal import terminal_progress

COMMAND = "glint"
_handles = []


def register():
    """Offer the command `glint` to Blender's command line."""
    _handles.append(bpy.utils.register_cli_command(COMMAND, main))


def unregister():
    """Take the command back."""
    bpy.utils.unregister_cli_command(_handles.pop())


def main(arguments: list[str], program: str = f"blender --command {COMMAND}") -> int:
    """Run one command; results go to standard output, everything else to standard error. Returns the exit code."""
    try:
        options = parser(program).parse_args(arguments)
    except SystemExit as stop:  # argparse has said what is wrong, or printed the help
        return stop.code
    try:
        with blender_talks_to_stderr():
            lines = options.action(options)
    except GlintError as error:
        print(f"{COMMAND}: {error}", file=sys.stderr)
        return 1
    print("\n".join(lines))
    return 0


def parser(program: str) -> argparse.ArgumentParser:
    """What the commands take."""
    result = argparse.ArgumentParser(prog=program, description="Glints in .blend files, without a window.")
    commands = result.add_subparsers(title="commands", required=True, metavar="prepare|render|info")
    kinds = {"prepare": prepare_file, "render": render_file, "info": describe_file}
    for name, action in kinds.items():
        text = action.__doc__.partition("\n")[0]
        command = commands.add_parser(name, help=text, description=text)
        command.add_argument("file", type=Path, metavar="FILE.blend")
        command.set_defaults(action=action)
        if name != "info":
            command.add_argument("--scene", help="name of the scene (default: the file's active scene)")
        if name == "render":
            command.add_argument("--output", type=Path, help=f"picture to write ({', '.join(sorted(FORMATS))})")
            command.add_argument("--frame", type=int, help="frame to render (default: the file's)")
            command.add_argument("--samples", type=int, help="samples a pixel (default: the file's)")
        if name == "info":
            command.add_argument("--json", action="store_true", help="print JSON")
    return result


def prepare_file(options) -> list[str]:
    """Prepare a .blend file for glints and save it."""
    open_file(options.file)
    lines = prepare(chosen_scene(options.scene))
    blender("save the file", bpy.ops.wm.save_mainfile)
    return [*lines, f"Saved {options.file}"]


def render_file(options) -> list[str]:
    """Prepare a .blend file and render a still; the file itself is not changed."""
    open_file(options.file)
    scene = chosen_scene(options.scene)
    if scene.camera is None:
        raise SceneError(f'Scene "{scene.name}" has no camera: add one and try again.')
    if options.samples is not None:
        if options.samples < 1:
            raise SceneError(f"{options.samples} samples cannot be rendered: give at least 1.")
        scene.cycles.samples = options.samples
    if options.frame is not None:
        scene.frame_set(options.frame)
    if options.output is not None:
        set_output(scene, options.output)
    lines = prepare(scene)
    picture = Path(scene.render.frame_path(frame=scene.frame_current) if options.output is None else options.output)
    if options.output is None:
        scene.render.filepath = str(picture)
    blender(f"write {picture}", bpy.ops.render.render, write_still=True, scene=scene.name)
    return [*lines, f"Rendered {picture}"]


def describe_file(options) -> list[str]:
    """Say which glint materials a .blend file holds; the file is not changed."""
    open_file(options.file)
    facts = {"file": str(options.file), "materials": material_facts(), "scenes": scene_facts()}
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
        lines += [f"Warning: {sentence}" for sentence in scene["warnings"]]
        lines += [f"Note: {sentence}" for sentence in scene["notes"]]
        lines += [f"Advice: {sentence}" for sentence in scene["advice"]]
    return lines


def material_facts() -> list[dict]:
    """Each glint material of the open file with its maps; a table that is not on disk counts as not baked."""
    from .material import glint_groups, is_glint_material

    facts = []
    for material in filter(is_glint_material, bpy.data.materials):
        maps = []
        for group in glint_groups(material):
            image, table = group.get("glint_image"), group.get("glint_table", "")
            found = bool(table) and Path(bpy.path.abspath(table)).is_file()
            maps.append({"image": image.name if image else None, "table": table if found else ""})
        facts.append({"name": material.name, "maps": maps})
    return facts


def scene_facts() -> list[dict]:
    """What the last preparation of each scene found, and advice on its settings."""
    from .operators.keep_glints import ADVICE, softens_glints

    facts = []
    for scene in bpy.data.scenes:
        state = scene.glint
        facts.append(
            {
                "name": scene.name,
                "prepared": state.prepared,
                "osl": state.osl,
                "device": state.device,
                "hints": [line.name for line in state.hints],
                "skipped_lights": [[line.name, line.detail] for line in state.skipped_lights],
                "warnings": [line.name for line in state.warnings],
                "notes": [line.name for line in state.notes],
                "advice": [ADVICE] if state.prepared and softens_glints(scene) else [],
            }
        )
    return facts


def prepare(scene) -> list[str]:
    """Prepare `scene`, keep the report on it, and return it as lines."""
    from .operators.prepare import counts_line, summary
    from .operators.scene_state import store_report
    from .prepare import prepare_scene

    with terminal_progress() as progress:
        report = prepare_scene(scene, progress=progress)
    store_report(scene, report)
    return [summary(report), counts_line(report), *(f"Warning: {sentence}" for sentence in report["warnings"]),
            *(f"Note: {sentence}" for sentence in report["notes"])]
