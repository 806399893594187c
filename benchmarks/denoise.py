"""`python -m benchmarks.denoise`: what OpenImageDenoise does to glints, of the lobe and of Blender's nodes.

A denoiser has seen pictures in which a single bright pixel is noise; in a picture of glints it is the truth. So each
scene of the suite is rendered at few samples, denoised with one setting after the other, and compared with its stored
truth: by its relative RMSE, and by how much light is left of the glints, the brightest pixels of the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from demo_scenes import measure, picture
from glint_addon.materials.find import is_glint_material

from . import suite
from .command import run_command
from .counters import counters
from .error import picture_error
from .record import RESULTS, ROOT, machine, machine_line
from .truth import stored

FILE = RESULTS / "denoise.json"
SHEETS = ROOT / "out"
# Close and far, dense and sparse glints; and a ball among diffuse things, which are what a denoiser is for.
SCENES = ("flakes_close", "flakes_middle", "flakes_far", "scratches_middle", "together")
SPP = 16
MORE_SPP = 64  # whether more samples save what the denoiser takes
BRIGHTEST = 0.01  # share of the truth's pixels that are its glints


@dataclass(frozen=True)
class Setting:
    """Of the denoiser, in Blender's own words; layer: settings of the view layer; spp: samples a pixel."""

    passes: str = "RGB_ALBEDO_NORMAL"
    prefilter: str = "ACCURATE"
    quality: str = "HIGH"
    layer: tuple[tuple[str, bool], ...] = ()
    spp: int = SPP


FIRST_SURFACE = (("denoising_pass_follow_reflections", False), ("denoising_pass_use_albedo_roughness_weighting", False))
DEFAULT, ALBEDO = "Blender's default", "colour and albedo"
SETTINGS = {
    DEFAULT: Setting(),
    "prefilter Fast": Setting(prefilter="FAST"),
    "prefilter None": Setting(prefilter="NONE"),
    ALBEDO: Setting("RGB_ALBEDO"),
    f"{ALBEDO}, prefilter None": Setting("RGB_ALBEDO", prefilter="NONE"),
    "colour alone": Setting("RGB"),
    "quality Fast": Setting(quality="FAST"),
    "passes of the first surface": Setting(layer=FIRST_SURFACE),
    "passes of the first surface, prefilter None": Setting(prefilter="NONE", layer=FIRST_SURFACE),
    f"default, {MORE_SPP} spp": Setting(spp=MORE_SPP),
}
OFF = "not denoised"
# Mixtures, as a compositor makes them of the noisy and the denoised picture.
BLEND, MASK = f"half {ALBEDO}, half not denoised", f"{ALBEDO}, but not the surface with glints"
OFF_MORE = f"not denoised, {MORE_SPP} spp"
NODES, LOBE = "Blender's nodes", "Glint"
OPEN = {NODES: suite.nodes_scene, LOBE: suite.lobe_scene}


def run(scenes=SCENES) -> dict:
    """Measure every scene and draw them into out/: {"machine", "spp", "scenes": see `scene_results`}."""
    return {"machine": machine(), "spp": SPP, "scenes": {name: scene_results(name) for name in scenes}}


def scene_results(name) -> dict:
    """{method: {way: {"rmse", "bias", "kept"}}} of one scene of the suite; see `row`. Draws out/denoise_NAME.png."""
    truth = stored(name)
    glints = glint_pixels(name)
    found = {method: ways(open_scene(name), glints) for method, open_scene in OPEN.items()}
    draw(name, found, truth)
    return {method: {way: row(pixels, truth) for way, pixels in pictures.items()} for method, pictures in found.items()}


def ways(scene, glints) -> dict:
    """Pictures (height, width, 3) of `scene` by the name of the way: as it is, denoised, and mixtures of both.

    glints: (height, width) bool, the pixels that one of the mixtures leaves alone.
    """
    pictures = {OFF: undenoised(scene, SPP), OFF_MORE: undenoised(scene, MORE_SPP)}
    pictures |= {name: denoised(scene, setting) for name, setting in SETTINGS.items()}
    pictures[BLEND] = (pictures[OFF] + pictures[ALBEDO]) / 2
    pictures[MASK] = np.where(glints[..., None], pictures[OFF], pictures[ALBEDO])
    return pictures


def undenoised(scene, spp) -> np.ndarray:
    scene.cycles.use_denoising, scene.cycles.samples = False, spp
    return measure.rendered(scene)


def denoised(scene, setting: Setting) -> np.ndarray:
    """`scene` by OpenImageDenoise with a setting, without adaptive sampling."""
    cycles, layer = scene.cycles, scene.view_layers[0].cycles
    cycles.use_denoising, cycles.denoiser, cycles.samples = True, "OPENIMAGEDENOISE", setting.spp
    cycles.denoising_input_passes = setting.passes
    cycles.denoising_prefilter, cycles.denoising_quality = setting.prefilter, setting.quality
    for name in dict(FIRST_SURFACE):
        layer.property_unset(name)
    for name, value in setting.layer:
        setattr(layer, name, value)
    return measure.rendered(scene)


def glint_pixels(name) -> np.ndarray:
    """(height, width) bool: where the camera of scene `name` sees the glint material."""
    scene = suite.lobe_scene(name)
    scene.cycles.shading_system = True  # counters are the shader's, which close views leave off
    slots = (slot for thing in scene.objects for slot in thing.material_slots)
    return counters(scene, next(slot.material for slot in slots if is_glint_material(slot.material))).seen


def row(pixels, truth) -> dict:
    """Against a Truth: relative "rmse" and "bias", and "kept", the light of its brightest pixels that is left."""
    shown = measure.luminance(pixels)
    error = picture_error(shown[np.newaxis], truth.mean, truth.variance)
    brightest = truth.mean >= np.quantile(truth.mean, 1.0 - BRIGHTEST)
    kept = float(shown[brightest].mean() / truth.mean[brightest].mean())
    return {"rmse": error.rmse, "bias": error.bias, "kept": kept}


def table(results) -> str:
    """The results of `run` as Markdown: error and light kept, a column for each scene."""
    names = tuple(results["scenes"])
    lines = ["| | | " + " | ".join(names) + " |", "| --- | --- |" + " ---: |" * len(names)]
    for method in OPEN:
        for way in (OFF, *SETTINGS, BLEND, MASK, OFF_MORE):
            rows = [results["scenes"][name][method][way] for name in names]
            cells = " | ".join(f"{each['rmse']:.3f}, {each['kept']:.0%}" for each in rows)
            lines.append(f"| {method} | {way} | {cells} |")
    note = (f"Relative RMSE, and light that is left of the truth's brightest {BRIGHTEST:.0%} of pixels; "
            f"{results['spp']} spp where nothing else is said. ")
    return "\n".join([*lines, "", note + machine_line(results["machine"])])


def draw(name, found, truth):
    """Nodes and lobe as they are and denoised, and the truth, side by side: out/denoise_NAME.png."""
    chosen = ((NODES, OFF), (NODES, DEFAULT), (LOBE, OFF), (LOBE, DEFAULT), (LOBE, ALBEDO))
    shown = [(f"{method}\n{way}", found[method][way]) for method, way in chosen]
    shown.append(("Truth", np.repeat(truth.mean[..., None], 3, axis=-1)))
    # Three times the mean is white: brighter glints clip, which loses nothing that is measured.
    exposure = 1.0 / (3.0 * truth.mean.mean())
    picture.save_side_by_side(SHEETS / f"denoise_{name}.png", shown, title=f"{name}, {SPP} spp", scale=4,
                              exposure=exposure)


if __name__ == "__main__":
    run_command("denoise", run, table, FILE)
