"""Run time against error: every method on one scene at log-spaced budgets, against the stored truth."""

from __future__ import annotations

import math
from dataclasses import asdict

import numpy as np

from demo_scenes import measure
from glint_addon.prepare.stored_tables import remembered_tables
from glint_addon.prepare.uses import glint_uses

from . import cost, methods, suite
from .error import picture_error, truth_bias_noise
from .flip import flip_error, truth_flip
from .headline import HEADLINE_SPP, SHOWN_SPP
from .record import RESULTS, machine, read_json, write_json
from .truth import stored

FILE = RESULTS / "scenes.json"
BUDGETS = tuple(np.geomspace(0.03, 5.0, 8))  # seconds without start-up, for methods that are cheap a sample
LARGEST_BIASED = 2.5  # seconds; a biased method is at its bias by then, and the suite must end in twenty minutes
LOBE_SPP = (1, 2, 4, 8, 16, 32, 64, 128, 256)
SURE_SPP = 64  # the lobe's energy bias is judged there, so up to there it may take SURE_SECONDS
SURE_SECONDS = 60.0
LOBE_SECONDS = 10.0
# One picture of few samples has an error that varies from seed to seed; those cost little, so more are averaged.
SEEDS = ((0.5, 3), (2.0, 2), (math.inf, 1))  # pictures for renders of at most so many seconds


def measure_scene(name, *, largest=math.inf) -> dict:
    """All that is measured of scene `name`; budgets above `largest` seconds are left out (at 0.07 two are left), but of
    the lobe not the sample counts of the headline.

    Raises ValueError if the stored truth is of another state of the scene, FileNotFoundError if there is none.
    """
    truth = stored(name)
    if truth.scene_hash != suite.scene_hash(name):
        raise ValueError(f"The truth of {name} is of an older state of the scene: run make truth SCENE={name}.")
    module = suite.scene_module(name)
    rows, nodes_spp = [], ()
    for method in methods.METHODS:
        found = method_rows(method, name, truth, nodes_spp, largest)
        if method.name == "nodes":
            nodes_spp = tuple(row["spp"] for row in found if row["spp"] != SHOWN_SPP)
        rows += found
    return {
        "machine": machine(),
        "scene_hash": truth.scene_hash,
        "texels": module.TEXELS,
        "small_lights": module.SMALL_LIGHTS,
        "truth": {"spp": truth.spp, "seeds": truth.seeds, "blender": truth.blender, "noise": truth.noise,
                  "bias_noise": truth_bias_noise(truth.mean, truth.variance),
                  "flip": truth_flip(truth.mean, truth.variance)},
        "nodes_osl_microseconds": nodes_osl_microseconds(name),
        "rows": rows,
    }


def method_rows(method, name, truth, nodes_spp, largest) -> list[dict]:
    """One row for each budget of one method. nodes_spp: the sample counts of Blender's nodes, or none yet."""
    scene = method.scene(name, 1)
    start_up = measure.start_up_seconds(scene)
    once = {"method": method.name, "memory": cost.peak_memory(scene), "table_bytes": table_bytes(scene)}
    pilot_spp = 1 if method.name == "lobe" else cost.PILOT_SPP
    sample_seconds = cost.render_cost(scene, pilot_spp, start_up).seconds / pilot_spp
    rows = []
    for spp in _sample_counts(method, sample_seconds, nodes_spp, largest):
        seconds = sample_seconds * spp
        if method.name == "lobe" and is_too_long(spp, seconds, largest):
            continue
        rows.append({**once, **_row(method, scene, spp, start_up, seconds, truth)})
        sample_seconds = rows[-1]["seconds"] / spp
    return rows


def nodes_osl_microseconds(name) -> float:
    """Microseconds of one thread for a sample of Blender's nodes under Open Shading Language."""
    scene = methods.nodes_osl_scene(name)
    start_up = measure.start_up_seconds(scene)
    return cost.render_cost(scene, cost.PILOT_SPP, start_up).microseconds(math.prod(suite.SIZE))


def is_too_long(spp, seconds, largest=math.inf) -> bool:
    """Whether `spp` samples of the lobe, which take `seconds`, are left out; `largest` leaves the headline whole."""
    if spp <= SHOWN_SPP:
        return False
    longest = SURE_SECONDS if spp <= SURE_SPP else LOBE_SECONDS
    return seconds > (longest if spp in HEADLINE_SPP else min(longest, largest))


def table_bytes(scene) -> int:
    """Bytes of the files of all glint tables of the scene; 0 for Blender's nodes."""
    files = {file for group in glint_uses(scene) for file in remembered_tables(group)}
    return sum(file.stat().st_size for file in files)


def store(name, result, file=FILE):
    """Put the result of one scene into the file of all, which keeps those of the others."""
    whole = read_json(file) if file.is_file() else {"scenes": {}}
    scenes = whole["scenes"] | {name: result}
    write_json(file, {"scenes": {known: scenes[known] for known in suite.NAMES if known in scenes}})


def _sample_counts(method, sample_seconds, nodes_spp, largest):
    if method.name == "lobe":
        return LOBE_SPP
    longest = min(largest, math.inf if method.unbiased else LARGEST_BIASED)
    budgets = [budget for budget in BUDGETS if budget <= longest]
    if not method.per_sample:
        # Its time hardly depends on the samples at first: take those of Blender's nodes at the same budgets.
        return nodes_spp[: len(budgets)]
    counts = {max(round(budget / sample_seconds), 1) for budget in budgets}
    # In close-ups the lobe's error is met so soon: the law of many samples would tell too few (flakes_close 2.7 for 4).
    return sorted(counts | {SHOWN_SPP} if method.unbiased else counts)


def _row(method, scene, spp, start_up, guess, truth):
    """Cost and error of `spp` samples that take about `guess` seconds."""
    seeds = next(count for seconds, count in SEEDS if guess <= seconds)
    pictures, times = [], []
    scene.cycles.samples = spp
    for seed in range(1, seeds + 1):
        scene.cycles.seed = seed
        pixels, seconds = measure.timed_render(scene)
        pictures.append(measure.luminance(pixels))
        times.append(max(seconds - start_up, measure.CLOCK_NOISE))
    scene.cycles.seed = 1
    if np.median(times) >= cost.least_seconds(start_up):
        spent = cost.Cost(spp, 1, float(np.median(times)), start_up)
    elif method.per_sample:
        spent = cost.render_cost(scene, spp, start_up, guess=guess)
    else:
        spent = cost.repeated_cost(scene, spp, start_up)
    return {
        **asdict(spent),
        "seeds": seeds,
        "microseconds": spent.microseconds(math.prod(suite.SIZE)),
        **asdict(picture_error(pictures, truth.mean, truth.variance)),
        **asdict(flip_error(pictures, truth.mean)),
    }
