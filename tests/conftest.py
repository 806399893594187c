"""One Blender for the whole run, away from the user's own settings; each test file starts with an empty scene."""

import os
import tempfile

import pytest

# Before bpy is imported: Blender reads its folders once.
_HOME = tempfile.TemporaryDirectory(prefix="glint-tests-")
os.environ["BLENDER_USER_RESOURCES"] = _HOME.name
# Most renders here are so small that they do little but compile the shader: 1.2 s of processor time by default, 0.95 s
# with the fewest passes over its code, which gives the same pixels; helpers/farm.py keeps the default and is compared
# with this bit by bit.
os.environ.setdefault("OSL_OPTIONS", "llvm_optimize=11")

import bpy  # noqa: E402, F401  (needs the environment above, and comes before any other module of Blender)

import glint_addon  # noqa: E402
from tests.helpers.compiled_shaders import keep_compiled_shaders  # noqa: E402
from tests.helpers.cycles import empty_scene  # noqa: E402
from tests.helpers.farm import Farm  # noqa: E402
from tests.helpers.stress_report import (  # noqa: E402, F401  (pytest finds hooks and fixtures by their names)
    pytest_addoption,
    pytest_configure,
    stress_record,
)

keep_compiled_shaders()


def pytest_unconfigure():
    """Remove the temporary user folder."""
    _HOME.cleanup()


@pytest.fixture(scope="module", autouse=True)
def _empty_file_for_each_module():
    """No data-block leaks from one test file into the next."""
    empty_scene()


@pytest.fixture(scope="session")
def farm():
    """A process of Blender without the add-on that renders saved files (see helpers/farm.py)."""
    with Farm() as running:
        yield running


@pytest.fixture
def scene():
    """The only scene of an empty file, set up for tiny Cycles renders."""
    return empty_scene()


@pytest.fixture
def registered(scene):
    """The extension, registered for one test in an empty file."""
    glint_addon.register()
    yield
    glint_addon.unregister()
