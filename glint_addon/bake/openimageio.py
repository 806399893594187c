"""The one importer of OpenImageIO, `from .openimageio import oiio`, and the one opener of files to read with it.

The Blender application has it on its path. The pip module bpy carries it in a folder of its own that is not on the
path; that folder is found without importing bpy, so baking needs no Blender.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from ..errors import TableError

# Where the pip module keeps Python packages, by operating system: bpy/5.2/python/lib[/python3.13]/site-packages.
BUNDLED = ("*/python/lib/python*/site-packages", "*/python/lib/site-packages")


def bundled_folders() -> list[Path]:
    """Folders with the Python packages inside the pip module bpy; empty inside the Blender application."""
    spec = importlib.util.find_spec("bpy")
    roots = [Path(root) for root in (spec.submodule_search_locations or ())] if spec is not None else []
    return [folder for root in roots for pattern in BUNDLED for folder in sorted(root.glob(pattern))]


def imported(name: str = "OpenImageIO") -> ModuleType:
    """The module `name`, from the path or from inside bpy.

    Raises TableError if neither has it.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        sys.path.extend(str(folder) for folder in bundled_folders() if str(folder) not in sys.path)
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise TableError(f"{name} is missing from this Python: run Glint inside Blender or install bpy.") from error


OpenImageIO = oiio = imported()


@contextmanager
def opened(path):
    """OpenImageIO's reader of the file at `path` within this block, None if it cannot read it."""
    source = oiio.ImageInput.open(str(path))
    if source is None:
        oiio.geterror()  # else it is reported as another file's
    try:
        yield source
    finally:
        if source is not None:
            source.close()
