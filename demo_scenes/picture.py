"""Pictures of the demo: linear renders side by side with labels, as PNG files, or JPEG where the name ends in .jpg."""

from __future__ import annotations

from pathlib import Path

import blf
import imbuf
import numpy as np

MARGIN = 6  # pixels between panels
TEXT_SIZE = 13
LINE_HEIGHT = 19
BACKGROUND = 24  # 0..255, dark so that glints are judged against black
FONT = 0  # Blender's own
QUALITY = 80  # of JPEG files, 0..100


def save_side_by_side(file, panels, *, title="", scale=1, exposure=1.0):
    """Write labelled panels in a row to the PNG `file`.

    panels: (label, pixels) pairs; a label may have several lines; pixels are scene-linear (height, width, 3 or more),
    row 0 at the bottom, all of one size. Each pixel becomes `scale` x `scale`, brightness is multiplied by `exposure`,
    and the view is Blender's Standard (sRGB curve, clipped at 1).
    Raises OSError if the file cannot be written.
    """
    save_rows(file, [(title, panels, exposure)], scale=scale)


def save_rows(file, rows, *, scale=1):
    """Write rows of labelled panels, all of the same width, to the PNG `file`, the first at the top.

    rows: (title, panels, exposure), of which `save_side_by_side` writes one. Raises OSError as that does.
    """
    _write(file, np.concatenate([_row(title, panels, scale, exposure) for title, panels, exposure in reversed(rows)]))


def save_picture(file, pixels, quality=QUALITY):
    """Write one picture without a frame, as `save_side_by_side` shows it. Raises OSError as that does."""
    _write(file, standard_view(pixels), quality)


def standard_view(pixels) -> np.ndarray:
    """Scene-linear values as Blender's Standard view shows them: uint8, the sRGB curve, clipped at 1."""
    linear = np.clip(np.asarray(pixels, np.float64), 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return (curve * 255 + 0.5).astype(np.uint8)


def _row(title, panels, scale, exposure):
    lines = max(len(label.splitlines()) for label, _ in panels)
    columns = [_panel(label, pixels, lines, scale, exposure) for label, pixels in panels]
    gap = np.full((len(columns[0]), MARGIN, 3), BACKGROUND, np.uint8)
    row = np.concatenate([part for column in columns for part in (gap, column)] + [gap], axis=1)
    edge = np.full((MARGIN, row.shape[1], 3), BACKGROUND, np.uint8)
    heading = [_text(title, row.shape[1])] if title else []
    return np.concatenate([edge, row, edge, *heading])


def _panel(label, pixels, lines, scale, exposure):
    shown = standard_view(np.asarray(pixels)[..., :3] * exposure).repeat(scale, axis=0).repeat(scale, axis=1)
    texts = label.splitlines() + [""] * (lines - len(label.splitlines()))
    # Row 0 is the bottom, so the last line of the label comes first.
    return np.concatenate([*(_text(text, shown.shape[1]) for text in reversed(texts)), shown])


def _text(text, width):
    """One line of text, uint8 (LINE_HEIGHT, width, 3), row 0 at the bottom."""
    strip = imbuf.new((width, LINE_HEIGHT))
    blf.size(FONT, TEXT_SIZE)
    blf.color(FONT, 1.0, 1.0, 1.0, 1.0)
    with blf.bind_imbuf(FONT, strip):
        blf.position(FONT, 2, 5, 0)
        blf.draw_buffer(FONT, text)
    with strip.with_buffer() as buffer:
        coverage = np.array(buffer)[..., 3:] / 255.0
    strip.free()
    return (BACKGROUND + (230 - BACKGROUND) * coverage).astype(np.uint8).repeat(3, axis=2)


def _write(file, pixels, quality=QUALITY):
    height, width = pixels.shape[:2]
    whole = imbuf.new((width, height))
    with whole.with_buffer(write=True) as buffer:
        np.asarray(buffer)[...] = np.dstack([pixels, np.full((height, width), 255, np.uint8)])
    is_jpeg = Path(file).suffix == ".jpg"
    whole.file_type = "JPEG" if is_jpeg else "PNG"
    if is_jpeg:
        whole.quality = quality
    else:
        whole.compress = 100
    Path(file).parent.mkdir(parents=True, exist_ok=True)
    imbuf.write(whole, filepath=str(file))
    whole.free()
