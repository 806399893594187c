"""`python -m benchmarks.lights`: every kind of light on one small stage, Blender's nodes and the lobe at equal samples.

light_scene.py says what the stage shows, light_case.py what is measured. A light that Glint has no hint for is as noisy
as with Blender's nodes: its row says so by its hint and its errors.
"""

from __future__ import annotations

from . import light_case, light_scene
from .command import run_command
from .light_scene import LOBE, NODES
from .record import RESULTS, machine, machine_line

FILE = RESULTS / "lights.json"
FEW, MANY = (str(spp) for spp in light_case.SPP)


def run() -> dict:
    """Measure every kind: {"machine", "rounds", "cases": {kind: see `light_case.case_results`}}."""
    cases = {name: light_case.case_results(name, add_light) for name, add_light in light_scene.KINDS.items()}
    return {"machine": machine(), "rounds": light_case.ROUNDS, "cases": cases}


def table(results) -> str:
    """The results of `run` as Markdown: a line for each kind, then the errors of the four tiles."""
    parts = [case_table("light", results["cases"]), tile_table("light", results["cases"]), foot(results)]
    return "\n\n".join(parts)


def case_table(heading, cases) -> str:
    """Markdown: hint, errors at both sample counts, cost ratio and energy bias of each case."""
    lines = [
        f"| {heading} | hint | nodes, {FEW} spp | {MANY} spp | Glint, {FEW} spp | {MANY} spp | cost ratio | rounds | "
        f"bias, {MANY} spp | closures | truth's noise |",
        "| --- | --- |" + " ---: |" * 9,
    ]
    for name, case in cases.items():
        nodes, lobe = case["errors"][NODES], case["errors"][LOBE]
        errors = " | ".join(f"{error['rmse']:.3f}" for error in (nodes[FEW], nodes[MANY], lobe[FEW], lobe[MANY]))
        lines.append(
            f"| {name} | {', '.join(case['hints']) or 'none'} | {errors} | {case['ratio']:.2f} | "
            f"{case['low']:.2f} to {case['high']:.2f} | {lobe[MANY]['bias']:+.2%} ± {lobe[MANY]['bias_noise']:.2%} | "
            f"{case['counts']['closures']:.1f} | {case['truth']['noise']:.3f} |"
        )
    return "\n".join(lines)


def tile_table(heading, cases) -> str:
    """Markdown: the errors of nodes and lobe at the larger sample count, tile by tile."""
    names = tuple(light_scene.tiles())
    lines = [f"| {heading}; nodes, Glint at {MANY} spp | {' | '.join(names)} |", "| --- |" + " ---: |" * len(names)]
    for name, case in cases.items():
        both = (case["errors"][method][MANY]["tiles"] for method in (NODES, LOBE))
        pairs = [f"{nodes:.3f}, {lobe:.3f}" for nodes, lobe in zip(*(each.values() for each in both), strict=True)]
        lines.append(f"| {name} | " + " | ".join(pairs) + " |")
    return "\n".join(lines)


def foot(results) -> str:
    """What the numbers are, and the machine."""
    side, few, many = light_scene.SIDE, *light_case.SPP.values()
    distances = " and ".join(f"{texels:g}" for texels in light_scene.DISTANCES.values())
    return (f"{side} x {side} pixels, flakes (Closest) and bumps (Linear), {distances} texels in a pixel, facets of "
            f"alpha {light_scene.ROUGHNESS**2:g}. Relative RMSE ({few} pictures and {many}); cost of a sample at "
            f"{FEW} spp in those of Blender's nodes under OSL, median and extremes of {results['rounds']} rounds. "
            + machine_line(results["machine"]))


def renew_truth():
    """Render the stored truths again."""
    light_case.renew_truths(light_scene.KINDS)


if __name__ == "__main__":
    run_command("lights", run, table, FILE, renew_truth)
