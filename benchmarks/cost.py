"""What a render costs: seconds without start-up, microseconds a sample of one thread, memory.

A small picture takes milliseconds, less than its start-up varies. So S samples are timed as a render of S * R samples,
R so that it takes long enough, divided by R. The lobe's work depends on the sample count, which reaches its shader
through the group "Glint Lights": there S is pinned while S * R are rendered.
"""

from __future__ import annotations

import contextlib
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy

from demo_scenes import measure
from demo_scenes.stage import THREADS
from glint_addon.bake.openimageio import oiio
from glint_addon.nodes import glint_lights
from glint_addon.nodes.driven import driver_curve

LEAST_SECONDS = 0.4  # of a timed render without start-up: forty times the usual spread of the start-up (10 ms)
START_UPS = 2.0  # and so many times the start-up, if that is more: what is subtracted must be the smaller part
LARGEST_REPEATS = 4096  # R; a render of nothing would else be repeated without end
MOST_RENDERS = 8  # of `repeated_cost`: they average the start-up's spread well enough
PILOT_SPP = 16  # for a first look at the cost of a sample
MEGABYTE = 1 << 20  # Blender stamps memory in these


@dataclass(frozen=True)
class Cost:
    """seconds: of a render of `spp` samples a pixel, without start-up, found from one of spp * repeats samples."""

    spp: int
    repeats: int
    seconds: float
    start_up: float

    def microseconds(self, pixels: int) -> float:
        """Microseconds of one thread for one sample of one of `pixels` pixels."""
        return self.seconds * THREADS / (self.spp * pixels) * 1e6


def render_cost(
    scene, spp: int, start_up: float, *, guess: float | None = None, start_ups: float = START_UPS
) -> Cost:
    """The cost of `spp` samples a pixel of `scene`; guess: seconds they may take, else a pilot render tells.

    start_ups: how many times the start-up the timed render takes at least.
    """
    if guess is None:
        guess = _seconds(scene, spp, 1, start_up)
    repeats = _repeats(guess, start_up, start_ups)
    seconds = _seconds(scene, spp, repeats, start_up)
    if seconds * repeats < least_seconds(start_up, start_ups) / 2 and repeats < LARGEST_REPEATS:
        # The guess was far off: once more, from what is known now.
        repeats = _repeats(seconds, start_up, start_ups)
        seconds = _seconds(scene, spp, repeats, start_up)
    return Cost(spp, repeats, seconds, start_up)


def repeated_cost(scene, spp: int, start_up: float) -> Cost:
    """The same for work that does not grow with the samples (a denoiser): whole renders, one after the other."""
    scene.cycles.samples = spp
    total, repeats = 0.0, 0
    while total < least_seconds(start_up) and repeats < MOST_RENDERS:
        total += max(measure.timed_render(scene)[1] - start_up, measure.CLOCK_NOISE)
        repeats += 1
    return Cost(spp, repeats, total / repeats, start_up)


def _seconds(scene, spp, repeats, start_up):
    """Seconds of `spp` samples a pixel from a render of `repeats` times as many."""
    scene.cycles.samples = spp * repeats
    with pinned_samples(spp):
        total = measure.timed_render(scene)[1]
    scene.cycles.samples = spp
    return max(total - start_up, measure.CLOCK_NOISE) / repeats


def least_seconds(start_up: float, start_ups: float = START_UPS) -> float:
    """Seconds without start-up that a render must take to tell its cost."""
    return max(LEAST_SECONDS, start_ups * start_up)


def _repeats(seconds, start_up, start_ups):
    return min(max(math.ceil(least_seconds(start_up, start_ups) / seconds), 1), LARGEST_REPEATS)


@contextlib.contextmanager
def pinned_samples(spp: int):
    """Let the glint lobe work as for `spp` samples a pixel, whatever the render takes; nothing without a lobe."""
    sockets = [group.nodes[glint_lights.SAMPLES].outputs["Value"] for group in glint_lights.groups()]
    for socket in sockets:
        driver_curve(socket).mute = True
        socket.default_value = spp
    try:
        yield
    finally:
        for socket in sockets:
            driver_curve(socket).mute = False


def peak_memory(scene) -> int:
    """Cycles' own peak memory in bytes, to a megabyte: scene, images, picture, as Blender stamps it on the file.

    Without the program's code and without Blender's copy of the scene.
    """
    scene.render.use_stamp_memory = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "render.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        file = oiio.ImageInput.open(scene.render.filepath)
        try:
            stamped = file.spec().getattribute("Memory")
        finally:
            file.close()
    return int(float(stamped.removesuffix("M")) * MEGABYTE)
