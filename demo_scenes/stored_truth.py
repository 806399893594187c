"""Truth pictures stored beside the scenes: three minutes of demo do not suffice for 10^4 samples a pixel and more.

`python -m demo_scenes --renew-truth NAME` renders one again with Blender's own nodes, in up to a quarter of an hour.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import maps, measure, stage
from .truth import truth_material

FOLDER = Path(__file__).resolve().parent / "truths"
PARTS = 8  # independent renders; even ones make one half, odd ones the other
FIRST_SEED = 101  # not the demo's own seed, or a render of nodes would share the truth's noise


@dataclass(frozen=True)
class StoredTruth:
    """pixels: scene-linear RGB (height, width, 3), row 0 at the bottom; spp in all; noise: its own relative RMSE."""

    pixels: np.ndarray
    spp: int
    noise: float


def stored_truth(name) -> StoredTruth:
    """The truth of scene `name`. Raises FileNotFoundError if there is none: renew it."""
    with np.load(FOLDER / f"{name}.npz") as data:
        return StoredTruth(data["pixels"].astype(np.float32), int(data["spp"]), float(data["noise"]))


def renew_truth(scene_module, size) -> StoredTruth:
    """Render the truth of a comparison scene with its TRUTH_SPP samples a pixel in all, and store it."""
    parts = [truth_part(scene_module, size, index) for index in range(PARTS)]
    return store_truth(scene_module, parts)


def truth_part(scene_module, size, index) -> np.ndarray:
    """Part `index` of PARTS: Blender's own nodes with a share of the samples and a seed of its own."""
    scene = stage.empty_scene(size, scene_module.TRUTH_SPP // PARTS)
    scene.cycles.seed = FIRST_SEED + index
    image = maps.blender_image("Normal map", scene_module.normal_map())
    scene_module.build(scene, truth_material("Truth", image, **scene_module.SURFACE))
    return measure.rendered(scene)


def store_truth(scene_module, parts) -> StoredTruth:
    """Store the mean of the parts; its noise is half the difference of the means of even and odd parts.

    Stored as 16-bit floats, whose rounding (0.05 %) is far below the noise.
    """
    even, odd = np.mean(parts[::2], axis=0), np.mean(parts[1::2], axis=0)
    mean = (even + odd) / 2
    difference = measure.luminance(even) - measure.luminance(odd)
    noise = np.sqrt(np.mean(difference**2)) / 2 / measure.luminance(mean).mean()
    FOLDER.mkdir(exist_ok=True)
    values = {"pixels": mean.astype(np.float16), "spp": scene_module.TRUTH_SPP, "noise": noise}
    np.savez_compressed(FOLDER / f"{scene_module.NAME}.npz", **values, seeds=FIRST_SEED + np.arange(PARTS))
    return stored_truth(scene_module.NAME)
