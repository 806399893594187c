"""Render to an array, time it without its start-up, and compare it with the truth."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

CLOCK_NOISE = 0.001  # seconds below which a time says nothing
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear Rec. 709, Blender's default working space


def rendered(scene) -> np.ndarray:
    """Render `scene`: scene-linear RGB, float32 (height, width, 3), row 0 at the bottom."""
    settings = scene.render.image_settings
    settings.file_format = "OPEN_EXR"
    settings.color_mode = "RGB"
    settings.color_depth = "32"
    settings.exr_codec = "ZIP"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "render.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(scene.render.filepath)
        try:
            width, height = image.size
            pixels = np.empty(width * height * image.channels, np.float32)
            image.pixels.foreach_get(pixels)
        finally:
            bpy.data.images.remove(image)
    return pixels.reshape(height, width, -1)[..., :3].copy()


def timed_render(scene) -> tuple[np.ndarray, float]:
    """The picture and the seconds it took, start-up (see `start_up_seconds`) included."""
    start = time.perf_counter()
    pixels = rendered(scene)
    return pixels, time.perf_counter() - start


def start_up_seconds(scene, repeats=3) -> float:
    """Seconds before the first sample: export, BVH, shader compilation, file; the median of `repeats`.

    Measured as the render of four pixels of the same picture at the same settings, whose samples take no time.
    """
    render = scene.render
    width, height = render.resolution_x, render.resolution_y
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.5 - 1 / width, 0.5 + 1 / width
    render.border_min_y, render.border_max_y = 0.5 - 1 / height, 0.5 + 1 / height
    try:
        return float(np.median([timed_render(scene)[1] for _ in range(repeats)]))
    finally:
        render.use_border = False


def luminance(pixels) -> np.ndarray:
    """Linear luminance (height, width) of scene-linear RGB (height, width, 3)."""
    return np.asarray(pixels, np.float64)[..., :3] @ LUMINANCE


def relative_rmse(pixels, truth) -> float:
    """Root mean square difference of the linear luminance, in units of the truth's mean."""
    x, t = luminance(pixels), luminance(truth)
    return float(np.sqrt(np.mean((x - t) ** 2)) / t.mean())


def bias(pixels, truth) -> float:
    """Relative error of the picture's mean linear luminance: 0.01 is one percent too bright."""
    return float(luminance(pixels).mean() / luminance(truth).mean() - 1)
