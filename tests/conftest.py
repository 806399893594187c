"""One Blender for the whole run, away from the user's own settings; each test file starts with an empty scene."""

import os
import tempfile

import pytest

# Before bpy is imported: Blender reads its folders once.
_HOME = tempfile.TemporaryDirectory(prefix="glint-tests-")
os.environ["BLENDER_USER_RESOURCES"] = _HOME.name

import bpy  # noqa: E402, F401  (needs the environment above, and comes before any other module of Blender)

import glint_addon  # noqa: E402
from tests.helpers.cycles import empty_scene  # noqa: E402
from tests.helpers.stress_report import (  # noqa: E402, F401  (pytest finds hooks and fixtures by their names)
    pytest_addoption,
    pytest_configure,
    stress_record,
)


def pytest_unconfigure():
    """Remove the temporary user folder."""
    _HOME.cleanup()


@pytest.fixture(scope="module", autouse=True)
def _empty_file_for_each_module():
    """No data-block leaks from one test file into the next."""
    empty_scene()


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
