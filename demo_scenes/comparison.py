"""Blender's nodes at equal time, the lobe, the truth: one comparison scene rendered, measured, shown side by side."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import glint_addon

from . import maps, measure, picture, stage
from .stored_truth import stored_truth
from .truth import truth_material

SIZE = (96, 96)  # pixels: small enough that three minutes suffice, large enough to see
SCALE = 4  # each pixel is shown as 4 x 4
PILOT_SPP = 32  # a first look at the cost of a sample of Blender's nodes
SECOND_PILOT = 0.25  # of the wanted time: few samples cost more each, so the first look alone would give too few


@dataclass(frozen=True)
class Measurement:
    """One line of the table; seconds without start-up, rmse and bias relative to the truth's mean luminance."""

    picture: str
    method: str
    spp: int
    seconds: float
    rmse: float
    bias: float


def compare(scene_module, out: Path) -> list[Measurement]:
    """Render one scene with the lobe and, in the same time, with Blender's nodes; write `out`/NAME.png.

    A scene module has NAME, TITLE, SPP (of the lobe), TRUTH_SPP, EXPOSURE (of the picture), SURFACE (arguments of
    `create_glint_material`), `normal_map()` and `build(scene, material)`.
    """
    name, truth = scene_module.NAME, stored_truth(scene_module.NAME)
    lobe_pixels, lobe_seconds, bake_seconds = lobe_render(scene_module)
    nodes_pixels, nodes_seconds, nodes_spp = nodes_render(scene_module, lobe_seconds)

    def measured(method, pixels, spp, seconds):
        rmse, bias = measure.relative_rmse(pixels, truth.pixels), measure.bias(pixels, truth.pixels)
        return Measurement(name, method, spp, seconds, rmse, bias)

    rows = [
        measured("Blender's nodes", nodes_pixels, nodes_spp, nodes_seconds),
        measured("Glint", lobe_pixels, scene_module.SPP, lobe_seconds),
        Measurement(name, "truth (its own noise)", truth.spp, float("nan"), truth.noise, 0.0),
    ]
    labels = [f"{row.method}, {row.spp} spp, {row.seconds:.1f} s\nerror {row.rmse:.1%}" for row in rows[:2]]
    labels.append(f"Truth: Blender's nodes, {truth.spp} spp\nits own noise {truth.noise:.1%}")
    panels = list(zip(labels, (nodes_pixels, lobe_pixels, truth.pixels), strict=True))
    title = f"{scene_module.TITLE} (table baked in {bake_seconds:.1f} s)"
    picture.save_side_by_side(out / f"{name}.png", panels, title=title, scale=SCALE, exposure=scene_module.EXPOSURE)
    return rows


def scene_of(scene_module, make_material, spp, size=SIZE):
    """The module's scene in the material `make_material(name, image, **surface)` of its map, `spp` samples a pixel."""
    scene = stage.empty_scene(size, spp)
    image = maps.blender_image("Normal map", scene_module.normal_map())
    scene_module.build(scene, make_material("Surface", image, **scene_module.SURFACE))
    return scene


def lobe_render(scene_module):
    """(pixels, seconds without start-up, seconds to bake) of the glint material at the module's SPP."""
    scene = scene_of(scene_module, glint_addon.create_glint_material, scene_module.SPP)
    start = time.perf_counter()
    glint_addon.prepare_scene(scene)
    bake_seconds = time.perf_counter() - start
    start_up = measure.start_up_seconds(scene)
    pixels, seconds = measure.timed_render(scene)
    return pixels, max(seconds - start_up, 0.0), bake_seconds


def nodes_render(scene_module, seconds):
    """(pixels, seconds without start-up, spp) of Blender's own nodes at the spp that takes about `seconds`.

    Without Open Shading Language, where Blender's nodes are fastest.
    """
    scene = scene_of(scene_module, truth_material, PILOT_SPP)
    start_up = measure.start_up_seconds(scene)

    def timed(spp):
        scene.cycles.samples = spp
        pixels, total = measure.timed_render(scene)
        return pixels, max(total - start_up, measure.CLOCK_NOISE)

    spp = PILOT_SPP
    for share in (SECOND_PILOT, 1.0):
        spp = max(round(share * seconds / timed(spp)[1] * spp), 1)
    return *timed(spp), spp
