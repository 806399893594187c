"""Runs in a Blender of its own: installs the zip, uses it, disables and removes it; prints what it saw as JSON.

Arguments: the zip, a normal map, the .blend file to save. BLENDER_USER_RESOURCES is a temporary folder.
"""

import contextlib
import json
import os
import sys
from pathlib import Path

import bpy

MODULE = "bl_ext.user_default.glint"


def blender_state() -> dict:
    """What an extension adds to Blender."""
    return {
        "types": sorted(name for name in dir(bpy.types) if "glint" in name.lower()),
        "operators": sorted(dir(bpy.ops.glint)),
        "scene": hasattr(bpy.types.Scene, "glint"),
        "handlers": [name for name in handler_names() if name.startswith("bl_ext.")],
        "driver functions": sorted(bpy.app.driver_namespace),
        "addons": sorted(bpy.context.preferences.addons.keys()),
    }


def handler_names() -> list[str]:
    """Every application handler that is set, by the module and name of its function."""
    lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
    functions = [function for value in lists if isinstance(value, list) for function in value]
    return sorted(f"{function.__module__}.{function.__name__}" for function in functions)


def brightness(picture: str) -> float:
    """Render the scene small and return the mean of all channels."""
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 24
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 4, False, False
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = picture
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(picture, check_existing=False)
    mean = sum(image.pixels) / len(image.pixels)
    bpy.data.images.remove(image)
    return mean


def files_of(folder: Path) -> list[str]:
    """Every file of the installed extension, except Python's own cache."""
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*") if "__pycache__" not in file.parts)


def use(flake_map: str, blend: str) -> dict:
    """Add the material to a cube, save, prepare twice."""
    bpy.ops.wm.read_factory_settings(use_empty=False)
    enable()
    bpy.context.scene.render.engine = "CYCLES"
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    bpy.ops.glint.add_material(filepath=flake_map)
    bpy.ops.glint.prepare()
    state = bpy.context.scene.glint
    baked = [line.name for line in state.tables if line.detail == "baked"]
    addon = sys.modules[f"{MODULE}.glint_addon"]
    return {
        "material": bpy.context.object.active_material.name,
        "osl": bpy.context.scene.cycles.shading_system,
        "baked": baked,
        "baked_again": addon.prepare_scene(bpy.context.scene)["baked"],
        "brightness": brightness(blend.replace(".blend", ".exr")),
    }


def enable():
    """Enable the installed extension for this process."""
    bpy.ops.preferences.addon_enable(module=MODULE)


def main():
    """Install, use, disable, remove."""
    archive, flake_map, blend = sys.argv[1:]
    bpy.ops.wm.read_factory_settings(use_empty=False)
    before = blender_state()
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=False)
    folder = Path(bpy.utils.user_resource("EXTENSIONS")) / "user_default" / "glint"
    facts = {"state_before": before, "files_before": files_of(folder)}
    facts |= use(flake_map, blend)
    facts["enabled"] = MODULE in bpy.context.preferences.addons
    facts["files_after"] = files_of(folder)
    bpy.ops.preferences.addon_disable(module=MODULE)
    facts["state_after"] = blender_state()
    facts["brightness_after"] = brightness(blend.replace(".blend", ".exr"))
    bpy.ops.extensions.package_uninstall(repo_index=repository_index(), pkg_id="glint")
    facts["folder_left"] = folder.exists()
    return facts


def repository_index() -> int:
    """Where the repository of installed files is in Blender's list."""
    names = [repo.module for repo in bpy.context.preferences.extensions.repos]
    return names.index("user_default")


@contextlib.contextmanager
def quiet():
    """Blender's own words go to standard error, so that standard output is the result alone."""
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)


if __name__ == "__main__":
    with quiet():
        result = main()
    print(json.dumps(result))
