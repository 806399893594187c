"""`python -m benchmarks.gpu`: glints by nodes alone on a GPU, by the number of places.

Relative RMSE of small pictures against the stored truths, and the time of a sample, of Blender's plain nodes and of
places. `make bench` leaves it out, because it needs a GPU that Blender renders on.
"""

from __future__ import annotations

import math

import bpy

from demo_scenes import measure
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.places import count_node

from . import suite
from .by_nodes import places_scene
from .command import run_command
from .cost import render_cost
from .error import picture_error
from .record import RESULTS, machine, machine_line
from .truth import stored

FILE = RESULTS / "gpu.json"
DEVICES = ("CUDA", "OPTIX", "HIP", "ONEAPI", "METAL")
NAMES = ("flakes_middle", "bumps_middle", "brushed_middle")
COUNTS = (0, 8, 16, 24)  # places; 0: plain nodes
SPP = 64
SEEDS = 4
GUESS = 2e-4  # seconds of such a picture: thousands are timed in one render, so that the GPU has enough to do


def run() -> dict:
    """Measure on every kind of device that there is: {"machine", "rows": [...]}.

    A row: "device" (kind), "gpu" (its name), "scene", "places", "rmse", "bias", "noise" of that,
    "nanoseconds" of a sample, "start" in seconds.
    Raises SystemExit where there is no such device.
    """
    rows = [row for kind in DEVICES for row in _device_rows(kind)]
    if not rows:
        raise SystemExit("Blender found no GPU: run this on a machine with one.")
    return {"machine": machine(), "rows": rows}


def table(results) -> str:
    """The results of `run` as Markdown."""
    lines = ["| device | scene | places | relative RMSE | ns a sample | plain variance | plain time to it |",
             "| --- | --- | ---: | ---: | ---: | ---: | ---: |"]
    plain = {(row["device"], row["scene"]): row for row in results["rows"] if row["places"] == 0}
    for row in results["rows"]:
        base = plain[row["device"], row["scene"]]
        gain, time = (base["rmse"] / row["rmse"]) ** 2, row["nanoseconds"]
        lines.append(f"| {row['device']} | {row['scene']} | {row['places'] or 'plain nodes'} | {row['rmse']:.3f} | "
                     f"{time:.1f} | {gain:.1f} | {gain * base['nanoseconds'] / time:.1f} |")
    names = ", ".join(dict.fromkeys(row["gpu"] for row in results["rows"]))
    return "\n".join([*lines, "", f"{names}; {SPP} samples; nanoseconds of a sample; the "
                      f"last columns have plain nodes' variance, and their time to equal error, in those of the row. "
                      f"{machine_line(results['machine'])}"])


def _device_rows(kind):
    rows = []
    for name in NAMES:
        truth = stored(name)
        for count in COUNTS:
            scene = suite.nodes_scene(name, SPP) if count == 0 else places_scene(name, SPP)
            gpu = _use_device(scene, kind)
            if gpu is None:
                return []
            for slot in (slot for thing in scene.objects for slot in thing.material_slots if count):
                for group in glint_groups(slot.material):
                    count_node(group).integer = count
            pictures = []
            for seed in range(1, SEEDS + 1):
                scene.cycles.seed = seed
                pictures.append(measure.luminance(measure.rendered(scene)))
            error = picture_error(pictures, truth.mean, truth.variance)
            start = measure.start_up_seconds(scene)
            cost = render_cost(scene, SPP, start, guess=GUESS)
            nanoseconds = cost.seconds / (SPP * math.prod(suite.SIZE)) * 1e9
            rows.append({"device": kind, "gpu": gpu, "scene": name, "places": count, "rmse": error.rmse,
                         "bias": error.bias, "noise": error.bias_noise, "nanoseconds": nanoseconds, "start": start})
    return rows


def _use_device(scene, kind) -> str | None:
    """Let `scene` render on the first GPU of `kind`; its name, or None if there is none."""
    preferences = bpy.context.preferences.addons["cycles"].preferences
    if kind not in {item[0] for item in preferences.get_device_types(bpy.context)}:
        return None
    preferences.compute_device_type = kind
    preferences.get_devices()
    devices = [device for device in preferences.devices if device.type == kind]
    for device in preferences.devices:
        device.use = device == devices[0] if devices else False
    scene.cycles.device = "GPU"
    return devices[0].name if devices else None


if __name__ == "__main__":
    run_command("gpu", run, table, FILE)
