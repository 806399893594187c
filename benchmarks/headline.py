"""Headline figures: how much longer Blender's nodes take to the lobe's error, and how true its energy is."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

from .law import Law, fitted_law, samples_to

HEADLINE_SPP = 4  # samples of the lobe whose error Blender's nodes are to reach
FIRST_SPP = 1  # the same for one sample, which Cycles puts in the pixel's middle: its footprint covers the pixel best
BIAS_SPP = 64  # samples at which its energy is judged; the largest measured if there are fewer


@dataclass(frozen=True)
class Headline:
    """Of one scene. Seconds without start-up, errors relative, microseconds a sample of one thread.

    error: the lobe's at HEADLINE_SPP, never below the truth's own noise, under which nothing is known;
    nodes_seconds: what Blender's nodes take to `error`; extrapolated, by their law: beyond what was measured;
    first_speed_up, first_extrapolated: the speed-up at FIRST_SPP.
    """

    scene: str
    texels: float
    small_lights: bool
    error: float
    lobe_seconds: float
    nodes_seconds: float
    extrapolated: bool
    law: Law
    bias: float
    bias_spp: int
    bias_noise: float
    lobe_microseconds: float
    nodes_microseconds: float
    nodes_osl_microseconds: float
    first_speed_up: float
    first_extrapolated: bool

    @property
    def speed_up(self) -> float:
        return self.nodes_seconds / self.lobe_seconds

    @property
    def sample_ratio(self) -> float:
        """Cost of a sample of the lobe in those of Blender's nodes under Open Shading Language."""
        return self.lobe_microseconds / self.nodes_osl_microseconds


def headline(name, result) -> Headline:
    """The headline figures of the stored result of scene `name`. ValueError: rows that it needs are missing."""
    nodes = [row for row in result["rows"] if row["method"] == "nodes"]
    lobe = {row["spp"]: row for row in result["rows"] if row["method"] == "lobe"}
    if len(nodes) < 2 or HEADLINE_SPP not in lobe or FIRST_SPP not in lobe:
        raise ValueError(f"The result of {name} is incomplete: run python -m benchmarks run --only {name}.")
    shown, first = lobe[HEADLINE_SPP], lobe[FIRST_SPP]
    law = fitted_law([(row["spp"], row["seeds"], row["rmse"]) for row in nodes])
    error, first_error = (max(row["rmse"], result["truth"]["noise"]) for row in (shown, first))
    most = max(nodes, key=lambda row: row["spp"])
    sample_seconds = most["seconds"] / most["spp"]
    judged = lobe[BIAS_SPP if BIAS_SPP in lobe else max(lobe)]
    return Headline(
        name, result["texels"], result["small_lights"], error, shown["seconds"],
        nodes_seconds=samples_to(law, error) * sample_seconds, extrapolated=error < min(law.rmse), law=law,
        bias=judged["bias"], bias_spp=judged["spp"], bias_noise=judged["bias_noise"],
        lobe_microseconds=shown["microseconds"], nodes_microseconds=most["microseconds"],
        nodes_osl_microseconds=result["nodes_osl_microseconds"],
        first_speed_up=samples_to(law, first_error) * sample_seconds / first["seconds"],
        first_extrapolated=first_error < min(law.rmse),
    )


def headlines(results) -> list[Headline]:
    """Those of all scenes of a results file, in its order."""
    return [headline(name, result) for name, result in results["scenes"].items()]


def median_speed_up(lines) -> tuple[float, bool]:
    """The median speed-up, and whether one in its middle was extrapolated."""
    ordered = sorted(lines, key=lambda line: line.speed_up)
    middle = ordered[(len(ordered) - 1) // 2 : len(ordered) // 2 + 1]
    return median(line.speed_up for line in ordered), any(line.extrapolated for line in middle)


def median_first_speed_up(lines) -> tuple[float, bool]:
    """The median speed-up at FIRST_SPP, and whether any was extrapolated."""
    return median(line.first_speed_up for line in lines), any(line.first_extrapolated for line in lines)


def worst_speed_up(lines) -> Headline:
    return min(lines, key=lambda line: line.speed_up)


def best_speed_up(lines) -> Headline:
    return max(lines, key=lambda line: line.speed_up)


def worst_bias(lines) -> Headline:
    return max(lines, key=lambda line: abs(line.bias))
