"""`python -m benchmarks.dolly`: brightness from one texel a pixel to a million, and in a plane that recedes to there.

The mean luminance of the glint material at each step of dolly_scene.py against Blender's own nodes (dolly_truth.py),
for flakes and bumps, sharp facets and wider ones: relative error with its standard deviation, and the largest step from
one distance to the next, from which the truth's noise falls out. The footprint is that of SPP samples a pixel at every
step; near, where pixels are many, fewer samples are taken.

The receding plane is compared band by band from near to far, and drawn beside the truth into plots/dolly.png.
"""

from __future__ import annotations

import math

import bpy  # noqa: F401  (before the modules that need it)
import numpy as np

from demo_scenes import picture
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

from . import dolly_scene, dolly_truth
from .command import run_command
from .cost import pinned_samples
from .dolly_scene import STEPS, VARIANTS
from .query_scene import MAPS
from .record import RESULTS, ROOT, machine, machine_line

FILE = RESULTS / "dolly.json"
PICTURE = ROOT / "benchmarks" / "plots" / "dolly.png"
SPP = 16  # that the footprint is for, and the most that are taken: they tell the mean to a tenth of a percent
SEEDS = (1, 2)
# Samples of a picture at most: they tell the mean to a few tenths of a percent where few facets shine.
SAMPLES = {"sharp": 4_000_000, "soft": 600_000}
PICTURE_SPP = 64
GOAL = 0.01  # largest error of the mean, and about the smallest step of brightness that an eye sees
LARGEST_Z = 4.0  # standard deviations; one false alarm in 16,000 comparisons, of which a run makes 200
EXPOSURE = 0.3  # brightness of the picture's mean: glints above three times of it clip


def run(steps=STEPS) -> dict:
    """Measure all of it and draw the picture: {"machine", "spp", "curves", "receding"}; see `curve` and `receding`."""
    curves = [
        {"map": name, "variant": key, "alpha": variant.alpha, "sun_degrees": math.degrees(variant.sun_angle),
         **curve(name, key, steps)}
        for name in MAPS
        for key, variant in VARIANTS.items()
    ]
    pictures = {name: receding_pictures(name) for name in MAPS}
    truths = {name: dolly_truth.stored_receding(name) for name in MAPS}
    draw(pictures, truths)
    return {
        "machine": machine(),
        "spp": SPP,
        "curves": curves,
        "receding": {name: receding(pictures[name], truths[name]) for name in MAPS},
    }


def curve(name, key, steps=STEPS) -> dict:
    """The glint material at each step: {"truth_noise", "rows": [{"texels", "error", "deviation"}], "summary"}.

    error: of the mean, relative; deviation: its standard deviation without the truth's, "truth_noise".
    """
    truth = dolly_truth.stored_mean(name, key)
    scene = dolly_scene.dolly_scene(name, VARIANTS[key], glint_material)
    rows = []
    for step in steps:
        dolly_scene.show(scene, step)
        # At each distance: a far camera reaches other levels of the tables.
        report = prepare_scene(scene)
        if not report["hints"]:
            raise RuntimeError("The sun of the dolly got no hint, so there is nothing to measure.")
        with pinned_samples(SPP):
            found = dolly_truth.picture_mean(dolly_truth.pictures(scene, samples(step, key), SEEDS))
        rows.append({"texels": step.texels, "error": float(found.value / truth.value - 1.0),
                     "deviation": float(found.deviation / truth.value)})
    noise = float(truth.deviation / truth.value)
    return {"truth_noise": noise, "rows": rows, "summary": summary(rows, noise)}


def glint_material(image, **surface):
    """The material that is measured."""
    return create_glint_material("Glint", image, **surface)


def samples(step, key) -> int:
    """Samples a pixel, for at most about SAMPLES in the picture."""
    return max(1, min(SAMPLES[key] // step.side**2, SPP))


def summary(rows, truth_noise) -> dict:
    """The largest error and the largest step between neighbours, each with its deviation; and whether they are small.

    "within": no error exceeds GOAL by more than LARGEST_Z deviations; "steady": nor does a step.
    """
    errors = [(row["error"], math.hypot(row["deviation"], truth_noise)) for row in rows]
    changes = [(after["error"] - before["error"], math.hypot(after["deviation"], before["deviation"]))
               for before, after in zip(rows, rows[1:], strict=False)]
    error, step = max(errors, key=lambda pair: abs(pair[0])), max(changes, key=lambda pair: abs(pair[0]))
    return {
        "error": error[0], "error_deviation": error[1], "step": step[0], "step_deviation": step[1],
        "within": _are_small(errors), "steady": _are_small(changes),
    }


def _are_small(pairs):
    return all(abs(value) <= GOAL + LARGEST_Z * deviation for value, deviation in pairs)


def receding_pictures(name) -> np.ndarray:
    """Luminance (seeds, height, width) of the receding plane with map `name` in the glint material."""
    scene = dolly_scene.receding_scene(name, glint_material)
    prepare_scene(scene)
    return dolly_truth.pictures(scene, PICTURE_SPP, SEEDS)


def receding(pictures, truth) -> list[dict]:
    """Rows like those of `curve` for each band of a Receding truth, from near to far; the deviation has the truth's."""
    found = dolly_truth.band_means(pictures)
    texels = [float(np.median(band)) for band in np.array_split(dolly_scene.row_texels(), dolly_truth.BANDS)]
    errors = found.value / truth.bands.value - 1.0
    deviations = np.hypot(found.deviation, truth.bands.deviation) / truth.bands.value
    return [{"texels": count, "error": float(error), "deviation": float(deviation)}
            for count, error, deviation in zip(texels, errors, deviations, strict=True)]


def draw(pictures, truths):
    """Write PICTURE: the receding plane of each map, the glint material beside the truth."""
    panels = []
    for name, truth in truths.items():
        # Each map in its own light: one exposure would leave one of them dark.
        scale = EXPOSURE / truth.picture.mean()
        panels += [(f"{name}: Glint\n{PICTURE_SPP} spp", pictures[name][0] * scale),
                   (f"truth: Blender's\nnodes, {truth.spp} spp", truth.picture * scale)]
    gray = [(label, np.repeat(pixels[..., None], 3, axis=-1)) for label, pixels in panels]
    picture.save_side_by_side(PICTURE, gray, title="From 4 texels in a pixel (bottom) to 60,000 (top)", scale=3)


def table(results) -> str:
    """The results of `run` as Markdown: what is worst, then every step, then the picture."""
    curves = results["curves"]
    lines = [
        "| map | alpha | sun | largest error | largest step | truth's noise | errors within 1 % | steps within 1 % |",
        "| --- | ---: | ---: | ---: | ---: | ---: | --- | --- |",
    ]
    for each in curves:
        worst = each["summary"]
        lines.append(
            f"| {each['map']} | {each['alpha']:g} | {each['sun_degrees']:g}° | "
            f"{_percent(worst['error'], worst['error_deviation'])} | "
            f"{_percent(worst['step'], worst['step_deviation'])} | {each['truth_noise']:.2%} | "
            f"{_yes(worst['within'])} | {_yes(worst['steady'])} |"
        )
    heads = [f"{each['map']}, alpha {each['alpha']:g}" for each in curves]
    lines += ["", "| texels a pixel | " + " | ".join(heads) + " |", "| ---: |" + " ---: |" * len(heads)]
    lines += [_line([each["rows"][index] for each in curves]) for index in range(len(curves[0]["rows"]))]
    found = results["receding"]
    lines += ["", "![A plane that recedes, Glint beside the truth](plots/dolly.png)", "",
              "| receding plane: texels a pixel | " + " | ".join(found) + " |", "| ---: |" + " ---: |" * len(found)]
    lines += [_line(rows) for rows in zip(*found.values(), strict=True)]
    note = (f"Relative error of the mean luminance ± one standard deviation, of a step without the truth's; footprints "
            f"of {results['spp']} spp. ")
    return "\n".join([*lines, "", note + machine_line(results["machine"])])


def _line(rows):
    errors = " | ".join(_percent(row["error"], row["deviation"]) for row in rows)
    return f"| {rows[0]['texels']:.3g} | {errors} |"


def _percent(value, deviation):
    return f"{value:+.2%} ± {deviation:.2%}"


def _yes(answer):
    return "yes" if answer else "**no**"


if __name__ == "__main__":
    run_command("dolly", run, table, FILE, dolly_truth.renew)
