"""`python -m benchmarks.surfaces`: every kind of surface, and flakes with colours over a base, against Blender's nodes.

A sheet of flakes under a low sun of half a degree, at three distances. The truth is Blender's own nodes at TRUTH
samples; the same nodes, without Open Shading Language as users have them, and the lobe are compared with it at equal
samples, and a sample of both is timed in turn.
"""

from __future__ import annotations

from statistics import median

import numpy as np

from demo_scenes import maps, measure, stage
from demo_scenes.truth import truth_material
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

from .by_nodes import pictures
from .command import run_command
from .cost import render_cost
from .error import picture_error
from .record import RESULTS, machine, machine_line

FILE = RESULTS / "surfaces.json"
SIDE = 32  # pixels
MAP = 512  # texels
WIDTH = 0.5  # metres of the sheet that the picture shows
DISTANCES = {"near": 4.0, "middle": 32.0, "far": 160.0}  # texels along a pixel's side
SPPS = (4, 16, 64)
SEEDS = 6  # pictures of each method, whose squared errors are averaged
BIAS_SEEDS = 16  # pictures of 64 samples whose mean is compared with the truth's
TRUTH, TRUTH_PARTS = 16384, 4  # samples a pixel of a part, and parts, whose spread is the truth's variance
ROUNDS = 2  # of times
COLOR = (0.9, 0.5, 0.2)
CASES = {
    "tint": {"surface": "TINT", "color": COLOR},
    "metal": {"surface": "METAL", "color": COLOR, "edge_tint": (0.3, 0.9, 0.6)},
    "conductor": {"surface": "CONDUCTOR", "ior": (0.183, 0.421, 1.373), "extinction": (3.424, 2.346, 1.77)},
    "dielectric": {"surface": "DIELECTRIC", "ior": 1.31},
    "flakes": {"surface": "TINT", "color": COLOR},
}
SURFACE = {"roughness": 0.2, "distribution": "GGX", "interpolation": "CLOSEST"}
BASE = (0.05, 0.1, 0.3)


def run() -> dict:
    """{"machine", "rows": [{"case", "distance", "bias", "noise" (in parts of the truth's mean), "spp": {spp: {"nodes",
    "lobe" (relative RMSE), "cost" (of a sample, lobe / nodes)}}}]}."""
    rows = [_row(case, distance) for case in CASES for distance in DISTANCES]
    return {"machine": machine(), "rows": rows}


def table(results) -> str:
    """The results of `run` as Markdown."""
    lines = [
        "| surface | distance | bias | " + " | ".join(f"nodes, Glint at {spp} | cost | gain" for spp in SPPS) + " |",
        "| --- | --- | ---: |" + " ---: | ---: | ---: |" * len(SPPS),
    ]
    for row in results["rows"]:
        cells = [f"{each['nodes']:.3f}, {each['lobe']:.3f} | {each['cost']:.1f} | {gain(each):.1f}"
                 for each in row["spp"].values()]
        lines.append(f"| {row['case']} | {row['distance']} | {row['bias']:+.2%} ± {row['noise']:.2%} | "
                     f"{' | '.join(cells)} |")
    texels = ", ".join(f"{name} {count:g}" for name, count in DISTANCES.items())
    return "\n".join([*lines, "", f"Texels along a pixel: {texels}. Relative RMSE of {SEEDS} pictures; cost of a "
                      "sample in those of Blender's nodes without Open Shading Language; gain: how many times longer "
                      "these take to the same error. " + machine_line(results["machine"])])


def gain(numbers) -> float:
    """How many times longer Blender's nodes take to the lobe's error; a picture's error falls by its samples' root."""
    return (numbers["nodes"] / max(numbers["lobe"], 1e-6)) ** 2 / numbers["cost"]


def dressed(case, distance, method):
    """A scene with the sheet in a material of `method`, "nodes" or "lobe", prepared."""
    scene = stage.empty_scene((SIDE, SIDE), 1)
    image = maps.blender_image("Normal map", maps.flakes(MAP, std=0.15, seed=31))
    settings = SURFACE | CASES[case]
    if case == "flakes":
        settings |= _images_of_flakes()
    make = truth_material if method == "nodes" else create_glint_material
    material = make(case, image, **settings)
    size = 2.0 * WIDTH
    corners = [(x * size, y * size, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    repeats = DISTANCES[distance] * SIDE / WIDTH * 2.0 * size / MAP
    stage.add_sheet(scene, "Sheet", corners, material, repeats=repeats)
    stage.add_camera(scene, (0.0, -2.0, 0.8), (0, 0, 0), angle=WIDTH / 2.15)
    stage.add_sun(scene, (0.0, 2.0, 0.8))
    prepare_scene(scene)
    if method == "nodes":
        scene.cycles.shading_system = False
    return scene


def _images_of_flakes():
    """Two populations: those that lean more have another colour, so that the colour depends on the slope."""
    rng = np.random.default_rng(32)
    presence = (rng.random((MAP, MAP, 1)) < 0.5).astype(float)
    lean = np.linalg.norm(maps.decoded_slopes(maps.flakes(MAP, std=0.15, seed=31)), axis=2, keepdims=True)
    color = np.where(lean > 0.2, (0.2, 0.5, 1.0), (1.0, 0.6, 0.3)) * (0.5 + 0.5 * rng.random((MAP, MAP, 1)))
    return {"presence": maps.blender_image("Presence", np.repeat(presence, 3, axis=2)),
            "flake_color": maps.blender_image("Colors", color), "base_color": BASE}


def _row(case, distance) -> dict:
    scene = dressed(case, distance, "nodes")
    parts = np.array(pictures(scene, TRUTH, TRUTH_PARTS))
    mean, variance = parts.mean(axis=0), parts.var(axis=0, ddof=1) / TRUTH_PARTS
    errors = {"nodes": {spp: picture_error(pictures(scene, spp, SEEDS, first=11), mean, variance) for spp in SPPS}}
    scene = dressed(case, distance, "lobe")
    errors["lobe"] = {spp: picture_error(pictures(scene, spp, SEEDS), mean, variance) for spp in SPPS}
    whole = picture_error(pictures(scene, SPPS[-1], BIAS_SEEDS), mean, variance)
    costs = {spp: _cost(case, distance, spp) for spp in SPPS}
    return {"case": case, "distance": distance, "bias": whole.bias, "noise": whole.bias_noise,
            "spp": {str(spp): {"nodes": errors["nodes"][spp].rmse, "lobe": errors["lobe"][spp].rmse,
                               "cost": costs[spp]} for spp in SPPS}}


def _cost(case, distance, spp) -> float:
    """Cost of a sample, lobe / nodes: the median of the rounds."""
    ratios = []
    for _ in range(ROUNDS):
        seconds = {}
        for method in ("nodes", "lobe"):
            scene = dressed(case, distance, method)
            seconds[method] = render_cost(scene, spp, measure.start_up_seconds(scene)).seconds
        ratios.append(seconds["lobe"] / seconds["nodes"])
    return median(ratios)


if __name__ == "__main__":
    run_command("surfaces", run, table, FILE)
