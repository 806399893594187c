"""Several pictures of a scene, each with noise of its own, for one start of the renderer."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np

from benchmarks.passes import seed_views
from tests.helpers.cycles import read_image, rendered


def rendered_seeds(scene, spp, count) -> np.ndarray:
    """`count` pictures of `scene` at `spp` samples a pixel: (count, height, width, 4), as `cycles.rendered` gives them.

    The first is that of seed 0. They are views of one camera, which Cycles renders with different seeds without
    compiling the shaders again, half a second to one that a render of its own would cost. A scene that shows several
    views by itself gets renders of the seeds 0, 1, ...
    """
    scene.cycles.samples = spp
    scene.cycles.seed = 0
    if not scene.render.use_multiview and count > 1:
        return _views(scene, count)
    pictures = []
    for seed in range(count):
        scene.cycles.seed = seed
        pictures.append(rendered(scene))
    return np.stack(pictures)


def _views(scene, count):
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    settings.exr_codec, settings.views_format = "ZIP", "INDIVIDUAL"
    with seed_views(scene.render, count) as suffixes, tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "render.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        return np.stack([read_image(Path(folder) / f"render{suffix}.exr") for suffix in suffixes])
