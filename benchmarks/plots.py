"""Plots of the results: error against time for each scene, and the speed-up of all scenes in one picture."""

from __future__ import annotations

import matplotlib
import numpy as np
from PIL import Image

matplotlib.use("Agg")  # no window, and the same picture everywhere

import matplotlib.pyplot as plt  # noqa: E402  (after the choice above)

from .headline import SHOWN_SPP, median_ratio, sorted_speed_ups  # noqa: E402
from .methods import METHODS  # noqa: E402
from .record import ROOT  # noqa: E402

FOLDER = ROOT / "benchmarks" / "plots"
SUMMARY = ROOT / "docs" / "benchmark"
# Colours that colour-blind eyes tell apart (Okabe, Ito: Color Universal Design, 2008), and markers for print.
STYLES = {
    "nodes": ("#000000", "o"),
    "nodes_cached": ("#E69F00", "s"),
    "widened": ("#009E73", "^"),
    "denoised": ("#CC79A7", "D"),
    "lobe": ("#0072B2", "*"),
}
PALETTE = 256  # colours of a PNG: enough for thin lines with soft edges, and half of the bytes
SETTINGS = {
    "svg.hashsalt": "glint",  # else ids are random and each drawing is a change
    "svg.fonttype": "none",  # text stays text
    "font.size": 8,
    "figure.dpi": 140,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def draw_all(results, lines):
    """Write FOLDER/NAME.png and .svg for each scene, and SUMMARY.png and .svg. lines: the scenes' headlines."""
    FOLDER.mkdir(exist_ok=True)
    SUMMARY.parent.mkdir(exist_ok=True)
    by_name = {line.scene: line for line in lines}
    with plt.rc_context(SETTINGS):
        for name, result in results["scenes"].items():
            _save(scene_figure(name, result, by_name[name]), FOLDER / name)
        _save(summary_figure(lines), SUMMARY)


def scene_figure(name, result, line):
    """Relative RMSE against seconds, both logarithmic, one curve a method; the truth's own noise as a line,
    if it has any.

    Errors below that noise say nothing and are drawn on its line. A hollow circle shows where Blender's nodes reach the
    lobe's error at SHOWN_SPP samples; dotted: extrapolated.
    """
    figure, axes = plt.subplots(figsize=(4.6, 3.4), layout="constrained")
    floor = result["truth"]["noise"]
    for method in METHODS:
        rows = [row for row in result["rows"] if row["method"] == method.name]
        color, marker = STYLES[method.name]
        seconds, errors = [row["seconds"] for row in rows], [max(row["rmse"], floor) for row in rows]
        axes.plot(seconds, errors, color=color, marker=marker, markersize=7 if marker == "*" else 4, linewidth=1.2,
                  label=method.label)
    if floor > 0.0:
        axes.axhline(floor, color="0.6", linewidth=0.8, linestyle="--", label="truth's own noise")
    _draw_equal_error(axes, result, line.shown)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("seconds without start-up")
    axes.set_ylabel("relative RMSE")
    axes.set_title(f"{name}: about {result['texels']:g} texels in a pixel", fontsize=9)
    axes.grid(True, which="major", linewidth=0.3)
    axes.legend(fontsize=6.5, frameon=False)
    return figure


def summary_figure(lines):
    """How many times longer Blender's nodes take to the lobe's error: one dot a scene, sorted, logarithmic."""
    by_name = {line.scene: line for line in lines}
    ordered = sorted_speed_ups(lines, SHOWN_SPP)
    figure, axes = plt.subplots(figsize=(6.4, 0.9 + 0.24 * len(ordered)), layout="constrained")
    for place, found in enumerate(ordered):
        color = STYLES["lobe"][0] if by_name[found.scene].small_lights else "0.5"
        axes.plot([1.0, found.ratio], [place, place], color=color, linewidth=1.0)
        face = "white" if found.extrapolated else color
        axes.plot(found.ratio, place, "o", color=color, markerfacecolor=face, markersize=6)
        gains = found.ratio >= 1.0
        axes.annotate(f"{found.ratio:.3g}", (found.ratio, place), xytext=(8 if gains else -8, 0), fontsize=7,
                      textcoords="offset points", va="center", ha="left" if gains else "right")
    axes.axvline(1.0, color="0.3", linewidth=0.8)
    middle = median_ratio(ordered)
    axes.axvline(middle, color="#D55E00", linewidth=1.0, linestyle="--")
    axes.annotate(f"median {middle:.3g}", (middle, -0.6), xytext=(3, 0), textcoords="offset points", color="#D55E00",
                  va="center", fontsize=7)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.margins(x=0.12)
    axes.set_ylim(-1, len(ordered) - 0.5)
    axes.set_yticks(range(len(ordered)), [f"{each.scene} ({by_name[each.scene].texels:g})" for each in ordered])
    axes.set_xlabel(f"time of Blender's nodes to Glint's error at {SHOWN_SPP} spp, in units of Glint's time")
    axes.set_title("Scenes (texels in a pixel); blue: small lights only; hollow: extrapolated", fontsize=8)
    return figure


def _draw_equal_error(axes, result, found):
    nodes = [row for row in result["rows"] if row["method"] == "nodes"]
    last = max(nodes, key=lambda row: row["spp"])
    color = STYLES["nodes"][0]
    if found.extrapolated:
        end = max(last["rmse"], result["truth"]["noise"])
        axes.plot([last["seconds"], found.nodes_seconds], [end, found.error], color=color, linewidth=1.0, linestyle=":")
    axes.plot(found.nodes_seconds, found.error, "o", color=color, markerfacecolor="white", markersize=7,
              label=f"nodes at Glint's error ({SHOWN_SPP} spp){', extrapolated' if found.extrapolated else ''}")


def _save(figure, stem):
    """Write a PNG and an SVG that are the same bytes for the same figure."""
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])
    picture.quantize(PALETTE).save(stem.with_suffix(".png"), optimize=True)
    figure.savefig(stem.with_suffix(".svg"), metadata={"Date": None, "Creator": None})
    plt.close(figure)
