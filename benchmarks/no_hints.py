"""`python -m benchmarks.no_hints`: what the glint material costs where it has nothing to do.

A plane that fills the view under an even sky, in Blender's own nodes under Open Shading Language and in the glint
material: with no light to look for, and with one that no normal of the map can mirror, so that every sample asks and
leaves early. The three are rendered in turn, round after round, and each round gives a ratio, so that a machine that is
busy for a while slows all three. The issue's bound is 1.3 times Blender's nodes without hints.
"""

from __future__ import annotations

import numpy as np

from demo_scenes import maps, measure, stage
from demo_scenes.truth import truth_material
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

from .command import run_command
from .cost import render_cost
from .record import RESULTS, machine, machine_line

FILE = RESULTS / "no_hints.json"
SIDE = 64  # pixels
ROUNDS = 9  # their median counts
BOUND = 1.3
SURFACE = {"roughness": 0.15}
MAP_SIDE = 512  # texels
MAPS = {
    "CLOSEST": lambda: maps.flakes(MAP_SIDE, std=0.15, seed=31),
    "LINEAR": lambda: maps.bumps(MAP_SIDE, std=0.15, width=4.0, seed=32),
}
NODES, WITHOUT, UNREACHED = "Blender's nodes", "Glint, no hint", "Glint, a hint out of reach"


def run(rounds=ROUNDS) -> dict:
    """Measure both interpolations: {"machine", "bound", "rounds", "cases": {interpolation: {material: numbers}}}.

    The numbers are "microseconds" of one thread a sample (median), and the "ratio" to Blender's nodes with its
    quartiles "low" and "high" over the rounds.
    """
    return {
        "machine": machine(),
        "bound": BOUND,
        "rounds": rounds,
        "cases": {interpolation: _case(interpolation, rounds) for interpolation in MAPS},
    }


def table(results) -> str:
    """The results of `run` as a Markdown table."""
    lines = [
        "| map | material | microseconds a sample | times Blender's nodes | quartiles |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    for interpolation, case in results["cases"].items():
        for name, numbers in case.items():
            lines.append(
                f"| {interpolation.title()} | {name} | {numbers['microseconds']:.2f} | {numbers['ratio']:.2f} | "
                f"{numbers['low']:.2f} to {numbers['high']:.2f} |"
            )
    return "\n".join([*lines, "", f"Medians of {results['rounds']} rounds. {machine_line(results['machine'])}"])


def build(interpolation):
    """The scene, its plane, its sun out of reach, and {name: (material, whether the sun is a hint)}."""
    scene = stage.empty_scene((SIDE, SIDE), 1)
    image = maps.blender_image("Normal map", MAPS[interpolation]())
    corners = [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)]
    plane = stage.add_sheet(scene, "Plane", corners, None, repeats=8.0)
    stage.add_camera(scene, (0, -3, 3), (0, 0, 0), angle=0.6)
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    # Behind the plane, so dim that it only asks.
    sun = stage.add_sun(scene, (0, 1, -1), strength=1e-9)
    settings = {**SURFACE, "interpolation": interpolation}
    glint = create_glint_material("Glint", image, **settings)
    nodes = truth_material("Nodes", image, **settings)
    return scene, plane, sun, {NODES: (nodes, False), WITHOUT: (glint, False), UNREACHED: (glint, True)}


def use(scene, plane, sun, material, is_hinted):
    """Dress the plane in `material`, and let the sun be a hint or not."""
    plane.data.materials[0] = material
    sun.hide_render = not is_hinted
    prepare_scene(scene)
    scene.cycles.shading_system = True


def _case(interpolation, rounds):
    scene, plane, sun, materials = build(interpolation)
    start_ups = {}
    for name, (material, is_hinted) in materials.items():
        use(scene, plane, sun, material, is_hinted)
        start_ups[name] = measure.start_up_seconds(scene)

    seconds = {name: [] for name in materials}
    for _ in range(rounds):
        for name, (material, is_hinted) in materials.items():
            use(scene, plane, sun, material, is_hinted)
            guess = seconds[name][-1] if seconds[name] else None
            seconds[name].append(render_cost(scene, 1, start_ups[name], guess=guess).seconds)
    return {name: _numbers(np.array(times), np.array(seconds[NODES])) for name, times in seconds.items()}


def _numbers(seconds, nodes):
    low, ratio, high = np.quantile(seconds / nodes, (0.25, 0.5, 0.75))
    microseconds = np.median(seconds) * stage.THREADS / SIDE**2 * 1e6
    return {"microseconds": float(microseconds), "ratio": float(ratio), "low": float(low), "high": float(high)}


if __name__ == "__main__":
    run_command("no_hints", run, table, FILE)
