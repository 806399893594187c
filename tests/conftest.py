"""One Blender for the whole run, away from the user's own settings; each test file starts with an empty scene."""

import os
import tempfile

import pytest

# Before bpy is imported: Blender reads its folders once.
_HOME = tempfile.TemporaryDirectory(prefix="glint-tests-")
os.environ["BLENDER_USER_RESOURCES"] = _HOME.name

import bpy  # noqa: E402  (needs the environment above)


def pytest_unconfigure():
    """Remove the temporary user folder."""
    _HOME.cleanup()


@pytest.fixture(scope="module", autouse=True)
def _empty_file_for_each_module():
    """No data-block, handler or registered class leaks from one test file into the next."""
    _start_empty()


@pytest.fixture
def scene():
    """The only scene of an empty file: Cycles on the CPU, one sample, seed 0, no denoising, no adaptive sampling."""
    return _start_empty()


def _start_empty():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 1
    scene.cycles.seed = 0
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    return scene
