"""The seed figures: render the panels of one scene and write them side by side."""

from __future__ import annotations

from pathlib import Path

import glint_addon

from . import measure, picture, stage

SIZE = (256, 256)


def draw_figure(scene_module, out: Path):
    """Write `out`/NAME.png. A scene module has NAME, TITLE, SPP, DENOISE, `build(scene, ...)`, `panels(rendered)`."""

    def rendered(**options):
        scene = stage.empty_scene(SIZE, scene_module.SPP)
        scene.cycles.use_denoising = scene_module.DENOISE
        scene_module.build(scene, **options)
        glint_addon.prepare_scene(scene)
        scene.cycles.shading_system = True  # the checker's and the image's filters need it as glints do
        return measure.rendered(scene)

    picture.save_side_by_side(out / f"{scene_module.NAME}.png", scene_module.panels(rendered), title=scene_module.TITLE)
