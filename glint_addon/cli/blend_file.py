"""Blend files without a window: open, choose a scene, save, and let Blender's failures be sentences."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..errors import SceneError


def open_file(file: Path):
    """Open a .blend file without its window layout.

    Raises SceneError if it is missing or not a .blend file.
    """
    if not file.is_file():
        raise SceneError(f"{file} is not there: check the path and try again.")
    blender(f"open {file}", bpy.ops.wm.open_mainfile, filepath=str(file.absolute()), load_ui=False)


def chosen_scene(name: str | None):
    """The scene `name` of the open file, its own before one of a library, or its active scene.

    Raises SceneError if there is none of that name, or if it is linked: what Glint changes there could not be saved.
    """
    scenes = bpy.data.scenes
    scene = bpy.context.scene if name is None else scenes.get((name, None)) or scenes.get(name)
    if scene is None:
        raise SceneError(f'The file has no scene named "{name}": choose one of {", ".join(scenes.keys())}.')
    if not scene.is_editable:
        raise SceneError(f'Scene "{scene.name}" is linked from {scene.library.filepath}: prepare it there.')
    return scene


def save_file(file: Path, target: Path | None):
    """Save the open `file`, or a copy of it to `target`; of a file there before Blender keeps a .blend1.

    Raises SceneError if Blender cannot.
    """
    if target is None:
        blender("save the file", bpy.ops.wm.save_mainfile)
    else:
        blender(f"save {target}", bpy.ops.wm.save_as_mainfile, filepath=str(target.absolute()), copy=True)


def check_copy(file: Path, target: Path):
    """Raise SceneError unless `target` can be a copy of the prepared `file`: tables are found from its folder."""
    if target.suffix != ".blend" or target.absolute().parent != file.absolute().parent:
        raise SceneError(f"{target} cannot hold the prepared copy of {file}: give the name of a .blend file in the "
                         "same folder, from where its textures and glint tables are found.")


def blender(aim: str, operator, **settings):
    """Call one of Blender's operators.

    Raises SceneError with Blender's own words if it fails.
    """
    try:
        result = operator(**settings)
    except RuntimeError as error:
        words = str(error).strip().splitlines()[-1].removeprefix("Error: ").rstrip(".")
        raise SceneError(f"Blender cannot {aim} ({words}): repair what it names and try again.") from error
    if "FINISHED" not in result:
        raise SceneError(f"Blender did not {aim}: try it in Blender itself to see why.")
