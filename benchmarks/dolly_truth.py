"""The truth of the dolly and the receding plane: Blender's own nodes with many samples, stored beside this file.

`python -m benchmarks.dolly --renew-truth` renders it again (ten minutes).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from demo_scenes import measure
from demo_scenes.truth import truth_material

from . import dolly_scene
from .query_scene import MAPS
from .temporal_truth import rounded

FILE = Path(__file__).resolve().parent / "dolly_truth.npz"
# The mean is that of a whole repeat of the map, the same at every step; here 96 x 96 pixels see it.
STEP = dolly_scene.Step(96, 1)
PARTS = 6  # independent renders of each
# Samples a pixel of a part: the mean is then known to 0.15 %, pixels of the receding plane to 5 %.
PART_SPP = {"sharp": 2048, "soft": 512, "receding": 512}
FIRST_SEED = 701  # none that a measured picture has
BANDS = 20  # of the receding picture, eight rows each


@dataclass(frozen=True)
class Mean:
    """Mean luminance of pictures, and its standard deviation; scalars, or one for each band."""

    value: np.ndarray
    deviation: np.ndarray


@dataclass(frozen=True)
class Receding:
    """picture: luminance (height, width), row 0 at the bottom; bands: Mean of each, from the bottom; spp: of all."""

    picture: np.ndarray
    bands: Mean
    spp: int


def nodes_material(image, **surface):
    """The material of the truth."""
    return truth_material("Nodes", image, **surface)


def pictures(scene, spp, seeds) -> np.ndarray:
    """Luminance (seeds, height, width) of renders with these seeds, `spp` samples a pixel each."""
    scene.cycles.samples = spp
    renders = []
    for scene.cycles.seed in seeds:
        renders.append(measure.luminance(measure.rendered(scene)))
    return np.stack(renders)


def picture_mean(renders) -> Mean:
    """Mean of renders (seeds, height, width) of one scene; its noise is that of pixels from seed to seed."""
    variance = renders.var(axis=0, ddof=1).mean() / len(renders) / renders[0].size
    return Mean(renders.mean(), math.sqrt(variance))


def band_means(renders) -> Mean:
    """The same of each of BANDS horizontal bands of the picture, from the bottom."""
    means = [picture_mean(band) for band in np.array_split(renders, BANDS, axis=1)]
    return Mean(np.array([mean.value for mean in means]), np.array([mean.deviation for mean in means]))


def stored_mean(name, variant) -> Mean:
    """Mean of map `name` in the dolly. Raises FileNotFoundError if there is none: renew it."""
    with np.load(FILE) as data:
        return Mean(*data[f"{name}_{variant}"])


def stored_receding(name) -> Receding:
    """The receding plane with map `name`. Raises FileNotFoundError if there is none: renew it."""
    with np.load(FILE) as data:
        spp = PARTS * int(data["receding_spp"])
        return Receding(data[f"{name}_receding"].astype(np.float64), Mean(*data[f"{name}_bands"]), spp)


def renew(part_spp=None, parts=PARTS):
    """Render and store all of it."""
    spp = part_spp or PART_SPP
    seeds = range(FIRST_SEED, FIRST_SEED + parts)
    values = {"blender": bpy.app.version_string, "receding_spp": spp["receding"]}
    for name in MAPS:
        for key, variant in dolly_scene.VARIANTS.items():
            scene = nodes_scene(dolly_scene.dolly_scene(name, variant, nodes_material))
            dolly_scene.show(scene, STEP)
            mean = picture_mean(pictures(scene, spp[key], seeds))
            values[f"{name}_{key}"] = np.array([mean.value, mean.deviation])
        scene = nodes_scene(dolly_scene.receding_scene(name, nodes_material))
        renders = pictures(scene, spp["receding"], seeds)
        bands = band_means(renders)
        values[f"{name}_receding"] = rounded(renders.mean(axis=0))
        values[f"{name}_bands"] = np.stack([bands.value, bands.deviation])
    unfinished = FILE.with_suffix(".part.npz")
    np.savez_compressed(unfinished, **values)
    unfinished.replace(FILE)


def nodes_scene(scene) -> bpy.types.Scene:
    """The same scene without Open Shading Language, where Blender's nodes are fastest."""
    scene.cycles.shading_system = False
    return scene
