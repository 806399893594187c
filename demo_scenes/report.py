"""The demo's table: printed, stored as JSON, and put into the marked block of this folder's README."""

from __future__ import annotations

import json
import math
import os
import platform
import shutil
from dataclasses import asdict
from pathlib import Path

import bpy

import glint_addon

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "demo_scenes" / "README.md"
DOCS = ROOT / "docs"
BEGIN, END = "<!-- demo table: begin -->", "<!-- demo table: end -->"
GUIDE = DOCS / "guide.md"
PRESETS_BEGIN, PRESETS_END = "<!-- presets: begin -->", "<!-- presets: end -->"
DOCS_PICTURES = ("glint_before_after", "flakes_close", "flakes_far", "scratches_close", "brushed_far", "three_ways")


def table(rows) -> str:
    """A Markdown table of Measurements: seconds without start-up, error and bias relative to the truth's mean."""
    lines = [
        "| picture | method | spp | seconds | relative RMSE | bias |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
    ]
    for row in rows:
        seconds = "stored" if math.isnan(row.seconds) else f"{row.seconds:.2f}"
        bias = "" if math.isnan(row.seconds) else f"{row.bias:+.1%}"
        lines.append(f"| {row.picture} | {row.method} | {row.spp} | {seconds} | {row.rmse:.3f} | {bias} |")
    return "\n".join([*lines, "", machine()])


def machine() -> str:
    """One line: Blender's version, processor and threads, so that seconds can be judged."""
    return f"Blender {bpy.app.version_string}, {os.cpu_count()} CPU cores ({platform.machine()})."


def save(rows, file):
    """Write the measurements as JSON; seconds of a stored truth are null."""
    values = [{key: None if value != value else value for key, value in asdict(row).items()} for row in rows]
    Path(file).write_text(json.dumps({"machine": machine(), "rows": values}, indent=1) + "\n", encoding="utf-8")


def update_readme(text, out):
    """Replace the README's marked block by `text` and copy the pictures it shows from `out` into docs/.

    Raises ValueError if the README has no such block.
    """
    _replace_block(README, BEGIN, END, text)
    DOCS.mkdir(exist_ok=True)
    for name in DOCS_PICTURES:
        if (out / f"{name}.png").is_file():
            shutil.copy(out / f"{name}.png", DOCS / f"{name}.png")


def update_guide():
    """Replace the list of presets in docs/guide.md by that of their files. Raises ValueError without such a block."""
    _replace_block(GUIDE, PRESETS_BEGIN, PRESETS_END, preset_list())


def preset_list() -> str:
    """A Markdown table of all presets: category, name, what it is, and how large one repeat of its map is."""
    lines = ["| kind | preset | what it is | repeat |", "| --- | --- | --- | ---: |"]
    lines += [f"| {each.category} | {each.name} | {each.description} | {100 * each.scale:g} cm |"
              for each in glint_addon.presets().values()]
    return "\n".join(lines)


def _replace_block(file, begin, end, text):
    whole = file.read_text(encoding="utf-8")
    if whole.count(begin) != 1 or whole.count(end) != 1:
        raise ValueError(f"{file.name} needs one block between {begin} and {end}: put the marks back.")
    before, rest = whole.split(begin)
    file.write_text(f"{before}{begin}\n{text}\n{end}{rest.split(end)[1]}", encoding="utf-8")
