"""All presets on one stage: a picture of each, a contact sheet in docs/, and the thumbnails that come with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import glint_addon
from glint_addon import paths

from . import measure, picture, preset_stage
from .report import DOCS

SIZE = 512  # pixels a side
SPP = 64
COLUMNS = 3  # presets in a row of the sheet
CELL = 192  # pixels a side of a picture there
THUMBNAIL = 128
KEPT_COLOR = 0.6  # share of a bright colour's own hue; the rest turns white, as in film and eye
SHOULDER = 0.6  # brightness from which on highlights are compressed, as film does


def draw(out: Path, names=(), *, size=SIZE, spp=SPP, keep=True):
    """Render the presets `names`, or all, into `out`/presets: ball and close-up side by side. All of them also make the
    contact sheet docs/presets.jpg; keep: write thumbnails beside the presets."""
    chosen = names or tuple(glint_addon.presets())
    cells = []
    for name in chosen:
        ball, close = (seen(rendered(name, size=(size, size), spp=spp, close=close)) for close in (False, True))
        width = preset_stage.close_width(glint_addon.presets()[name])
        labels = f"{name}: 10 cm", f"{1000 * width:.0f} mm"
        picture.save_side_by_side(out / "presets" / f"{file_name(name)}.png",
                                  list(zip(labels, (ball, close), strict=True)))
        cells.append((labels, ball, close))
        if keep:
            picture.save_picture(paths.preset_folder() / f"{file_name(name)}.jpg", smaller(ball, THUMBNAIL))
    if not names:
        save_sheet(DOCS / "presets.jpg", cells)


def save_sheet(file: Path, cells):
    """Write the contact sheet: rows of COLUMNS presets, of each the ball and the close-up; cells: (labels, both)."""
    rows = []
    for start in range(0, len(cells), COLUMNS):
        panels = [(label, smaller(pixels, CELL)) for labels, *both in cells[start:start + COLUMNS]
                  for label, pixels in zip(labels, both, strict=True)]
        blank = ("", np.zeros((CELL, CELL, 3)))
        rows.append(("", panels + [blank] * (2 * COLUMNS - len(panels)), 1.0))
    picture.save_rows(file, rows)


def rendered(name, **options) -> np.ndarray:
    """Scene-linear pixels of a preset on its stage; options as `preset_stage.build` takes."""
    scene = preset_stage.build(name, **options)
    glint_addon.prepare_scene(scene)
    return measure.rendered(scene)


def seen(pixels) -> np.ndarray:
    """Scene-linear values as film shows them: highlights are compressed from SHOULDER on, some of their colour kept."""
    peak = np.maximum(pixels.max(axis=-1, keepdims=True), 1e-6)
    return KEPT_COLOR * pixels / peak * _compressed(peak) + (1 - KEPT_COLOR) * _compressed(pixels)


def _compressed(values):
    room = 1 - SHOULDER
    return np.where(values < SHOULDER, values, 1 - room * np.exp(-(np.maximum(values, SHOULDER) - SHOULDER) / room))


def smaller(pixels, side) -> np.ndarray:
    """A square picture at `side` pixels: means of the areas that each pixel covers."""
    edges = np.linspace(0, len(pixels), side + 1)
    whole = np.concatenate([np.zeros((1, *pixels.shape[1:])), np.cumsum(pixels, axis=0)])
    for _ in range(2):
        # The integral up to each edge, between two rows in proportion; then the same of columns.
        low = np.minimum(edges.astype(int), len(whole) - 2)
        part = (edges - low)[:, None, None]
        means = np.diff(whole[low] * (1 - part) + whole[low + 1] * part, axis=0) / (edges[1] - edges[0])
        pixels = np.swapaxes(means, 0, 1)
        whole = np.concatenate([np.zeros((1, *pixels.shape[1:])), np.cumsum(pixels, axis=0)])
    return pixels


def file_name(name: str) -> str:
    """Name of a preset's files, without their ending."""
    return name.lower().replace(" ", "_")
