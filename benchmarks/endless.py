"""`python -m benchmarks.endless`: Shuffle against Repeat: cost of a sample, tables and bake, and whether tiles show.

A sheet of flakes under a low sun of half a degree. Times are of both in turn, of a map of MAP texels; tables and bake
of sheets of 1 to a million repeats; and how like itself a picture of 64 repeats is, moved by whole tiles.
"""

from __future__ import annotations

import time
from statistics import median

import numpy as np

from demo_scenes import maps, measure, stage
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

from .command import run_command
from .cost import render_cost
from .record import RESULTS, machine, machine_line

FILE = RESULTS / "endless.json"
VARIATIONS = ("REPEAT", "SHUFFLE")
SIDE = 32  # pixels
MAP = 512  # texels
WIDTH = 0.5  # metres of the sheet that the picture shows
DISTANCES = {"near": 4.0, "middle": 16.0, "far": 160.0, "farther": 1600.0}  # texels along a pixel's side
SPPS = (4, 64)
ROUNDS = 3  # of times, the median of their ratios counts
REPEATS = (1, 10**3, 10**6)  # of the map on the sheet
TILES = 8  # along the picture whose likeness is measured, SIDE pixels to a tile of LIKENESS_MAP texels
LIKENESS_MAP, LIKENESS_SPP = 128, 64


def run() -> dict:
    """{"machine", "costs": [{"distance", "spp", "ratio"}], "tables": [{"repeats", variation: {"bytes", "seconds"}}],
    "likeness": {variation: [largest, least correlation with the picture moved by 1 to 4 tiles]}}."""
    costs = [{"distance": name, "spp": spp, "ratio": _ratio(texels, spp)}
             for name, texels in DISTANCES.items() for spp in SPPS]
    tables = [{"repeats": count, **{each: _tables(each, count) for each in VARIATIONS}} for count in REPEATS]
    return {"machine": machine(), "costs": costs, "tables": tables,
            "likeness": {variation: likeness(variation) for variation in VARIATIONS}}


def table(results) -> str:
    """The results of `run` as Markdown."""
    lines = [f"| texels along a pixel | {' | '.join(f'{spp} samples' for spp in SPPS)} |",
             f"| --- |{' ---: |' * len(SPPS)}"]
    for name, texels in DISTANCES.items():
        cells = [f"{row['ratio']:.2f}" for row in results["costs"] if row["distance"] == name]
        lines.append(f"| {texels:g} | {' | '.join(cells)} |")
    lines += ["", "Time of a sample of Shuffle in those of Repeat.", "",
              "| repeats | Repeat: MB, seconds of the preparation | Shuffle |", "| ---: | ---: | ---: |"]
    for row in results["tables"]:
        cells = [f"{row[each]['bytes'] / 1e6:.1f}, {row[each]['seconds']:.2f}" for each in VARIATIONS]
        lines.append(f"| {row['repeats']} | {' | '.join(cells)} |")
    repeat, shuffle = (results["likeness"][each] for each in VARIATIONS)
    return "\n".join([*lines, "", (
        f"A picture of {TILES} x {TILES} tiles and itself, moved by one to four tiles: correlation {repeat[1]:.2f} to "
        f"{repeat[0]:.2f} with Repeat, {shuffle[1]:+.3f} to {shuffle[0]:+.3f} with Shuffle, where chance makes "
        f"{1 / (TILES * SIDE):.3f}. " + machine_line(results["machine"]))])


def dressed(variation, repeats, *, side=SIDE, spp=1, texels=MAP, seed=31):
    """A scene with a sheet that shows `repeats` of a map along the picture's width, not prepared."""
    scene = stage.empty_scene((side, side), spp)
    image = maps.blender_image("Normal map", maps.flakes(texels, std=0.15, seed=seed))
    material = create_glint_material("Sheet", image, roughness=0.2, distribution="GGX", interpolation="CLOSEST",
                                     variation=variation)
    size = 2.0 * WIDTH
    corners = [(x * size, y * size, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=repeats * 2.0 * size / WIDTH)
    stage.add_camera(scene, (0.0, -2.0, 0.8), (0, 0, 0), angle=WIDTH / 2.15)
    stage.add_sun(scene, (0.0, 2.0, 0.8))
    return scene


def likeness(variation) -> list[float]:
    """Largest and least correlation of a picture from straight above with itself, moved by one to four tiles."""
    side = TILES * SIDE
    scene = stage.empty_scene((side, side), LIKENESS_SPP)
    image = maps.blender_image("Normal map", maps.flakes(LIKENESS_MAP, std=0.15, seed=31))
    material = create_glint_material("Sheet", image, roughness=0.2, interpolation="CLOSEST", variation=variation)
    corners = [(x * WIDTH, y * WIDTH, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=TILES)
    stage.add_camera(scene, (0.0, 0.0, 2.0), (0, 0, 0), width=2.0 * WIDTH)
    stage.add_sun(scene, (0.1, 0.0, 1.0))
    prepare_scene(scene)
    picture = measure.rendered(scene)[..., 0]
    picture = picture - picture.mean()
    found = [np.mean(picture * np.roll(picture, SIDE * step, axis)) / np.mean(picture**2)
             for axis in (0, 1) for step in (1, 2, 3, 4)]
    return [float(max(found)), float(min(found))]


def _ratio(texels, spp) -> float:
    """Time of a sample of Shuffle in those of Repeat."""
    ratios = []
    for _ in range(ROUNDS):
        seconds = {}
        for variation in VARIATIONS:
            scene = dressed(variation, texels * SIDE / MAP)
            prepare_scene(scene)
            seconds[variation] = render_cost(scene, spp, measure.start_up_seconds(scene)).seconds
        ratios.append(seconds["SHUFFLE"] / seconds["REPEAT"])
    return median(ratios)


def _tables(variation, repeats) -> dict:
    """Bytes of the tables of a sheet with so many repeats, and seconds of the preparation."""
    # Another map for each, so that all are baked.
    scene = dressed(variation, np.sqrt(repeats), seed=repeats + VARIATIONS.index(variation))
    start = time.perf_counter()
    counts = prepare_scene(scene)["counts"]
    return {"bytes": counts["bytes_in_use"], "seconds": time.perf_counter() - start}


if __name__ == "__main__":
    run_command("endless", run, table, FILE)
