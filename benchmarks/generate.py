"""`python -m benchmarks.generate`: how long the generators of microstructure take, at 2048 and 256 texels a side."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from glint_addon.generate import GENERATORS, PRESETS, Generator, Population

from .command import run_command
from .record import RESULTS, machine, machine_line

FILE = RESULTS / "generate.json"
FULL, PREVIEW = 2048, 256  # texels a side
BOUND = 5.0  # seconds for a full map: the issue's
REPEATS = 3  # of each; their median counts
CASES: dict[str, Generator] = {
    **{cls.label: cls() for cls in GENERATORS.values()},
    "Flakes, three populations": GENERATORS["FLAKES"](
        coverage=0.9, populations=(Population(size=1e-4), Population(), Population(size=2e-5, size_spread=0.3))
    ),
    "Flakes of a texel": GENERATORS["FLAKES"](populations=(Population(size=5e-6),)),
    **PRESETS,
}


def run(cases: Mapping[str, Generator] = CASES, full=FULL, preview=PREVIEW, repeats=REPEATS) -> dict:
    """{"machine", "bound", "full", "preview": texels a side, "rows": [{"name", "seconds", "preview_seconds"}]}"""
    rows = [
        {"name": name, "seconds": seconds(generator, full, repeats),
         "preview_seconds": seconds(generator, preview, repeats)}
        for name, generator in cases.items()
    ]
    return {"machine": machine(), "bound": BOUND, "full": full, "preview": preview, "rows": rows}


def seconds(generator: Generator, resolution: int, repeats: int) -> float:
    """Median time of the clock for one map."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        generator.microstructure(resolution)
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def table(results: dict) -> str:
    """The results of `run` as a Markdown table."""
    full, preview = results["full"], results["preview"]
    lines = [f"| microstructure | {full} x {full}, seconds | {preview} x {preview} |", "| --- | ---: | ---: |"]
    lines += [f"| {row['name']} | {row['seconds']:.2f} | {row['preview_seconds']:.3f} |" for row in results["rows"]]
    note = f"Bound: {results['bound']:g} s. One thread. "
    return "\n".join([*lines, "", note + machine_line(results["machine"])])


if __name__ == "__main__":
    run_command("generate", run, table, FILE)
