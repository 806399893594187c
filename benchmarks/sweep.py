"""`python -m benchmarks.sweep`: what a sample costs by the texels in its footprint, in samples of Blender's own nodes.

Flakes and bumps of 1024^2 and 4096^2 texels, a small sun hinted, footprints from one texel to a million. Blender's
nodes under OSL and the glint material are rendered in turn, round after round, in one scene (sweep_scene.py), so that a
machine that is busy for a while slows both; each round gives a ratio, and the median counts. At every third footprint
the glint material is rendered under eight small suns as well. The counts are the shader's own, of one sample.
"""

from __future__ import annotations

import numpy as np

from demo_scenes.stage import THREADS

from . import query_scene, sweep_scene
from .command import run_command
from .cost import render_cost
from .counters import MODES, counters
from .record import RESULTS, machine, machine_line
from .sweep_scene import AREAS, GLINT, NODES, SUNS

FILE = RESULTS / "sweep.json"
SIDES = (1024, 4096)  # texels
ROUNDS = 3  # with renders of `cost.LEAST_SECONDS` each: the whole sweep takes a quarter of an hour
# A render is to take no less than its start-up, a third of a second that compiles the shader before each one and is
# known to a twentieth: the rounds' ratios show what is left of that.
START_UPS = 1.0
EIGHT_EVERY = 3  # footprints from one that is measured with eight hints to the next
COUNTED = ("visited", "closures", "fetches", "hints")
FAR = 1000  # texels in a footprint from which the cost is to be flat
GOALS = {"ratio": 6.0, "flatness": 2.0, "eight": 4.0}


def run(sides=SIDES, areas=AREAS, rounds=ROUNDS) -> dict:
    """Measure every map: {"machine", "rounds", "curves": [{"map", "texels", "rows"}], "summary"}; see `curve`."""
    curves = [
        {"map": name, "texels": side, "rows": curve(query_scene.query_map(name, side), areas, rounds)}
        for side in sides
        for name in query_scene.MAPS
    ]
    return {
        "machine": machine(),
        "alpha": query_scene.ALPHA,
        "slope": query_scene.SLOPE,
        "bump_width": query_scene.BUMP_WIDTH,
        "rounds": rounds,
        "curves": curves,
        "summary": summary(curves),
    }


def curve(kind, areas=AREAS, rounds=ROUNDS) -> list[dict]:
    """One row for each footprint of `areas` texels on a QueryMap.

    "nodes", "one": microseconds of one thread a sample, of Blender's nodes and of the glint material with one hint;
    "ratio": of these two, "low" and "high" its extremes over the rounds; "counts": see `block_counts`. Where measured,
    "eight" and "eight_counts": with eight hints, and "eight_ratio": to one.
    """
    sweep = sweep_scene.build(kind, areas)
    start_ups, counts = {}, {}
    for suns in (1, SUNS):
        sweep_scene.shine(sweep, suns)
        counts[suns] = block_counts(sweep, len(areas))
        rows = (NODES, GLINT) if suns == 1 else (GLINT,)
        start_ups |= {(row, suns): sweep_scene.start_up_seconds(sweep, row) for row in rows}

    seconds, last = {}, {}
    for _ in range(rounds):
        for column in range(len(areas)):
            for case in cases(column):
                # A guess from the footprint before saves a pilot render.
                guess = seconds.get((column, case), [last.get(case)])[-1]
                last[case] = _seconds(sweep, column, case, start_ups[case], guess)
                seconds.setdefault((column, case), []).append(last[case])
    return [
        _row(area, {case: np.array(seconds[column, case]) for case in cases(column)},
             {suns: counts[suns][column] for suns in counts})
        for column, area in enumerate(areas)
    ]


def cases(column) -> list[tuple[int, int]]:
    """(row of walls, suns that shine) that are measured in a column of walls."""
    eight = [(GLINT, SUNS)] if column % EIGHT_EVERY == 0 else []
    return [(NODES, 1), (GLINT, 1), *eight]


def block_counts(sweep, columns) -> list[dict]:
    """Means of one sample for each footprint: "visited", "closures", "fetches", "hints", and the commonest "mode"."""
    found = counters(sweep.scene, sweep.material)
    lists = []
    for column in range(columns):
        block = sweep_scene.block(column, GLINT)
        means = {name: float(getattr(found, name)[block].mean()) for name in COUNTED}
        modes, numbers = np.unique(found.mode[block], return_counts=True)
        lists.append(means | {"mode": MODES[int(modes[numbers.argmax()])].lower()})
    return lists


def summary(curves) -> dict:
    """The worst of all curves: "ratio" to the nodes, "flatness" (largest / smallest time where far), "eight" / one."""
    rows = [row for each in curves for row in each["rows"]]
    far = [[row["one"] for row in each["rows"] if row["area"] > FAR] for each in curves]
    return {
        "ratio": max(row["ratio"] for row in rows),
        "flatness": max(max(times) / min(times) for times in far if times),
        "eight": max(row["eight_ratio"] for row in rows if "eight_ratio" in row),
    }


def table(results) -> str:
    """The results of `run` as Markdown: what is worst against the goals, then every footprint."""
    worst = results["summary"]
    lines = [
        "| | worst | goal |", "| --- | ---: | ---: |",
        f"| a sample of Glint / of Blender's nodes under OSL | {worst['ratio']:.3g} | {GOALS['ratio']:g} |",
        f"| largest / smallest cost above {FAR} texels | {worst['flatness']:.3g} | {GOALS['flatness']:g} |",
        f"| with {SUNS} hints / with one | {worst['eight']:.3g} | {GOALS['eight']:g} |",
        "",
        f"| map | texels in a footprint | nodes, µs | Glint, µs | ratio | lowest to highest | {SUNS} hints / one | "
        "mode | visited | closures | fetches |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | --- | ---: | ---: | ---: |",
    ]
    for each in results["curves"]:
        lines += [_line(f"{each['map']} {each['texels']}²", row) for row in each["rows"]]
    note = (
        f"One query a pixel, alpha {results['alpha']}, slopes of standard deviation {results['slope']} (bumps "
        f"{results['bump_width']:g} texels wide), suns of half a degree; time of one thread, medians of "
        f"{results['rounds']} rounds. "
    )
    return "\n".join([*lines, "", note + machine_line(results["machine"])])


def _seconds(sweep, column, case, start_up, guess):
    """Of one sample a pixel of a wall; the footprint stays that of one sample a pixel, however many are timed."""
    row, suns = case
    sweep_scene.shine(sweep, suns)
    with sweep_scene.border(sweep.scene, *sweep_scene.block(column, row)):
        return render_cost(sweep.scene, 1, start_up, guess=guess, start_ups=START_UPS).seconds


def _row(area, seconds, counts):
    nodes, one = seconds[NODES, 1], seconds[GLINT, 1]
    ratios = one / nodes
    row = {
        "area": area, "nodes": _microseconds(nodes), "one": _microseconds(one), "ratio": float(np.median(ratios)),
        "low": float(ratios.min()), "high": float(ratios.max()), "counts": counts[1],
    }
    if (GLINT, SUNS) in seconds:
        eight = seconds[GLINT, SUNS]
        row |= {"eight": _microseconds(eight), "eight_ratio": float(np.median(eight / one)),
                "eight_counts": counts[SUNS]}
    return row


def _microseconds(seconds):
    return float(np.median(seconds)) * THREADS / query_scene.SIDE**2 * 1e6


def _line(name, row):
    eight = f"{row['eight_ratio']:.2f}" if "eight_ratio" in row else ""
    found = row["counts"]
    numbers = " | ".join(f"{found[key]:.1f}" for key in ("visited", "closures", "fetches"))
    return (f"| {name} | {row['area']} | {row['nodes']:.2f} | {row['one']:.2f} | {row['ratio']:.2f} | "
            f"{row['low']:.2f} to {row['high']:.2f} | {eight} | {found['mode']} | {numbers} |")


if __name__ == "__main__":
    run_command("sweep", run, table, FILE)
