"""The quick benchmark: what the lobe does on one near and one far scene, as counts that are the same on every machine.

`benchmarks/limits.json` holds the counts that were agreed on; doing more is a failure. Times are shown for
information, as a ratio of two renders in one run. `python -m benchmarks quick --renew` writes new limits: look at what
changed, and why.
"""

from __future__ import annotations

from pathlib import Path

from demo_scenes import measure
from glint_addon.materials.find import is_glint_material

from . import cost, methods, suite
from .counters import counters
from .record import read_json, write_json
from .run import table_bytes

LIMITS = Path(__file__).resolve().parent / "limits.json"
SCENES = ("bumps_close", "flakes_far")
SPP = 4  # samples that the lobe is told of, as in the headline
# Another processor rounds a footprint's edge to the other side now and then: one percent of a count is not a change.
TOLERANCE = 0.01
AT_LEAST = ("share_left_early",)  # all other counts must not grow; this one must not shrink


def counts(name) -> dict:
    """Means over the samples that see the material, and bytes of tables, of scene `name`: name of a count -> number."""
    scene = suite.lobe_scene(name)
    material = next(slot.material for thing in scene.objects for slot in thing.material_slots
                    if is_glint_material(slot.material))
    summary = counters(scene, material, SPP).summary()
    found = {key: summary[key] for key in ("visited", "closures", "fetches", "hints", "share_left_early")}
    return {key: round(value, 4) for key, value in found.items()} | {"table_bytes": table_bytes(scene)}


def complaints(name, found, limits) -> list[str]:
    """One sentence for each count in `found` that breaks its limit, or has none."""
    sentences = []
    for key, value in found.items():
        if key not in limits:
            sentences.append(f"{name}: {key} {value:g} has no limit: run python -m benchmarks quick --renew.")
            continue
        limit = limits[key]
        too_much = value < limit * (1 - TOLERANCE) if key in AT_LEAST else value > limit * (1 + TOLERANCE)
        if too_much:
            what = "fell below" if key in AT_LEAST else "exceeds"
            sentences.append(f"{name}: {key} {value:g} {what} the limit {limit:g}: save the work, or renew the limit.")
    return sentences


def check(names=SCENES) -> list[str]:
    """Complaints about all of `names`; none if the lobe does no more than agreed. FileNotFoundError: no limits."""
    limits = read_json(LIMITS)
    return [sentence for name in names for sentence in complaints(name, counts(name), limits.get(name, {}))]


def renew(names=SCENES):
    """Write the counts as they are as the new limits."""
    write_json(LIMITS, {name: counts(name) for name in names})


def time_ratio(name) -> float:
    """Time of a sample of the lobe (of SPP) in those of a sample of Blender's nodes under Open Shading Language."""
    seconds = []
    for open_scene in (suite.lobe_scene, methods.nodes_osl_scene):
        scene = open_scene(name, SPP)
        seconds.append(cost.render_cost(scene, SPP, measure.start_up_seconds(scene)).seconds)
    return seconds[0] / seconds[1]
