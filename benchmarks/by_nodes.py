"""`python -m benchmarks.by_nodes`: glints by nodes alone against Blender's plain nodes, both without OSL.

Variance at equal samples, the time of a sample, and with both the time to equal error, in each scene of the suite that
small lights light; the energy of pictures with one to eight lights, Beckmann and GGX; the start of a render. Plain
nodes and places are rendered in turn, round after round, so that a machine that is busy for a while slows both.
"""

from __future__ import annotations

import math
from statistics import median

import numpy as np

from demo_scenes import maps, measure, stage
from demo_scenes.truth import truth_material
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

from . import suite
from .command import run_command
from .cost import render_cost
from .error import picture_error
from .record import RESULTS, machine, machine_line
from .truth import stored

FILE = RESULTS / "by_nodes.json"
SPPS = (16, 64)
SEEDS = 4  # pictures of each, whose squared errors are averaged
ROUNDS = 3  # of times, the median of their ratios counts
TIMED_SPP = 64
BIAS_SPP = 512
BIAS_SEEDS = 4
TRUTH_SPP = 8192
LIGHTS = (1, 2, 3, 5, 8)
SIDE = 32  # pixels of the pictures with several lights


def run() -> dict:
    """Measure all: {"machine", "scenes": {name: numbers}, "lights": [{"lights", "distribution", "bias", "noise"}]}.

    Numbers of a scene: "variance" {spp: plain nodes' over that of places}, "time" (of a sample, in those of plain
    nodes), "to_error" (time of plain nodes to the error of places at 64 samples, in that of places), "bias" and its
    "noise" at 512 samples, "start" (seconds more until the first sample).
    """
    names = [name for name in suite.NAMES if suite.scene_module(name).SMALL_LIGHTS]
    return {
        "machine": machine(),
        "scenes": {name: _scene(name) for name in names},
        "lights": [_bias(count, distribution) for count in LIGHTS for distribution in ("BECKMANN", "GGX")],
    }


def table(results) -> str:
    """The results of `run` as Markdown."""
    lines = [
        "| scene | variance / 16 | variance / 64 | time of a sample | time to equal error | bias | start |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    scenes = results["scenes"]
    for name, row in scenes.items():
        lines.append(
            f"| {name} | {row['variance']['16']:.1f} | {row['variance']['64']:.1f} | {row['time']:.2f} | "
            f"{row['to_error']:.1f} | {100 * row['bias']:+.1f} ± {100 * row['noise']:.1f} % | {row['start']:+.2f} s |"
        )
    middle = {key: median(row[key] for row in scenes.values()) for key in ("time", "to_error", "start")}
    variances = [median(row["variance"][str(spp)] for row in scenes.values()) for spp in SPPS]
    lines.append(f"| median | {variances[0]:.1f} | {variances[1]:.1f} | {middle['time']:.2f} | "
                 f"{middle['to_error']:.1f} | | {middle['start']:+.2f} s |")
    lines += ["", "Plain nodes' variance over that of 16 places at 16 and 64 samples; time of a sample in those of "
              "plain nodes; how many times longer plain nodes take to the same error; energy at 512 samples.", "",
              "| lights | Beckmann | GGX |", "| ---: | ---: | ---: |"]
    for count in LIGHTS:
        cells = [f"{100 * row['bias']:+.2f} ± {100 * row['noise']:.2f} %"
                 for row in results["lights"] if row["lights"] == count]
        lines.append(f"| {count} | {' | '.join(cells)} |")
    return "\n".join([*lines, "", f"Energy at {BIAS_SPP} samples. {machine_line(results['machine'])}"])


def places_scene(name, spp=1):
    """Scene `name` of the suite in the glint material, prepared, as it renders without OSL."""
    scene = suite.lobe_scene(name, spp)
    scene.cycles.shading_system = False
    return scene


def _scene(name):
    truth, found = stored(name), {}
    for way, open_scene in (("plain", suite.nodes_scene), ("places", places_scene)):
        scene = open_scene(name)
        errors = {spp: picture_error(pictures(scene, spp, SEEDS), truth.mean, truth.variance)
                  for spp in (*SPPS, BIAS_SPP)}
        found[way] = errors
    ratios, starts = [], []
    for _ in range(ROUNDS):
        seconds, start_ups = [], []
        for open_scene in (suite.nodes_scene, places_scene):
            scene = open_scene(name)
            start_ups.append(measure.start_up_seconds(scene))
            seconds.append(render_cost(scene, TIMED_SPP, start_ups[-1]).seconds)
        ratios.append(seconds[1] / seconds[0])
        starts.append(start_ups[1] - start_ups[0])
    variance = {str(spp): (found["plain"][spp].rmse / found["places"][spp].rmse) ** 2 for spp in SPPS}
    time, bias = median(ratios), found["places"][BIAS_SPP]
    return {"variance": variance, "time": time, "to_error": variance[str(TIMED_SPP)] / time, "bias": bias.bias,
            "noise": bias.bias_noise, "start": median(starts)}


def _bias(count, distribution):
    """The energy of a sheet of flakes under `count` small suns, against plain nodes."""
    means = []
    for make, spp in ((truth_material, TRUTH_SPP), (create_glint_material, BIAS_SPP)):
        scene = stage.empty_scene((SIDE, SIDE), spp)
        image = maps.blender_image("Normal map", maps.flakes(256, std=0.12, seed=41))
        material = make("Flakes", image, roughness=0.3, distribution=distribution, interpolation="CLOSEST")
        corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
        stage.add_sheet(scene, "Sheet", corners, material, repeats=8.0)
        stage.add_camera(scene, (0, -2, 4), (0, 0, 0), angle=0.4)
        for number in range(count):
            angle = 2.4 * number
            stage.add_sun(scene, (0.4 * math.cos(angle), 0.5 + 0.4 * math.sin(angle), 1), strength=1.0 / (1 + number))
        prepare_scene(scene)
        scene.cycles.shading_system = False
        means.append([picture.mean() for picture in pictures(scene, spp, BIAS_SEEDS)])
    truth, found = (np.mean(values) for values in means)
    noise = math.hypot(*(np.std(values, ddof=1) / math.sqrt(BIAS_SEEDS) / truth for values in means))
    return {"lights": count, "distribution": distribution, "bias": float(found / truth - 1), "noise": float(noise)}


def pictures(scene, spp, seeds, first=1):
    """Luminance (height, width) of renders of `spp` samples with `seeds` seeds, the first of which is `first`."""
    scene.cycles.samples = spp
    found = []
    for seed in range(first, first + seeds):
        scene.cycles.seed = seed
        found.append(measure.luminance(measure.rendered(scene)))
    scene.cycles.seed = 1
    return found


if __name__ == "__main__":
    run_command("by_nodes", run, table, FILE)
