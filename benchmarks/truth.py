"""Stored truths: what Blender's own nodes converge to, as the mean and its variance over independent seeds.

`make truth SCENE=name` renews one: it renders parts until the truth's own noise is small enough (minutes), storing
what it has after each, and goes on where an interrupted run stopped. Scenes that say TRUTH = "exact" are summed texel
by texel instead (`exact.py`): their variance is 0, and no samples and no seeds made them.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from demo_scenes import measure

from . import suite
from .exact import closest_facets, exact_picture

FOLDER = Path(__file__).resolve().parent / "truths"
PART_SPP = 2048  # of one seed: seconds, so that little is lost when a run is stopped
FEWEST_PARTS = 6
NOISE = 0.03  # relative, the most that a truth may have
FIRST_SEED = 1001  # not a seed of any measured picture, or it would share the truth's noise


@dataclass(frozen=True)
class Truth:
    """Linear luminance of a scene, row 0 at the bottom.

    mean, variance (of the mean): float64 (height, width); spp: of one seed; seeds: how many; both 0: summed, not
    rendered; blender: its version; scene_hash: of the scene that was rendered.
    """

    mean: np.ndarray
    variance: np.ndarray
    spp: int
    seeds: int
    blender: str
    scene_hash: str

    @property
    def noise(self) -> float:
        """The truth's own relative root mean square error."""
        return math.sqrt(float(self.variance.mean())) / float(self.mean.mean())


def is_exact(name) -> bool:
    """Whether the truth of scene `name` is a sum, not a render: its module says TRUTH = "exact"."""
    return getattr(suite.scene_module(name), "TRUTH", "rendered") == "exact"


def stored(name) -> Truth:
    """The truth of scene `name`. Raises FileNotFoundError if there is none: `make truth SCENE=name` makes it."""
    return read_truth(_file(name))


def allowed_noise(name) -> float:
    """The most relative noise that the truth of scene `name` may have: NOISE, or the scene's own TRUTH_NOISE."""
    return getattr(suite.scene_module(name), "TRUTH_NOISE", NOISE)


def renew(name, *, noise=None, part_spp=PART_SPP, most_parts=1000) -> Truth:
    """Render parts of scene `name` until its relative noise is at most `noise`, by default what it may have, and store
    the truth; see `converge`. An exact one is summed, whatever the arguments."""
    if is_exact(name):
        mean = summed(name)
        truth = Truth(mean, np.zeros_like(mean), 0, 0, bpy.app.version_string, suite.scene_hash(name))
        _store(_file(name), truth)
        return truth
    noise = allowed_noise(name) if noise is None else noise
    scene_hash = suite.scene_hash(name)
    scene = suite.nodes_scene(name, part_spp)
    return converge(_file(name), scene, scene_hash, noise=noise, part_spp=part_spp, most_parts=most_parts)


def summed(name) -> np.ndarray:
    """Linear luminance (height, width) of scene `name` by the sum over its texels; drops all open data.

    Raises ValueError for a scene that has no such sum.
    """
    scene = suite.scene_with(name, lambda image, **surface: bpy.data.materials.new("Facets"))
    module = suite.scene_module(name)
    return exact_picture(scene, closest_facets(module.normal_map(), **module.SURFACE))


def read_truth(file: Path) -> Truth:
    """The truth stored in `file`. Raises FileNotFoundError if there is none."""
    with np.load(file) as data:
        mean, variance = data["mean"].astype(np.float64), data["variance"].astype(np.float64)
        return Truth(
            mean, variance, int(data["spp"]), int(data["seeds"]), str(data["blender"]), str(data["scene_hash"])
        )


def converge(file: Path, scene, scene_hash, *, noise=NOISE, part_spp=PART_SPP, most_parts=1000) -> Truth:
    """Render parts of `scene` until the relative noise of their mean is at most `noise`; stored in `file` after each.

    Goes on with what the file holds of the same scene, spp and Blender; begins anew otherwise.
    """
    truth = _unfinished(file, part_spp, scene_hash)
    scene.cycles.samples = part_spp
    while truth is None or truth.seeds < FEWEST_PARTS or truth.noise > noise and truth.seeds < most_parts:
        scene.cycles.seed = FIRST_SEED + (truth.seeds if truth else 0)
        part = measure.luminance(measure.rendered(scene))
        truth = _with_part(truth, part, part_spp, scene_hash)
        _store(file, truth)
        sys.stderr.write(f"{file.stem}: {truth.seeds} x {truth.spp} spp, own noise {truth.noise:.4f}\n")
    return truth


def _unfinished(file, part_spp, scene_hash):
    """The truth in `file`, if further parts may be added to it."""
    if not file.is_file():
        return None
    truth = read_truth(file)
    same = (truth.scene_hash, truth.spp, truth.blender) == (scene_hash, part_spp, bpy.app.version_string)
    return truth if same else None


def _with_part(truth, part, part_spp, scene_hash):
    """`truth` with one more picture, by Welford's update (Technometrics 4(3), 1962); of one picture nothing varies."""
    if truth is None:
        return Truth(part, np.zeros_like(part), part_spp, 1, bpy.app.version_string, scene_hash)
    n = truth.seeds
    squares = truth.variance * n * (n - 1)  # sum of squared deviations from the mean
    mean = truth.mean + (part - truth.mean) / (n + 1)
    squares = squares + (part - truth.mean) * (part - mean)
    return Truth(mean, squares / (n * (n + 1)), part_spp, n + 1, truth.blender, truth.scene_hash)


def _store(file, truth):
    """Write the truth, whole or not at all; as 32-bit floats, whose rounding is far below any noise."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(".part.npz")
    np.savez_compressed(
        part,
        mean=truth.mean.astype(np.float32),
        variance=truth.variance.astype(np.float32),
        spp=truth.spp,
        seeds=truth.seeds,
        blender=truth.blender,
        scene_hash=truth.scene_hash,
    )
    part.replace(file)


def _file(name):
    return FOLDER / f"{name}.npz"
