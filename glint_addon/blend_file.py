"""Blend files without a window: open, choose a scene, name the picture, and let Blender's failures be sentences."""

from __future__ import annotations

from pathlib import Path

import bpy

from .errors import SceneError

FORMATS = {
    ".exr": "OPEN_EXR",
    ".jpeg": "JPEG",
    ".jpg": "JPEG",
    ".png": "PNG",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".webp": "WEBP",
}


def open_file(file: Path):
    """Open a .blend file without its window layout.

    Raises SceneError if it is missing or not a .blend file.
    """
    if not file.is_file():
        raise SceneError(f"{file} is not there: check the path and try again.")
    blender(f"open {file}", bpy.ops.wm.open_mainfile, filepath=str(file.resolve()), load_ui=False)


def chosen_scene(name: str | None):
    """The scene `name` of the open file, or its active scene.

    Raises SceneError if there is none of that name.
    """
    if name is None:
        return bpy.context.scene
    scene = bpy.data.scenes.get(name)
    if scene is None:
        raise SceneError(f'The file has no scene named "{name}": choose one of {", ".join(bpy.data.scenes.keys())}.')
    return scene


def set_output(scene, picture: Path):
    """Let `scene` render to `picture`, in the format its ending says.

    Raises SceneError for an ending that is not a picture's.
    """
    kind = FORMATS.get(picture.suffix.lower())
    if kind is None:
        raise SceneError(f"{picture} does not end like a picture: use one of {', '.join(sorted(FORMATS))}.")
    scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = kind
    scene.render.filepath = str(picture.resolve())


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
