"""Stands in for the program `blender` on a farm: pip's bpy, given that program's own arguments.

    python -P blender_stand_in.py extension --command glint prepare FILE.blend
    python -P blender_stand_in.py plain --background FILE.blend --render-output PATH --python-expr TEXT --render-anim

"plain" finds no extension: -P keeps this folder off the path. It prints what it rendered as a line of JSON.
"""

import json
import sys
from pathlib import Path


def with_extension(arguments):
    """`blender --command glint ...` of a Blender with the extension; returns the exit code."""
    command, name, *rest = arguments
    assert (command, name) == ("--command", "glint"), arguments
    import bpy  # noqa: F401  (Blender's other modules are found only after it)

    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    import glint_addon
    from glint_addon.cli import command as cli

    glint_addon.register()
    return cli.main(rest)


def plain(arguments):
    """Do what Blender does for each of `arguments`, in their order."""
    import bpy

    rest = iter(arguments)
    for word in rest:
        if word in ("-b", "--background"):
            bpy.ops.wm.open_mainfile(filepath=next(rest))
        elif word in ("-o", "--render-output"):
            bpy.context.scene.render.filepath = next(rest)
        elif word == "--python-exit-code":
            next(rest)  # an exception ends Python with 1 anyway
        elif word == "--python-expr":
            exec(next(rest), {"__name__": "__main__"})
        elif word in ("-a", "--render-anim"):
            bpy.ops.render.render(animation=True)
            print(json.dumps(facts(bpy.context.scene)), flush=True)
        else:
            raise ValueError(f"Blender's argument {word} is not stood in for")
    return 0


def facts(scene):
    """What a task rendered, and whether any of the extension was there."""
    loaded = any("glint_addon" in name for name in sys.modules) or hasattr(scene, "glint")
    return {"plain": True, "frames": [scene.frame_start, scene.frame_end], "extension": loaded}


if __name__ == "__main__":
    kind, *given = sys.argv[1:]
    sys.exit({"extension": with_extension, "plain": plain}[kind](given))
