"""The command line: results on standard output, one sentence and exit code 1 for what cannot be done, 2 for misuse."""

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from glint_addon import cli
from glint_addon.images import image_pixels
from glint_addon.shading_system import LEFT_OFF
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def blend(scene, registered, tmp_path) -> Path:
    """A saved file: a plane with a Glint material, a sun and a camera."""
    scene = cycles.empty_scene(size=(16, 16))
    plane = cycles.add_plane(scene)
    bpy.context.view_layer.objects.active = plane
    bpy.ops.glint.add_material(filepath=str(write_flake_map(tmp_path / "flakes.png")))
    cycles.add_sun(scene, (0, 0, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 3))
    file = tmp_path / "glints.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    return file


def run(capfd, *words) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command in this process."""
    capfd.readouterr()
    code = cli.main([str(word) for word in words])
    output, errors = capfd.readouterr()
    return code, output, errors


def refused(capfd, *words) -> str:
    """The sentence with which a command refuses."""
    code, output, errors = run(capfd, *words)
    assert code == 1 and output == ""
    sentence = next(line for line in errors.splitlines() if line.startswith("glint: "))
    assert sentence.endswith(".") and "Traceback" not in errors
    return sentence


def test_prepare_saves_what_it_found(capfd, blend):
    code, output, errors = run(capfd, "prepare", blend)
    assert code == 0, errors
    # 32 texels over a few of 16 pixels: the index of the middle distance is baked beside the table.
    summary, counts, saved = output.splitlines()
    assert (summary, saved) == ("Glint: 1 light found, 2 tables baked, 0 reused, OSL on.", f"Saved {blend}")
    assert re.fullmatch(r"Tables: 2 baked \((.+ MB)\), 2 in use \(\1\), 1 image read\.", counts), counts
    assert "%]" in errors
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert bpy.context.scene.glint.prepared and bpy.context.scene.cycles.shading_system
    assert [file.suffix for file in (blend.parent / "glint_tables").iterdir()] == [".exr"] * 2


def test_prepare_again_bakes_nothing(capfd, blend):
    run(capfd, "prepare", blend)
    assert "0 tables baked, 2 reused" in run(capfd, "prepare", blend)[1]


def test_interrupted_while_baking_nothing_has_changed(capfd, blend, monkeypatch):
    """Ctrl-C comes once the pixels are read; the next report of progress ends the bake."""

    def read(image):
        signal.raise_signal(signal.SIGINT)
        return image_pixels(image)

    monkeypatch.setattr("glint_addon.map_tables.image_pixels", read)
    content, before = blend.read_bytes(), signal.getsignal(signal.SIGINT)
    assert "Stopped with Ctrl-C: nothing has changed" in refused(capfd, "prepare", blend)
    assert blend.read_bytes() == content and not (blend.parent / "glint_tables").exists()
    assert signal.getsignal(signal.SIGINT) == before
    assert not bpy.context.scene.glint.prepared


def test_info_tells_materials_and_lights_before_and_after(capfd, blend):
    content = blend.read_bytes()
    code, output, _ = run(capfd, "info", blend)
    assert code == 0
    lines = ["Material Glint flakes: map flakes.png, table not baked", "Scene Scene: not prepared"]
    assert output.splitlines() == lines
    assert blend.read_bytes() == content
    run(capfd, "prepare", blend)
    lines = run(capfd, "info", blend)[1].splitlines()
    assert "glint_tables" in lines[0] and lines[1] == "Scene Scene: OSL on, CPU, lights: Sun"


def test_info_advises_on_denoising_once_the_scene_is_prepared(capfd, blend):
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.context.scene.cycles.use_denoising = True
    bpy.ops.wm.save_mainfile()
    assert "Advice" not in run(capfd, "info", blend)[1]
    run(capfd, "prepare", blend)
    assert "Advice: Denoising by normals softens glints" in run(capfd, "info", blend)[1].splitlines()[-1]


def test_prepare_and_info_say_where_osl_is_of_no_use(capfd, blend):
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.data.objects.remove(bpy.data.objects["Sun"])
    bpy.context.scene.cycles.shading_system = False
    bpy.ops.wm.save_mainfile()
    for command in ("prepare", "info"):
        assert f"Note: {LEFT_OFF}" in run(capfd, command, blend)[1].splitlines()


def test_info_as_json_is_json_and_nothing_else(capfd, blend):
    facts = json.loads(run(capfd, "info", "--json", blend)[1])
    assert facts["materials"] == [{"name": "Glint flakes", "maps": [{"image": "flakes.png", "table": ""}]}]
    assert facts["scenes"][0]["prepared"] is False


def test_info_notices_that_a_table_was_deleted(capfd, blend):
    run(capfd, "prepare", blend)
    for table in (blend.parent / "glint_tables").iterdir():
        table.unlink()
    assert "table not baked" in run(capfd, "info", blend)[1]


@pytest.mark.parametrize("ending", ["png", "exr"])
def test_render_writes_the_picture_and_leaves_the_file_alone(capfd, blend, tmp_path, ending):
    content = blend.read_bytes()
    picture = tmp_path / "pictures" / f"glints.{ending}"
    code, output, errors = run(capfd, "render", blend, "--output", picture, "--samples", 2)
    assert code == 0, errors
    assert output.splitlines()[-1] == f"Rendered {picture}"
    assert cycles.read_image(picture).shape == (16, 16, 4)
    assert blend.read_bytes() == content


def test_render_without_output_writes_where_the_scene_says(capfd, blend, tmp_path):
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.context.scene.render.filepath = "//frames/"
    bpy.ops.wm.save_mainfile()
    code, output, _ = run(capfd, "render", blend, "--frame", 7)
    assert code == 0
    assert output.splitlines()[-1] == f"Rendered {tmp_path / 'frames' / '0007.png'}"
    assert (tmp_path / "frames" / "0007.png").is_file()


@pytest.mark.parametrize("command", ["prepare", "render", "info"])
def test_a_missing_file_is_named(capfd, registered, tmp_path, command):
    assert "gone.blend is not there" in refused(capfd, command, tmp_path / "gone.blend")


def test_a_file_that_is_no_blend_file_is_named(capfd, registered, tmp_path):
    file = tmp_path / "notes.blend"
    file.write_text("not a .blend", encoding="utf-8")
    assert f"cannot open {file}" in refused(capfd, "info", file)


def test_an_unknown_scene_is_refused_with_the_names_there_are(capfd, blend):
    assert 'no scene named "Other": choose one of Scene' in refused(capfd, "prepare", blend, "--scene", "Other")


def test_a_scene_without_camera_is_refused(capfd, blend):
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.data.objects.remove(bpy.context.scene.camera)
    bpy.ops.wm.save_mainfile()
    assert "has no camera" in refused(capfd, "render", blend)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--output", "picture.txt"), "does not end like a picture"),
        (("--samples", "0"), "give at least 1"),
    ],
)
def test_what_cannot_be_rendered_is_refused(capfd, blend, words, sentence):
    assert sentence in refused(capfd, "render", blend, *words)


def test_a_folder_that_cannot_be_written_is_one_sentence(capfd, blend, tmp_path):
    (tmp_path / "taken").write_text("a file where the folder should be", encoding="utf-8")
    assert str(tmp_path / "taken") in refused(capfd, "render", blend, "--output", tmp_path / "taken" / "a.png")


@pytest.mark.parametrize("words", [[], ["polish"], ["prepare"], ["render", "a.blend", "--samples", "many"]])
def test_misuse_exits_with_2_and_says_how_it_is_used(capfd, registered, words):
    code, output, errors = run(capfd, *words)
    assert code == 2 and output == "" and "usage: blender --command glint" in errors


def test_help_exits_with_0(capfd, registered):
    code, output, _ = run(capfd, "--help")
    assert code == 0 and "prepare" in output and "render" in output and "info" in output


def test_python_m_does_the_same_in_a_process_of_its_own(blend):
    command = [sys.executable, "-m", "glint_addon"]
    done = subprocess.run([*command, "prepare", blend], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == f"Saved {blend}"
    failed = subprocess.run([*command, "info", "gone.blend"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (failed.returncode, failed.stdout) == (1, "")
    assert failed.stderr.splitlines()[-1] == "glint: gone.blend is not there: check the path and try again."
