"""Headline figures: how much longer Blender's nodes take to the lobe's error, and how true its energy is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median

import numpy as np

from .law import Law, fitted_law, samples_to

# Samples a pixel of the lobe whose error Blender's nodes are to reach: one, which Cycles puts in the pixel's middle,
# a preview, and what is rendered.
HEADLINE_SPP = (1, 4, 16, 64, 256)
SHOWN_SPP = 4  # those of them in the plots and of the cost of a sample; every result has them
FLIP_SPP = (4, 64)  # those at which HDR-FLIP is compared, of a preview and of a final picture
# By how much the times of Blender's nodes may fall short of the lobe's and count as the same: clocks differ so much.
TIME_SPREAD = 1.2
BIAS_SPP = 64  # samples at which its energy is judged; the largest measured if there are fewer


@dataclass(frozen=True)
class SpeedUp:
    """Of one scene at `spp` samples of the lobe. Seconds without start-up.

    error: the lobe's, relative; never below the truth's own noise, under which nothing is known;
    is_bound: it would be below, so that the nodes take `nodes_seconds` at least;
    nodes_seconds: what Blender's nodes take to `error`; extrapolated, by their law: beyond what was measured.
    """

    scene: str
    spp: int
    error: float
    is_bound: bool
    lobe_seconds: float
    nodes_seconds: float
    extrapolated: bool

    @property
    def ratio(self) -> float:
        return self.nodes_seconds / self.lobe_seconds


@dataclass(frozen=True)
class FlipPair:
    """Mean HDR-FLIP of the lobe, and of Blender's nodes in the lobe's time, where their budgets reach so far."""

    lobe: float
    nodes: float | None


@dataclass(frozen=True)
class Headline:
    """Of one scene. Errors relative, microseconds a sample of one thread.

    speed_ups: by samples, those of HEADLINE_SPP that were measured, SHOWN_SPP always; flips: those of FLIP_SPP.
    """

    scene: str
    texels: float
    small_lights: bool
    speed_ups: dict[int, SpeedUp]
    flips: dict[int, FlipPair]
    law: Law
    bias: float
    bias_spp: int
    bias_noise: float
    lobe_microseconds: float
    nodes_microseconds: float
    nodes_osl_microseconds: float

    @property
    def shown(self) -> SpeedUp:
        """The speed-up at SHOWN_SPP."""
        return self.speed_ups[SHOWN_SPP]

    @property
    def sample_ratio(self) -> float:
        """Cost of a sample of the lobe in those of Blender's nodes under Open Shading Language."""
        return self.lobe_microseconds / self.nodes_osl_microseconds


def headline(name, result) -> Headline:
    """The headline figures of the stored result of scene `name`. ValueError: rows that it needs are missing."""
    nodes = [row for row in result["rows"] if row["method"] == "nodes"]
    lobe = {row["spp"]: row for row in result["rows"] if row["method"] == "lobe"}
    if len(nodes) < 2 or SHOWN_SPP not in lobe:
        raise ValueError(f"The result of {name} is incomplete: run python -m benchmarks run --only {name}.")
    law = fitted_law([(row["spp"], row["seeds"], row["rmse"]) for row in nodes])
    most = max(nodes, key=lambda row: row["spp"])
    noise, sample_seconds = result["truth"]["noise"], most["seconds"] / most["spp"]
    judged = lobe[BIAS_SPP if BIAS_SPP in lobe else max(lobe)]
    return Headline(
        name, result["texels"], result["small_lights"],
        speed_ups={spp: _speed_up(name, lobe[spp], law, noise, sample_seconds) for spp in HEADLINE_SPP if spp in lobe},
        flips={spp: FlipPair(lobe[spp]["flip"], flip_after(nodes, lobe[spp]["seconds"]))
               for spp in FLIP_SPP if "flip" in lobe.get(spp, ())},
        law=law, bias=judged["bias"], bias_spp=judged["spp"], bias_noise=judged["bias_noise"],
        lobe_microseconds=lobe[SHOWN_SPP]["microseconds"], nodes_microseconds=most["microseconds"],
        nodes_osl_microseconds=result["nodes_osl_microseconds"],
    )


def _speed_up(name, row, law, noise, sample_seconds):
    """That of the lobe's `row` over nodes of a Law whose sample takes `sample_seconds`; noise: the truth's own."""
    error = max(row["rmse"], noise)
    return SpeedUp(
        name, row["spp"], error, is_bound=row["rmse"] < noise, lobe_seconds=row["seconds"],
        nodes_seconds=samples_to(law, error) * sample_seconds, extrapolated=error < min(law.rmse),
    )


def flip_after(rows, seconds) -> float | None:
    """Mean HDR-FLIP of a method's `rows` after `seconds`, linear in the time's logarithm; None: not measured there."""
    known = sorted((row["seconds"], row["flip"]) for row in rows if "flip" in row)
    if not known or not known[0][0] / TIME_SPREAD <= seconds <= known[-1][0] * TIME_SPREAD:
        return None
    times, flips = zip(*known, strict=True)
    return float(np.interp(math.log(seconds), np.log(times), flips))


def headlines(results) -> list[Headline]:
    """Those of all scenes of a results file, in its order."""
    return [headline(name, result) for name, result in results["scenes"].items()]


def sorted_speed_ups(lines, spp) -> list[SpeedUp]:
    """Those of the scenes that were measured at `spp` samples, the worst first."""
    found = [line.speed_ups[spp] for line in lines if spp in line.speed_ups]
    return sorted(found, key=lambda each: each.ratio)


def middle_speed_ups(ordered) -> list[SpeedUp]:
    """The one or two in the middle of sorted speed-ups, whose mean is the median."""
    return ordered[(len(ordered) - 1) // 2 : len(ordered) // 2 + 1]


def median_ratio(ordered) -> float:
    """The median of at least one speed-up."""
    return median(each.ratio for each in ordered)


def median_flips(lines, spp) -> tuple[FlipPair, int] | None:
    """The medians of both over the scenes that have both at `spp` samples, and how many these are."""
    pairs = [line.flips[spp] for line in lines if spp in line.flips and line.flips[spp].nodes is not None]
    if not pairs:
        return None
    return FlipPair(median(pair.lobe for pair in pairs), median(pair.nodes for pair in pairs)), len(pairs)


def worst_bias(lines) -> Headline:
    return max(lines, key=lambda line: abs(line.bias))
