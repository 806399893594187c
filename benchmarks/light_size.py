"""`python -m benchmarks.light_size`: a sun from a tenth of a degree to thirty on the stage of light_scene.py.

A light that is wide against the lobe lets more of the map shine: more elements to draw the same closures from for the
lobe, less noise for Blender's nodes. Errors, cost and closures by the sun's angle, full across.
"""

from __future__ import annotations

from . import light_case, light_scene
from .command import run_command
from .lights import case_table, foot, tile_table
from .record import RESULTS, machine

FILE = RESULTS / "light_size.json"
DEGREES = (0.1, 0.5, 2.0, 5.0, 10.0, 20.0, 30.0)
SUNS = dict(light_scene.sun(degrees) for degrees in DEGREES)


def run() -> dict:
    """Measure every sun: {"machine", "rounds", "cases": {name: see `light_case.case_results`}}."""
    cases = {name: light_case.case_results(name, add_light) for name, add_light in SUNS.items()}
    return {"machine": machine(), "rounds": light_case.ROUNDS, "cases": cases}


def table(results) -> str:
    """The results of `run` as Markdown."""
    cases = results["cases"]
    return "\n\n".join([case_table("sun, full angle", cases), tile_table("sun, full angle", cases), foot(results)])


def renew_truth():
    """Render the stored truths again."""
    light_case.renew_truths(SUNS)


if __name__ == "__main__":
    run_command("light_size", run, table, FILE, renew_truth)
