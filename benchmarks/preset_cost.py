"""`python -m benchmarks.preset_cost`: what a preset costs against the same material without glints, and plain nodes."""

from __future__ import annotations

from collections.abc import Iterable
from statistics import median

import glint_addon
from demo_scenes import measure, preset_stage
from glint_addon.materials.find import glint_groups, is_glint_material
from glint_addon.nodes.flake_nodes import BASE, BASE_MIX
from glint_addon.nodes.map_choices import FACETS_NODE
from glint_addon.nodes.resampled import WIDE_NODE

from .command import run_command
from .record import RESULTS, machine, machine_line

FILE = RESULTS / "preset_cost.json"
# Flakes under a coat, grains over a subsurface base, scratches, and flakes with colours of their own.
PRESETS = ("Metallic Red", "Fresh Snow", "Scratched Chrome", "Christmas Bauble")
SIZE = (960, 540)  # pixels
SPP = 16
REPEATS = 3  # of each way, which take turns; their median counts
GLINT, NODES, NONE = "Glint", "Blender's nodes", "no glints"


def run(presets: Iterable[str] = PRESETS, size=SIZE, spp=SPP, repeats=REPEATS) -> dict:
    """{"machine", "size", "spp", "rows": [{"preset", "seconds": {way: s}, "start": {way: s}}]}"""
    rows = [measured(name, size, spp, repeats) for name in presets]
    return {"machine": machine(), "size": list(size), "spp": spp, "rows": rows}


def measured(preset: str, size, spp: int, repeats: int) -> dict:
    """Seconds of the clock of a picture of `preset` in each way, and of the start of its render."""
    seconds: dict[str, list[float]] = {way: [] for way in WAYS}
    start: dict[str, list[float]] = {way: [] for way in WAYS}
    for _ in range(repeats):
        for way, change in WAYS.items():
            scene = preset_stage.build(preset, size=size, spp=spp)
            glint_addon.prepare_scene(scene)
            change(scene)
            start[way].append(measure.start_up_seconds(scene, repeats=1))
            seconds[way].append(measure.timed_render(scene)[1])
    return {"preset": preset, "seconds": {way: median(seconds[way]) for way in WAYS},
            "start": {way: median(start[way]) for way in WAYS}}


def keep_glints(scene):
    """Leave the scene as it was prepared."""


def use_nodes(scene):
    """Render Blender's own nodes, without Open Shading Language, where they are fastest."""
    scene.cycles.shading_system = False
    for group in glint_groups(_glint_material(scene)):
        group.nodes[WIDE_NODE].outputs["Value"].default_value = 0.0  # no places: plain nodes


def remove_glints(scene):
    """Let facets lie flat, and where the map has a presence the base alone be seen."""
    use_nodes(scene)
    for group in glint_groups(_glint_material(scene)):
        facets = group.nodes[FACETS_NODE]
        group.links.remove(facets.inputs["Normal"].links[0])
        if BASE.name in group.interface.items_tree:
            factor = group.nodes[BASE_MIX].inputs["Factor"]
            group.links.remove(factor.links[0])
            factor.default_value = 0.0


WAYS = {GLINT: keep_glints, NODES: use_nodes, NONE: remove_glints}


def _glint_material(scene):
    return next(slot.material for thing in scene.objects for slot in thing.material_slots
                if is_glint_material(slot.material))


def table(results: dict) -> str:
    """The results of `run` as a Markdown table."""
    width, height = results["size"]
    lines = [f"| preset | {' | '.join(f'{way}, seconds (start)' for way in WAYS)} | Glint to none | nodes to none |",
             f"| --- |{' ---: |' * (len(WAYS) + 2)}"]
    for row in results["rows"]:
        seconds = row["seconds"]
        cells = [f"{seconds[way]:.1f} ({row['start'][way]:.1f})" for way in WAYS]
        cells += [f"{seconds[way] / seconds[NONE]:.2f}" for way in (GLINT, NODES)]
        lines.append(f"| {row['preset']} | {' | '.join(cells)} |")
    note = f"{width} x {height} pixels, {results['spp']} samples. "
    return "\n".join([*lines, "", note + machine_line(results["machine"])])


if __name__ == "__main__":
    run_command("preset_cost", run, table, FILE)
