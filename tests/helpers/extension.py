"""What the tests of operators, panel, command line and package share: a map file, a snapshot of the file's data."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
import pytest

MAP_SIZE = 32  # texels; small enough that baking takes no time
MAP_TILT = 0.3  # standard deviation of the slopes: most facets turn away from a light overhead
SEED = 7


def write_flake_map(file: Path, size: int = MAP_SIZE) -> Path:
    """Write a PNG normal map of independent random facets, OpenGL convention; returns its path."""
    slopes = np.random.default_rng(SEED).normal(0.0, MAP_TILT, (size, size, 2))
    normals = np.dstack([-slopes, np.ones((size, size))])
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    pixels = np.dstack([normals * 0.5 + 0.5, np.ones((size, size))]).astype(np.float32)
    image = bpy.data.images.new("Written map", size, size)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(pixels.ravel())
        image.filepath_raw = str(file)
        image.file_format = "PNG"
        image.save()
    finally:
        bpy.data.images.remove(image)
    return file


def data_names() -> dict[str, list[str]]:
    """Names of all data-blocks of the open file, by kind, with their number of users."""
    kinds = (name for name in dir(bpy.data) if isinstance(getattr(bpy.data, name), bpy.types.bpy_prop_collection))
    return {kind: sorted(f"{block.name_full} ({block.users})" for block in getattr(bpy.data, kind)) for kind in kinds}


@contextmanager
def shader_editor(tree):
    """Within this block the context is a Shader Editor that shows `tree` (None: nothing); gives its space."""
    window = bpy.context.window
    area = window.screen.areas[0]
    kind = area.ui_type
    area.ui_type = "ShaderNodeTree"
    space = area.spaces.active
    space.pin = True
    space.node_tree = tree
    try:
        with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
            yield space
    finally:
        area.ui_type = kind


def refused(operator, **settings) -> str:
    """The sentence with which `operator` refuses; the file must not change meanwhile."""
    before = data_names()
    with pytest.raises(RuntimeError) as error:
        operator(**settings)
    assert data_names() == before
    sentence = str(error.value).strip().removeprefix("Error: ")
    assert sentence.endswith(".") and "\n" not in sentence and ": " in sentence, sentence
    return sentence
