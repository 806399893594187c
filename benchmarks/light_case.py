"""One light on the stage of light_scene.py: errors of Blender's nodes and of the lobe, cost, the shader's counts."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from demo_scenes import measure
from glint_addon.prepare.scene import prepare_scene

from . import light_scene
from .cost import render_cost
from .counters import counters
from .error import picture_error, truth_bias_noise
from .light_scene import LOBE, NODES
from .truth import converge, read_truth

FOLDER = Path(__file__).resolve().parent / "truths" / "lights"
NOISE = 0.03  # of a truth, relative; its variance is taken out of measured errors, which may so be smaller
PART_SPP = 8192  # of one part of a truth: some seconds
SPP = {4: 2, 64: 1}  # samples a pixel: pictures, whose mean squared error counts
COST_SPP = min(SPP)  # where a sample of the lobe covers most and costs most
# Of timed renders of both methods in turn; the median of their ratios counts. The lobe's start-up, its compilation,
# takes longer than a picture: fewer of both than elsewhere, since all three tables are to take six minutes.
ROUNDS = 2
START_UP_RENDERS = 2
START_UPS = 1.0  # see sweep.py: a timed render takes no less than its start-up
# A first guess of a picture's time in start-ups, instead of a pilot: a picture of four samples takes less than its
# start-up varies, and one that seemed to take nothing was repeated two thousand times.
FIRST_GUESS = 0.03


def case_results(name, add_light: Callable, *, rounds=ROUNDS) -> dict:
    """What is measured under the light of `add_light`, whose truth is called `name`.

    {"hints": names of the hints, "truth": its facts, "counts": see `stage_counts`, "errors": {method: {spp: error}},
    "ratio", "low", "high": see `cost_ratio`}; an error has "rmse", "bias", "bias_noise" and "tiles", the RMSE of each.
    Spp are texts, as JSON has them.
    Raises ValueError if the truth is of another state of the scene, FileNotFoundError if there is none.
    """
    made = light_scene.light_stage(add_light)
    truth = read_truth(truth_file(name))
    if truth.scene_hash != light_scene.stage_hash(made):
        raise ValueError(f"The truth of {name} is of an older state of the stage: run it with --renew-truth.")
    return measured(made, truth, rounds)


def measured(made, truth, rounds=ROUNDS) -> dict:
    """The same of a stage and its truth, which are taken to belong together."""
    made.dress(LOBE)
    report = prepare_scene(made.scene)
    found = {
        "hints": report["hints"],
        "truth": {"spp": truth.spp * truth.seeds, "noise": truth.noise,
                  "bias_noise": truth_bias_noise(truth.mean, truth.variance)},
        "counts": stage_counts(made),
        "errors": {method: method_errors(made, method, truth) for method in (NODES, LOBE)},
    }
    return found | cost_ratio(made, rounds)


def method_errors(made, method, truth) -> dict:
    """{spp: error} of one method; see `case_results`."""
    made.dress(method)
    return {str(spp): _error(pictures(made.scene, spp, count), truth) for spp, count in SPP.items()}


def pictures(scene, spp, count) -> np.ndarray:
    """Luminance (count, height, width) of renders with seeds of their own."""
    scene.cycles.samples = spp
    renders = []
    for scene.cycles.seed in range(1, count + 1):
        renders.append(measure.luminance(measure.rendered(scene)))
    return np.stack(renders)


def stage_counts(made, spp=COST_SPP) -> dict:
    """Means over the pixels of what one of `spp` samples did: "closures" returned, "visited" texels or patches."""
    parts = [counters(made.scene, material, spp) for material in made.materials[LOBE].values()]
    pixels = sum(part.seen.sum() for part in parts)
    return {name: float(sum(getattr(part, name)[part.seen].sum() for part in parts) / pixels)
            for name in ("closures", "visited")}


def cost_ratio(made, rounds=ROUNDS) -> dict:
    """Cost of a sample, lobe / Blender's nodes under OSL: median "ratio" of the rounds, extremes "low" and "high"."""
    start_ups, seconds = {}, {NODES: [], LOBE: []}
    for method in seconds:
        made.dress(method)
        start_ups[method] = measure.start_up_seconds(made.scene, START_UP_RENDERS)
    for _ in range(rounds):
        for method, times in seconds.items():
            made.dress(method)
            guess = times[-1] if times else FIRST_GUESS * start_ups[method]
            times.append(render_cost(made.scene, COST_SPP, start_ups[method], guess=guess, start_ups=START_UPS).seconds)
    ratios = np.array(seconds[LOBE]) / np.array(seconds[NODES])
    return {"ratio": float(np.median(ratios)), "low": float(ratios.min()), "high": float(ratios.max())}


def renew_truths(cases: dict[str, Callable]):
    """Render the stored truths of {name: add_light} until each is quiet enough; goes on where a run was stopped."""
    for name, add_light in cases.items():
        made = light_scene.light_stage(add_light)
        converge(truth_file(name), made.scene, light_scene.stage_hash(made), noise=NOISE, part_spp=PART_SPP)


def truth_file(name) -> Path:
    """Where the truth called `name` is stored."""
    return FOLDER / ("_".join(re.findall(r"\w+", name.lower())) + ".npz")


def _error(renders, truth):
    whole = picture_error(renders, truth.mean, truth.variance)
    return {
        "rmse": whole.rmse, "bias": whole.bias, "bias_noise": whole.bias_noise,
        "tiles": {name: picture_error(renders[:, rows, columns], truth.mean[rows, columns],
                                      truth.variance[rows, columns]).rmse
                  for name, (rows, columns) in light_scene.tiles(len(truth.mean)).items()},
    }
