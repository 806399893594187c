"""What the commands take: names, kinds and help; what is done with them is in cli.py."""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import bpy

from .. import paths

# Shown under the help of every command.
RECIPE = """\
A render farm needs the extension once, or not at all:
  1. Prepare the file, here or in a first task:  {program} prepare FILE.blend
  2. Copy its folder, glint_tables included, to wherever frames are rendered.
  3. Render there in plain Blender, with or without the extension:  blender -b FILE.blend -a
{template} is this recipe as a job for AWS Deadline Cloud and
others that read Open Job Description.
"""


def parser(program: str, actions: Mapping[str, Callable[[argparse.Namespace], list[str]]]) -> argparse.ArgumentParser:
    """A parser whose result holds the function to call as `action`; actions: {"prepare": function, ...}."""
    recipe = RECIPE.format(program=program, template=paths.ROOT / "farm" / "glint.openjd.yaml")
    looks: dict[str, Any] = {"formatter_class": argparse.RawDescriptionHelpFormatter, "epilog": recipe}
    result = argparse.ArgumentParser(prog=program, description="Glints in .blend files, without a window.", **looks)
    result.add_argument("--version", action="version", version=version())
    commands = result.add_subparsers(title="commands", required=True, metavar="|".join(actions))
    for name, action in actions.items():
        text = (action.__doc__ or "").partition("\n")[0]
        command = commands.add_parser(name, help=text, description=text, **looks)
        command.add_argument("file", type=Path, metavar="FILE.blend")
        command.set_defaults(action=action)
        _ARGUMENTS[name](command)
    return result


def version() -> str:
    """Glint's version, from the manifest, and Blender's."""
    manifest = tomllib.loads((paths.ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    return f"{manifest['name']} {manifest['version']} (Blender {bpy.app.version_string})"


def _prepare_arguments(command: argparse.ArgumentParser):
    _scene_arguments(command)
    command.add_argument("--save-as", type=Path, metavar="COPY.blend",
                         help="save to a copy in the same folder and leave the file as it is")


def _render_arguments(command: argparse.ArgumentParser):
    _scene_arguments(command)
    frames = command.add_mutually_exclusive_group()
    frames.add_argument("--frame", type=int, help="render a still of this frame (default: the file's current frame)")
    frames.add_argument("--frames", metavar="LIST",
                        help="render these frames: 1-10,20 or 1..10, every tenth 1-100x10, below 0 --frames=-5-10")
    frames.add_argument("--animation", action="store_true", help="render the scene's own frame range and step")
    command.add_argument("--output", metavar="PATH",
                         help="what to write (default: the scene's output): // is the .blend file's folder, # a digit "
                              "of the frame; .png, .exr, .jpg, .tif, .webp, .mp4, .mkv and .mov choose the format")
    command.add_argument("--resolution", metavar="SIZE", help="1920x1080 pixels, or 50%% of the scene's resolution")
    command.add_argument("--samples", type=int, help="samples a pixel (default: the file's)")
    command.add_argument("--engine-option", action="append", default=[], metavar="NAME=VALUE",
                         help="set a property of scene.cycles, such as use_denoising=false; may be repeated")
    command.add_argument("--view-layer", action="append", default=[], metavar="NAME",
                         help="render this view layer and no others; may be repeated")


def _info_arguments(command: argparse.ArgumentParser):
    command.add_argument("--json", action="store_true", help="print JSON")


def _scene_arguments(command: argparse.ArgumentParser):
    """What prepares a scene takes."""
    command.add_argument("--scene", help="name of the scene (default: the file's active scene)")
    command.add_argument("--bake-unseen", action=argparse.BooleanOptionalAction,
                         help="also bake for objects that no camera sees (default: the scene's own setting)")
    command.add_argument("--table-budget", type=int, metavar="MIB",
                         help="memory that all tables together may take (default: the scene's own setting)")


_ARGUMENTS = {"prepare": _prepare_arguments, "render": _render_arguments, "info": _info_arguments}
