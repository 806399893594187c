"""Whatever state a file or Blender is in: Glint works, or says in one sentence why not and what to do."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

from glint_addon import changes_since_prepared, prepare_scene
from glint_addon.cli import command as cli
from glint_addon.errors import GlintError
from glint_addon.nodes.glint_bsdf import OWN_NODES
from glint_addon.nodes.glint_lights import KIND_LOCAL, KIND_NONE, KIND_SUN
from glint_addon.nodes.scene_lights import PARTS, SHAPE
from glint_addon.operators.change_map import GLINT_OT_change_map
from glint_addon.operators.map_settings import MapSettings
from glint_addon.prepare import watch
from glint_addon.prepare.changes import table_states
from glint_addon.ui import menus
from glint_addon.ui.lights_panel import GLINT_PT_lights
from glint_addon.ui.panel import GLINT_PT_material, GLINT_PT_tables
from tests.helpers.extension import shader_editor, write_flake_map
from tests.helpers.panel import Layout, panel_context, words_of
from tests.helpers.states import STATES, group, save_start
from tests.helpers.stress_marks import thinned

OFF = "Cycles is switched off: switch it on in Preferences > Add-ons."
PANELS = (GLINT_PT_material, GLINT_PT_lights, GLINT_PT_tables)
# Where preparing does not tell what a render does: it takes a second each.
RENDERED = (
    "no_world", "a_camera_object_that_is_no_camera", "everything_excluded", "all_view_layers_off",
    "a_missing_linked_scene_is_shown", "the_active_object_is_a_hair_with_glints", "the_mesh_has_no_faces",
    "the_mesh_has_no_uv_map", "the_script_was_emptied", "the_lights_group_was_removed",
    "the_arrays_of_the_lights_are_too_short", "tables_are_damaged",
)
# What preparing mends by itself.
KEPT = ("the_holder_of_the_lights", "the_arrays_of_the_lights", "what_was_prepared")  # by Glint
MENDED = (
    *(name for name in STATES if name.startswith(KEPT)), "as_prepared",
    "the_group_lost_its_node_glint", "the_group_lost_its_node_lights",
    "the_group_lost_its_node_caustics", "the_group_lost_its_node_uv_map", "the_group_lost_its_node_osl_or_native",
    "the_script_was_emptied", "the_group_lost_its_properties", "the_properties_of_the_group_are_of_other_types",
    "the_stamp_of_the_group_is_a_text", "the_group_is_of_version_9", "the_group_is_of_a_later_version",
    "the_lights_group_was_removed", "tables_are_gone", "tables_are_damaged", "the_plane_is_squashed_flat",
    "an_object_without_users", "a_camera_object_that_is_no_camera",
)


@pytest.fixture(scope="module")
def start(tmp_path_factory) -> Path:
    """The folder of the file that all states begin with."""
    import glint_addon

    glint_addon.register()
    try:
        return save_start(tmp_path_factory.mktemp("start")).parent
    finally:
        glint_addon.unregister()


@pytest.fixture(params=STATES)
def found(request, start, registered, tmp_path, capfd):
    """The open file in one of the states; nothing may write a traceback meanwhile, in handlers neither."""
    folder = tmp_path / "project"
    shutil.copytree(start, folder)
    bpy.ops.wm.open_mainfile(filepath=str(folder / "start.blend"))
    STATES[request.param]()
    capfd.readouterr()
    yield folder
    output, errors = capfd.readouterr()
    assert "Traceback" not in output + errors, output + errors
    assert "Error: Python" not in output + errors


def says_why(sentence: str) -> bool:
    """Whether this is a sentence with the thing, the cause and the next step."""
    return sentence.endswith(".") and ": " in sentence and "\n" not in sentence


def softly(work, *arguments, **settings):
    """Do it; what Glint refuses it refuses with a sentence."""
    try:
        return work(*arguments, **settings)
    except GlintError as error:
        assert says_why(str(error)), error
        return None


def press(operator, **settings):
    """Run an operator where its button is not grey; errors must be one sentence of Glint's."""
    if not operator.poll():
        return
    try:
        operator(**settings)
    except RuntimeError as error:
        words = str(error).strip()
        assert words.startswith("Error: ") and says_why(words), words


def draw_all():
    """Draw panels and menus where Blender would."""
    for panel in PANELS:
        if panel.poll(panel_context()):
            assert all(isinstance(word, str) for word in words_of(panel))
    for draw in (menus.draw_inputs, menus.draw_shaders, menus.draw_textures):
        draw(SimpleNamespace(layout=Layout()), bpy.context)


def look():
    """All that happens without a click."""
    draw_all()
    scene = bpy.context.scene
    assert all(sentence.endswith(".") for sentence in changes_since_prepared(scene))
    table_states(scene)
    watch.look_at(scene)
    draw_all()


def test_panels_and_looks(found):
    look()


def test_preparing_twice(found):
    for _ in range(2):
        report = softly(prepare_scene, bpy.context.scene)
        if report is not None:
            assert all(map(says_why, report["warnings"])), report["warnings"]
        look()


@pytest.mark.parametrize("found", MENDED, indirect=True)
def test_what_can_be_mended_is_whole_after_preparing(found):
    scene = bpy.context.scene
    report = prepare_scene(scene)
    assert report["hints"] == ["Lamp", "Sun"] and report["osl"]
    assert changes_since_prepared(scene) == [] and not any(table_states(scene).values())
    bpy.context.view_layer.update()
    kinds = [list(scene["glint_lights"]["lights_1"])[slot * PARTS + SHAPE] for slot in range(3)]
    assert is_whole(group()) and kinds == [KIND_LOCAL, KIND_SUN, KIND_NONE]
    nodes = group().nodes
    assert nodes["OSL or native"].outputs[0].is_linked and nodes["Glint"].inputs["Table"].default_value
    assert prepare_scene(scene)["baked"] == []


LOST = [name for name in MENDED if name.startswith(KEPT[:2])]


@pytest.mark.parametrize("found", LOST, indirect=True)
def test_lost_lights_are_told(found):
    lost = "What glints look for in this scene was deleted."
    assert lost in changes_since_prepared(bpy.context.scene)
    prepare_scene(bpy.context.scene)
    assert lost not in changes_since_prepared(bpy.context.scene)


def is_whole(tree) -> bool:
    """Whether a Glint BSDF group has all its nodes, and its shader is compiled."""
    return set(OWN_NODES) <= set(tree.nodes.keys()) and tree.nodes["Glint"].bytecode != ""


def test_operators(found):
    ops, picked = bpy.ops.glint, write_flake_map(found / "other.png", 8)
    press(ops.prepare)
    press(ops.keep_glints)
    if ops.change_map.poll():
        softly(GLINT_OT_change_map.invoke, dialog(), dialog_context(), None)
    press(ops.change_map, image="flakes.png")
    press(ops.change_map, filepath=str(picked))
    press(ops.change_map)
    press(ops.add_material)
    press(ops.add_material, filepath=str(picked), uv_map="UVMap")
    press(ops.prepare)
    thing = bpy.context.object
    shown = thing.active_material if thing else None
    with shader_editor(shown.node_tree if shown else None):
        press(ops.add_node_group, group="Glint BSDF")
    look()


def dialog():
    """The operator as Blender calls it for a dialog; it makes operators itself, so that here one stands in."""
    operator = SimpleNamespace()
    operator.start_from = lambda binding: MapSettings.start_from(operator, binding)
    return operator


def dialog_context():
    """The Material tab, with a window manager that shows no dialog."""
    context = panel_context()
    context.window_manager = SimpleNamespace(invoke_props_dialog=lambda *_, **__: {"RUNNING_MODAL"})
    return context


def test_saving_and_appending(found):
    for name in ("again.blend", "elsewhere/moved.blend"):
        (found / name).parent.mkdir(exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(found / name))
    look()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(str(found / "elsewhere" / "moved.blend")) as (there, wanted):
        wanted.materials, wanted.objects = there.materials, there.objects
        wanted.scenes = there.scenes
    look()


def test_commands(found, capfd):
    file = found / "state.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    for words in (["info"], ["info", "--json"], ["prepare"]):
        run_command(capfd, *words, str(file))


@pytest.mark.parametrize("found", thinned(RENDERED, RENDERED[-2:], "a render of every state"), indirect=True)
def test_rendering(found, capfd):
    file = found / "state.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    run_command(capfd, "render", "--samples", "1", str(file), "--output", str(found / "picture.png"))


def run_command(capfd, *words):
    """Run a command; what it refuses it refuses with a sentence."""
    capfd.readouterr()
    code = cli.main(list(words))
    told = capfd.readouterr().err
    assert code in (0, 1) and "Traceback" not in told and "Error: Python" not in told, told
    if code == 1:
        sentence = next(line for line in told.splitlines() if line.startswith("glint: "))
        assert says_why(sentence.removeprefix("glint: ")), sentence


def test_with_cycles_switched_off_all_works_that_can(start, tmp_path):
    folder = tmp_path / "project"
    shutil.copytree(start, folder)
    script = Path(__file__).parents[1] / "helpers" / "without_cycles.py"
    ended = subprocess.run([sys.executable, str(script), str(folder)], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0 and "Traceback" not in ended.stdout + ended.stderr, ended.stdout + ended.stderr
    told = json.loads((folder / "told.json").read_text(encoding="utf-8"))
    assert OFF in told["panel"] and OFF in told["panel_of_an_empty_file"] and "Glints:" not in told["panel"]
    for action in ("prepare_scene", "prepare", "command_prepare", "command_render"):
        assert told[action] == f"{OFF.removesuffix('.')} and try again.", action
    for action in ("changes", "lost_tables"):
        assert told[action] == []
    for action in ("add_material", "change_map", "add_node_group", "command_info", "prepare_with_cycles_again"):
        assert told[action] == "done", action
