"""farm/glint.openjd.yaml as on a farm: prepared once, then frames in plain Blender without the extension."""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
import yaml

from glint_addon.cli import command as cli
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

ROOT = Path(__file__).resolve().parents[2]
TEMPLATE = ROOT / "farm" / "glint.openjd.yaml"
STAND_IN = ROOT / "tests" / "helpers" / "blender_stand_in.py"
FRAMES, CHUNK = 3, 2  # the second chunk is shorter: it must end with the last frame
SAME_PICTURE = 1e-5  # two renders with one seed differ only by the order of summing


@pytest.fixture
def shot(scene, registered, tmp_path) -> Path:
    """A saved file of three frames: a plane of glints under a sun that turns."""
    scene = cycles.empty_scene(size=(16, 16), spp=2)
    plane = cycles.add_plane(scene)
    bpy.context.view_layer.objects.active = plane
    folder = tmp_path / "scene folder"
    folder.mkdir()
    bpy.ops.glint.add_material(filepath=str(write_flake_map(folder / "flakes.png")))
    sun = cycles.add_sun(scene, (0, 0, 1), angle=0.01)
    for frame in (1, FRAMES):
        sun.rotation_euler.x = 0.1 * frame
        sun.keyframe_insert("rotation_euler", frame=frame)
    cycles.add_camera(scene, (0, 0, 3))
    scene.frame_start, scene.frame_end, scene.frame_step = 1, FRAMES, 2  # the job's own frames count, not these
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    file = folder / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    return file


def openjd(*words, folder) -> subprocess.CompletedProcess:
    """Run the command `openjd`, which keeps its own files in `folder`."""
    command = [Path(sys.executable).parent / "openjd", *map(str, words)]
    environment = {**os.environ, "TMPDIR": str(folder)}
    return subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=False)


def job(values: dict) -> list:
    """Words that give the template's parameters `values`."""
    return ["run", TEMPLATE, *(word for name, value in values.items() for word in ("-p", f"{name}={value}"))]


def stand_in(kind: str, file: Path) -> Path:
    """A program `file` that takes Blender's arguments; kind: "extension" or "plain"."""
    words = shlex.join([sys.executable, "-P", str(STAND_IN), kind])
    file.write_text(f'#!/bin/sh\nexec {words} "$@"\n', encoding="utf-8")
    file.chmod(0o755)
    return file


def test_a_job_prepares_once_and_renders_chunks_without_the_extension(capfd, shot, tmp_path):
    """Slow: three Blenders one after the other, and each frame compiles the shader, on the farm and here."""
    content = shot.read_bytes()
    pictures = tmp_path / "pictures"
    values = {
        "SceneFolder": shot.parent, "SceneName": shot.stem, "OutputFolder": pictures,
        "FirstFrame": 1, "LastFrame": FRAMES, "ChunkSize": CHUNK,
        "BlenderWithGlint": stand_in("extension", tmp_path / "blender with glint"),
        "Blender": stand_in("plain", tmp_path / "plain blender"),
    }
    done = openjd(*job(values), folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]

    # Two tasks rendered all frames between them, and neither had the extension.
    facts = [json.loads(line[line.index("{"):]) for line in done.stdout.splitlines() if '"plain"' in line]
    assert [task["frames"] for task in facts] == [[1, CHUNK], [CHUNK + 1, FRAMES]]
    assert not any(task["extension"] for task in facts)
    assert [file.name for file in sorted(pictures.iterdir())] == [f"{frame:04}.exr" for frame in range(1, FRAMES + 1)]

    # The scene's own file is as it was; tables and the prepared copy lie beside it.
    assert shot.read_bytes() == content
    assert {"glint_tables", "shot_prepared.blend"} < {file.name for file in shot.parent.iterdir()}

    # Each picture is the one that a direct render makes, and no two are alike.
    direct = tmp_path / "direct"
    code = cli.main(["render", str(shot), "--frames", f"1-{FRAMES}", "--output", f"{direct}/"])
    assert code == 0, capfd.readouterr().err
    farm, here = ([cycles.read_image(folder / f"{frame:04}.exr") for frame in range(1, FRAMES + 1)]
                  for folder in (pictures, direct))
    np.testing.assert_allclose(farm, here, rtol=SAME_PICTURE, atol=SAME_PICTURE)
    assert all(np.abs(first - second).max() > 0.01 for first, second in zip(farm, farm[1:], strict=False))


def test_a_scene_that_cannot_be_prepared_ends_the_job_before_any_frame(shot, tmp_path):
    shot.write_text("no .blend file", encoding="utf-8")
    values = {"SceneFolder": shot.parent, "SceneName": shot.stem, "OutputFolder": tmp_path / "pictures",
              "BlenderWithGlint": stand_in("extension", tmp_path / "glint"), "Blender": "false"}
    done = openjd(*job(values), folder=tmp_path)
    assert done.returncode != 0
    assert "glint: Blender cannot open" in done.stdout and "ChunkStart" not in done.stdout


def test_the_template_says_what_goes_in_and_comes_out(tmp_path):
    assert openjd("check", TEMPLATE, folder=tmp_path).returncode == 0
    template = yaml.safe_load(TEMPLATE.read_text(encoding="utf-8"))
    flows = {item["name"]: item["dataFlow"] for item in template["parameterDefinitions"] if item["type"] == "PATH"}
    # Tables and the prepared copy are written to the scene's folder by one step and read from it by the next.
    assert flows == {"SceneFolder": "INOUT", "OutputFolder": "OUT"}
    assert template["steps"][1]["dependencies"] == [{"dependsOn": "Prepare"}]
