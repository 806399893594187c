"""Every pass of a render, read from multilayer EXRs."""

from __future__ import annotations

import tempfile
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from glint_addon.bake.openimageio import oiio

ORDER = "RGBXYZUVAW"  # of a pass's channels


def rendered_passes(scene, spp, count) -> dict[str, np.ndarray]:
    """Passes of the scene's first view layer by name, such as "Glossy Direct" or "Combined_Lamps".

    Arrays are (count, height, width, channels), float32, row 0 at the TOP as in the files: `count` renders at `spp`
    samples a pixel, each with a seed of its own (see `seed_views`).
    """
    scene.cycles.samples, scene.cycles.seed = spp, 0
    with seed_views(scene.render, count) as suffixes:
        renders = _rendered(scene, suffixes)
    return {name: np.stack([passes[name] for passes in renders]) for name in renders[0]}


def rendered_layer(scene) -> dict[str, np.ndarray]:
    """Passes of one render of the scene as it is, by name: (height, width, channels), float32, row 0 at the BOTTOM."""
    (passes,) = _rendered(scene, [""])
    return {name: pixels[::-1] for name, pixels in passes.items()}


@contextmanager
def seed_views(render, count):
    """Within this block `render` has `count` views alone, all of the scene's camera; gives their files' suffixes."""
    before = {view: view.use for view in render.views}
    suffixes = [f"_view{index}" for index in range(count)]
    for view in before:
        view.use = False
    for suffix in suffixes:
        view = render.views.new(suffix)
        # No camera has such a name, so each view takes the scene's own.
        view.file_suffix = view.camera_suffix = suffix
    render.use_multiview, render.views_format = True, "MULTIVIEW"
    try:
        yield suffixes
    finally:
        render.use_multiview = False
        for suffix in suffixes:
            render.views.remove(render.views[suffix])
        for view, was_used in before.items():
            view.use = was_used


def _rendered(scene, suffixes) -> list:
    """Passes of the views with these suffixes, [""] without views, as `_read` has them."""
    settings = scene.render.image_settings
    settings.media_type, settings.views_format = "MULTI_LAYER_IMAGE", "INDIVIDUAL"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    try:
        with tempfile.TemporaryDirectory() as folder:
            scene.render.filepath = str(Path(folder) / "passes.exr")
            bpy.ops.render.render(write_still=True, scene=scene.name)
            return [_read(str(Path(folder) / f"passes{suffix}.exr")) for suffix in suffixes]
    finally:
        settings.media_type = "IMAGE"


def _read(file):
    """Channels are named "layer.pass.letter"; the file has one part for all passes or one for each."""
    passes = {}
    for part in range(oiio.ImageBuf(file, 0, 0).nsubimages):
        image = oiio.ImageBuf(file, part, 0)
        pixels = np.asarray(image.get_pixels(oiio.FLOAT)).reshape(image.spec().height, image.spec().width, -1)
        for channel, full_name in enumerate(image.spec().channelnames):
            _, name, letter = full_name.rsplit(".", 2)
            passes.setdefault(name, {})[letter.upper()] = pixels[..., channel]
    return {
        name: np.dstack([letters[letter] for letter in sorted(letters, key=ORDER.index)])
        for name, letters in passes.items()
    }
