"""`python -m benchmarks.bake`: what baking costs, and how much later a render starts that reads the tables.

* Bake: from an image in Blender to the files of both tables with all levels, each in a process of its own
  (bake_case.py): seconds of the clock and of the processors together, peak memory of the whole process with Blender and
  the image in it, and bytes a texel on disk, which are those in memory too.
* Start: one sample of 16 x 16 pixels in a process that has just opened the scene, its tables of all reachable levels in
  the file cache; against the same scene and 8-bit image in Blender's own nodes. The kinds take turns, so that a machine
  that is busy for a while slows all of them.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from .bake_case import BLENDS, GLINT, TILES
from .command import run_command
from .record import RESULTS, ROOT, machine, machine_line, read_json

FILE = RESULTS / "bake.json"
# Width, height in texels, bakes whose median counts (the largest takes a minute), and the bound in seconds.
SIZES = ((1024, 1024, 3, 1.0), (3000, 1700, 3, None), (4096, 4096, 3, 20.0), (8192, 8192, 1, 90.0))
BOUNDS = {"peak_bytes": 8 << 30, "bytes_a_texel": 40.0, "later_seconds": 0.5}  # the issue's; square powers of two
START_SIDE = 4096  # texels
STARTS = 5  # of each kind; their median counts
MEGABYTE = 1e6


def run(sizes=SIZES, start_side=START_SIDE, starts=STARTS) -> dict:
    """Measure everything: {"machine", "bounds", "bakes": [row], "starts": [row]}; see `bake_row` and `start_rows`."""
    return {
        "machine": machine(),
        "bounds": BOUNDS,
        "bakes": [bake_row(*size, interpolation) for size in sizes for interpolation in TILES],
        "start_side": start_side,
        "start_count": starts,
        "starts": [row for interpolation in TILES for row in start_rows(interpolation, start_side, starts)],
    }


def bake_row(width, height, repeats, bound, interpolation) -> dict:
    """Medians of `repeats` bakes, as of `bake_case.bake`, with the size and "bytes_a_texel" of all tables together."""
    found = [measured("bake", width, height, interpolation) for _ in range(repeats)]
    row = {key: float(np.median([one[key] for one in found])) for key in found[0]}
    size = {"width": width, "height": height, "interpolation": interpolation, "repeats": repeats, "bound": bound}
    size["bytes_a_texel"] = sum(row[f"{table}_bytes"] for table in ("table", "counts", "index")) / (width * height)
    return {**size, **row}


def start_rows(interpolation, side, starts) -> list[dict]:
    """One row for each kind of material, medians as of `bake_case.start`, with "later".

    "later": seconds by which Glint starts later than that kind, the median over the rounds.
    """
    with tempfile.TemporaryDirectory(prefix="glint-start-") as folder:
        saved = measured("save", folder, side, interpolation)
        found = {kind: [] for kind in BLENDS}
        for _ in range(starts):
            for kind, file in BLENDS.items():
                found[kind].append(measured("start", Path(folder) / file))
    rows = []
    for kind, times in found.items():
        row = {key: float(np.median([one[key] for one in times])) for key in times[0]}
        later = [glint["seconds"] - one["seconds"] for glint, one in zip(found[GLINT], times, strict=True)]
        rows.append({"interpolation": interpolation, "kind": kind, **row, "later": float(np.median(later)),
                     "table_bytes": saved["table_bytes"] if kind == GLINT else 0})
    return rows


def measured(kind, *arguments) -> dict:
    """One measurement of bake_case.py in a new process. Raises RuntimeError with its last words if it fails."""
    with tempfile.TemporaryDirectory(prefix="glint-case-") as folder:
        file = Path(folder) / "case.json"
        command = [sys.executable, "-m", "benchmarks.bake_case", str(file), kind, *map(str, arguments)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"Measuring {kind} of {arguments} failed: {done.stderr[-2000:]}")
        return read_json(file)


def table(results) -> str:
    """The results of `run` as two Markdown tables."""
    lines = [
        "| map | interpolation | bake, seconds | bound | CPU seconds | peak memory, MB | with the image alone, MB | "
        "bytes a texel |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for row in results["bakes"]:
        bound = "" if row["bound"] is None else f"{row['bound']:g}"
        lines.append(
            f"| {row['width']} x {row['height']} | {row['interpolation'].title()} | {row['seconds']:.2f} | {bound} | "
            f"{row['cpu_seconds']:.2f} | {row['peak_bytes'] / MEGABYTE:.0f} | {row['before_bytes'] / MEGABYTE:.0f} | "
            f"{row['bytes_a_texel']:.1f} |"
        )
    lines += ["", "| interpolation | material | first picture, seconds | Glint later by | CPU seconds | tables, MB |",
              "| --- | --- | ---: | ---: | ---: | ---: |"]
    for row in results["starts"]:
        later = "" if row["kind"] == GLINT else f"{row['later']:+.2f}"
        lines.append(
            f"| {row['interpolation'].title()} | {row['kind']} | {row['seconds']:.2f} | {later} | "
            f"{row['cpu_seconds']:.2f} | {row['table_bytes'] / MEGABYTE:.0f} |"
        )
    bounds = results["bounds"]
    note = (
        f"Bounds: {bounds['peak_bytes'] / MEGABYTE:.0f} MB at 8192 x 8192, {bounds['bytes_a_texel']:g} bytes a texel "
        f"where the sides are powers of two, a start {bounds['later_seconds']:g} s later. First picture: a map of "
        f"{results['start_side']} x {results['start_side']}, medians of {results['start_count']}. "
    )
    return "\n".join([*lines, "", note + machine_line(results["machine"])])


if __name__ == "__main__":
    run_command("bake", run, table, FILE)
