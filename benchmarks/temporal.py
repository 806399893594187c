"""`python -m benchmarks.temporal`: how well glints move, at equal time, in the two sequences of temporal_scenes.py.

The lobe gets LOBE_SPP samples a pixel, Blender's nodes as many as take the same time without start-up. Errors are
against the stored truth sequence, less its own variance, in units of its mean:

* curve: RMSE of all pixels and frames, and over the frames of each pixel the median and the largest of all pixels;
* flicker: RMSE of the differences between successive frames; the truth's own differences beside it.
"""

from __future__ import annotations

import math

import numpy as np

from demo_scenes import measure, picture
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

from . import temporal_scenes, temporal_truth
from .command import run_command
from .cost import PILOT_SPP, render_cost
from .record import RESULTS, ROOT, machine, machine_line
from .temporal_truth import nodes_scene

FILE = RESULTS / "temporal.json"
SHEETS = ROOT / "out"
LOBE_SPP = 4
SEEDS = (1, 2)  # sequences of each method; their mean squared error counts
COST_FRAMES = (1, 11, 22, 32)  # frames that are timed; their mean counts
SHEET_STEP = 4  # frames from one picture of the contact sheet to the next


def run() -> dict:
    """Measure both sequences and draw contact sheets into out/: {"machine", "lobe_spp", "sequences": {name: ...}}."""
    return {
        "machine": machine(),
        "size": temporal_scenes.SIZE,
        "frames": temporal_scenes.FRAMES,
        "sequences": {name: _sequence_results(name) for name in temporal_scenes.NAMES},
    }


def table(results) -> str:
    """The results of `run` as a Markdown table; curve, pixels and flicker are relative RMSEs."""
    lines = [
        "| sequence | method | spp | ms a frame | curve | median pixel | worst pixel | flicker | energy |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, found in results["sequences"].items():
        for method, row in found["methods"].items():
            lines.append(
                f"| {name} | {method} | {row['spp']} | {1e3 * row['frame_seconds']:.1f} | {row['curve']:.1%} | "
                f"{row['median_pixel']:.1%} | {row['worst_pixel']:.1%} | {row['flicker']:.1%} | {row['bias']:+.1%} |"
            )
        truth = found["truth"]
        lines.append(f"| {name} | truth (its own noise) | {truth['spp']} | | {truth['noise']:.1%} | | | | |")
        lines.append(f"| {name} | truth (its own change) | | | {truth['curve']:.1%} | | | {truth['flicker']:.1%} | |")
    width, height = results["size"]
    note = f"{results['frames']} frames of {width} x {height} pixels; equal time without start-up. "
    return "\n".join([*lines, "", note + machine_line(results["machine"])])


def lobe_scene(name):
    """Sequence `name` in the glint material, prepared."""
    scene = temporal_scenes.scene_with(name, lambda image, **surface: create_glint_material("Glint", image, **surface))
    prepare_scene(scene)
    return scene


def frame_seconds(scene, spp) -> float:
    """Wall clock seconds of a frame of `spp` samples a pixel without start-up, the mean over some of the frames."""
    costs = []
    for frame in COST_FRAMES:
        scene.frame_set(frame)
        costs.append(render_cost(scene, spp, measure.start_up_seconds(scene)).seconds)
    return float(np.mean(costs))


def errors(sequences, truth) -> dict:
    """Errors of independent `sequences` (count, frames, height, width) against a SequenceTruth, in its mean's units."""
    mean = truth.mean.mean()
    difference = sequences - truth.mean
    pixels = np.mean(difference**2, axis=(0, 1)) - truth.variance
    # Frames are independent pictures: the noise of a difference is that of both.
    steps = np.mean(np.diff(difference, axis=1) ** 2) - 2.0 * truth.variance.mean()
    relative = np.sqrt(np.maximum(pixels, 0.0)) / truth.mean.mean(axis=0)
    return {
        "curve": math.sqrt(max(pixels.mean(), 0.0)) / mean,
        "median_pixel": float(np.median(relative)),
        "worst_pixel": float(relative.max()),
        "flicker": math.sqrt(max(steps, 0.0)) / mean,
        "bias": float(sequences.mean() / mean - 1.0),
    }


def change(truth) -> dict:
    """The truth's own change, without its noise: of each pixel about its mean over the frames, and between frames."""
    mean = truth.mean.mean()
    curve = truth.mean.var(axis=0).mean() - truth.variance.mean()
    steps = np.mean(np.diff(truth.mean, axis=0) ** 2) - 2.0 * truth.variance.mean()
    return {"curve": math.sqrt(max(curve, 0.0)) / mean, "flicker": math.sqrt(max(steps, 0.0)) / mean}


def _sequence_results(name):
    truth = temporal_truth.stored(name)
    lobe = lobe_scene(name)
    sequences = {"lobe": np.stack([temporal_scenes.pictures(lobe, LOBE_SPP, seed) for seed in SEEDS])}
    lobe_seconds = frame_seconds(lobe, LOBE_SPP)
    nodes = nodes_scene(name)
    nodes_spp = max(round(PILOT_SPP * lobe_seconds / frame_seconds(nodes, PILOT_SPP)), 1)
    sequences["nodes"] = np.stack([temporal_scenes.pictures(nodes, nodes_spp, seed) for seed in SEEDS])
    seconds = {"lobe": lobe_seconds, "nodes": frame_seconds(nodes, nodes_spp)}
    spp = {"lobe": LOBE_SPP, "nodes": nodes_spp}
    draw(name, [truth.mean, sequences["lobe"][0], sequences["nodes"][0]])
    return {
        "truth": {"spp": truth.spp, "seeds": truth.seeds, "noise": truth.noise, "blender": truth.blender,
                  **change(truth)},
        "methods": {
            method: {"spp": spp[method], "seeds": len(SEEDS), "frame_seconds": seconds[method],
                     **errors(sequences[method], truth)}
            for method in ("nodes", "lobe")
        },
    }


def draw(name, sequences):
    """Contact sheet of some frames: the truth, the lobe and the nodes below each other, as out/temporal_NAME.png."""
    panels = []
    for index in range(0, temporal_scenes.FRAMES, SHEET_STEP):
        column = np.concatenate([frames[index] for frames in reversed(sequences)], axis=0)
        panels.append((f"frame {index + 1}", np.repeat(column[..., None], 3, axis=-1)))
    # Twice the mean is white: brighter glints clip, which loses nothing that is measured.
    exposure = 0.5 / sequences[0].mean()
    title = f"{name}; from the top: truth, Glint, Blender's nodes at equal time"
    picture.save_side_by_side(SHEETS / f"temporal_{name}.png", panels, title=title, scale=3, exposure=exposure)


if __name__ == "__main__":
    run_command("temporal", run, table, FILE, temporal_truth.renew)
