"""The truth of the two sequences: Blender's own nodes with many samples, stored beside this file.

`python -m benchmarks.temporal --renew-truth` renders it again (a quarter of an hour).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from demo_scenes.truth import truth_material

from . import temporal_scenes

FILE = Path(__file__).resolve().parent / "temporal_truth.npz"
PARTS = 8  # independent renders of each sequence
PART_SPP = 2048
FIRST_SEED = 501  # none that a measured picture has, or it would share the truth's noise
MANTISSA_BITS = 7  # kept of the stored pixels: rounding by 0.2 % (rms), a tenth of the noise, packs into 100 kB


@dataclass(frozen=True)
class SequenceTruth:
    """Linear luminance, float64: mean (frames, height, width), and variance of the mean of each pixel (height, width),
    averaged over the frames."""

    mean: np.ndarray
    variance: np.ndarray
    spp: int
    seeds: int
    blender: str

    @property
    def noise(self) -> float:
        """The truth's own relative RMSE."""
        return float(np.sqrt(self.variance.mean()) / self.mean.mean())


def nodes_scene(name) -> bpy.types.Scene:
    """Sequence `name` in Blender's own nodes without Open Shading Language, where they are fastest."""
    scene = temporal_scenes.scene_with(name, lambda image, **surface: truth_material("Nodes", image, **surface))
    scene.cycles.shading_system = False
    return scene


def stored(name) -> SequenceTruth:
    """The truth of sequence `name`. Raises FileNotFoundError if there is none: renew it."""
    with np.load(FILE) as data:
        return SequenceTruth(
            data[f"{name}_mean"].astype(np.float64), data[f"{name}_variance"].astype(np.float64),
            int(data["spp"]), int(data["seeds"]), str(data["blender"]),
        )


def renew(parts=PARTS, part_spp=PART_SPP):
    """Render and store the truth of both sequences: `parts` seeds of `part_spp` samples a pixel."""
    values = {"spp": part_spp * parts, "seeds": parts, "blender": bpy.app.version_string}
    for name in temporal_scenes.NAMES:
        scene = nodes_scene(name)
        pictures = np.stack([temporal_scenes.pictures(scene, part_spp, FIRST_SEED + part) for part in range(parts)])
        variance = pictures.var(axis=0, ddof=1).mean(axis=0) / parts
        values[f"{name}_mean"] = rounded(pictures.mean(axis=0))
        values[f"{name}_variance"] = variance.astype(np.float16)
    unfinished = FILE.with_suffix(".part.npz")
    np.savez_compressed(unfinished, **values)
    unfinished.replace(FILE)


def rounded(values) -> np.ndarray:
    """`values` as 16-bit floats with MANTISSA_BITS bits of mantissa, rounded to nearest."""
    mantissa, exponent = np.frexp(np.asarray(values, np.float64))
    scale = 2.0 ** (MANTISSA_BITS + 1)  # frexp's mantissa lies in 0.5..1
    return np.ldexp(np.round(mantissa * scale) / scale, exponent).astype(np.float16)
