"""What Glint does where the user switched Cycles off in Preferences: python without_cycles.py FOLDER.

Opens start.blend of the folder (see `states.save_start`), and writes there told.json: of each action "done", or the
sentence that it ended with.
"""

import io
import json
import os
import sys
from contextlib import redirect_stderr
from pathlib import Path

FOLDER = Path(sys.argv[1])
# Before bpy is imported: Blender reads its folders once.
os.environ["BLENDER_USER_RESOURCES"] = str(FOLDER / "home")
sys.path[0] = str(Path(__file__).resolve().parent.parent.parent)  # not this folder, whose cycles.py is not Blender's

import bpy  # noqa: E402  (needs the lines above)

import glint_addon  # noqa: E402
from glint_addon import changes_since_prepared, prepare_scene  # noqa: E402
from glint_addon.cli import command as cli  # noqa: E402
from glint_addon.errors import GlintError  # noqa: E402
from glint_addon.prepare import watch  # noqa: E402
from glint_addon.prepare.changes import table_states  # noqa: E402
from glint_addon.ui.panel import GLINT_PT_material  # noqa: E402
from tests.helpers.extension import shader_editor, write_flake_map  # noqa: E402
from tests.helpers.panel import words_of  # noqa: E402


def outcome(work, *arguments, **settings) -> str:
    """ "done", or the sentence with which it ended."""
    try:
        work(*arguments, **settings)
    except (GlintError, RuntimeError) as error:
        return str(error).strip().removeprefix("Error: ")
    return "done"


def command(*words) -> str:
    """ "done", or the sentence with which a command ended."""
    told = io.StringIO()
    with redirect_stderr(told):
        code = cli.main([str(word) for word in words])
    return "done" if code == 0 else told.getvalue().strip().removeprefix("glint: ")


def panel() -> str:
    """All words of the panel."""
    watch.look_at(bpy.context.scene)
    return "\n".join(words_of(GLINT_PT_material, width=4000))


def add_node_group():
    """Add a Glint BSDF in the Shader Editor."""
    with shader_editor(bpy.context.object.active_material.node_tree):
        bpy.ops.glint.add_node_group(group="Glint BSDF")


def main():
    """All actions, one after the other."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.preferences.addon_disable(module="cycles")
    glint_addon.register()
    told = {"panel_of_an_empty_file": panel()}
    file, picked = FOLDER / "start.blend", write_flake_map(FOLDER / "other.png")
    bpy.ops.wm.open_mainfile(filepath=str(file))
    scene = bpy.context.scene
    assert not hasattr(scene, "cycles")
    told |= {"panel": panel(),
             "prepare_scene": outcome(prepare_scene, scene), "prepare": outcome(bpy.ops.glint.prepare),
             "changes": changes_since_prepared(scene),
             "lost_tables": [str(file) for file, wrong in table_states(scene).items() if wrong]}
    assert not bpy.ops.glint.keep_glints.poll()
    told["change_map"] = outcome(bpy.ops.glint.change_map, filepath=str(picked))
    told["add_material"] = outcome(bpy.ops.glint.add_material, filepath=str(picked))
    told["add_node_group"] = outcome(add_node_group)
    for word in ("info", "prepare", "render"):
        told[f"command_{word}"] = command(word, file)

    # What was made without Cycles is as good as any.
    bpy.ops.glint.change_map(filepath=str(picked))
    bpy.ops.preferences.addon_enable(module="cycles")
    told["prepare_with_cycles_again"] = outcome(bpy.ops.glint.prepare)
    (FOLDER / "told.json").write_text(json.dumps(told), encoding="utf-8")


main()
