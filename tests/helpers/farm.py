"""A render farm: a Blender that has never seen the add-on opens saved files and renders frames of them.

One process serves all tests of a run: its start costs as much as a render.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import bpy

from tests.helpers.cycles import read_image

# Reads jobs, one JSON list a line; answers each with an empty line, or with the error as JSON, on the first standard
# output. Blender's own words go to standard error. It stands in its own folder, where there is no glint_addon to find.
_WORKER = """
import json, os, sys
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
import bpy

def render(blend, picture, frame):
    bpy.ops.wm.open_mainfile(filepath=blend)
    scene = bpy.context.scene
    scene.frame_set(frame)
    scene.render.filepath = picture
    bpy.ops.render.render(write_still=True)
    assert not any("glint_addon" in name for name in sys.modules)

for line in sys.stdin:
    answer = ""
    try:
        render(*json.loads(line))
    except Exception as error:
        answer = json.dumps(repr(error))
    print(answer, file=answers, flush=True)
"""


class Farm:
    """One process of Blender without the add-on, started by the first job; a context manager that ends it."""

    def __init__(self):
        self._stack = contextlib.ExitStack()
        self._process = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stack.close()

    def rendered(self, folder, frame=1):
        """Save the open file as `folder`/scene.blend and render a frame of it on the farm (see `picture_of`)."""
        blend = folder / "scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(blend))
        return self.picture_of(blend, frame)

    def picture_of(self, blend, frame=1):
        """A frame of a saved file, rendered on the farm: (height, width, 3) float32.

        Raises AssertionError with the farm's error.
        """
        picture = blend.with_name("alone.exr")
        process = self._process or self._started()
        print(json.dumps([str(blend), str(picture), frame]), file=process.stdin, flush=True)
        answer = process.stdout.readline()
        assert answer == "\n", answer or f"The farm ended:\n{self._words.read_text()[-2000:]}"
        return read_image(picture)[..., :3]

    def _started(self):
        folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="glint-farm-")))
        self._words = folder / "words.txt"
        # Blender's default compiling: the tests themselves compile with fewer passes (see conftest.py).
        environment = {name: value for name, value in os.environ.items() if name != "OSL_OPTIONS"}
        words = self._stack.enter_context(self._words.open("w"))
        self._process = self._stack.enter_context(subprocess.Popen(
            [sys.executable, "-c", _WORKER], cwd=folder, env=environment, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=words))
        return self._process
