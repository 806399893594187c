"""The demo scenes three ways at the same samples: the OSL lobe, by nodes alone, and Blender's plain nodes."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np

import glint_addon

from . import measure, picture
from .comparison import SIZE, scene_of
from .stored_truth import stored_truth
from .truth import truth_material

NAME = "three_ways"
SCENES = ("flakes_far", "scratches_close", "brushed_far")
SPP = 64
SCALE = 2  # each pixel is shown as 2 x 2
WAYS = {"Glint, exact (OSL)": True, "Glint, by nodes": False, "Blender's plain nodes": None}


def draw(out: Path):
    """Write `out`/three_ways.png: a row for each scene, a column for each way, with its error."""
    rows = []
    for name in SCENES:
        scene_module = import_module(f".{name}", __package__)
        truth = stored_truth(name).pixels
        panels = []
        for way, osl in WAYS.items():
            pixels = rendered(scene_module, osl)
            panels.append((f"{way}\nerror {measure.relative_rmse(pixels, truth):.1%}", pixels))
        rows.append((f"{scene_module.TITLE}: {SPP} samples", panels, scene_module.EXPOSURE))
    picture.save_rows(out / f"{NAME}.png", rows, scale=SCALE)


def rendered(scene_module, osl: bool | None, size=SIZE, spp=SPP) -> np.ndarray:
    """A scene with Glint, through OSL or not, or with Blender's plain nodes where `osl` is None: (height, width, 4)."""
    scene = scene_of(scene_module, truth_material if osl is None else glint_addon.create_glint_material, spp, size)
    if osl is not None:
        glint_addon.prepare_scene(scene)
    scene.cycles.shading_system = bool(osl)
    return measure.rendered(scene)
