"""Truth scenes: small pictures whose right answer is what Blender's own nodes converge to, stored beside the tests.

`python -m tests.helpers.truth NAME [SPP SEEDS]` renders one anew (minutes). tests/truths/NAME.npz holds the mean over
independent seeds of the linear luminance, its variance per pixel, and how it was made.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from demo_scenes import maps
from demo_scenes.truth import truth_material
from glint_addon.material import create_glint_material
from glint_addon.prepare import prepare_scene

from . import cycles

FOLDER = Path(__file__).resolve().parent.parent / "truths"
SIZE = 64  # pixels a side


@dataclass(frozen=True)
class TruthScene:
    """A shape with a normal map and a small light. alpha = roughness^2; texels: about so many a pixel."""

    pixels: str  # name of a function below
    shape: str
    light: str
    alpha: float
    interpolation: str
    texels: int


SCENES = {
    "plane_closest": TruthScene("flakes", "plane", "sun", 0.02, "CLOSEST", 1000),
    "plane_linear": TruthScene("bumps", "plane", "sun", 0.01, "LINEAR", 1000),
    "sphere_linear": TruthScene("bumps", "sphere", "point", 0.02, "LINEAR", 1000),
}


def flakes():
    return maps.flakes(512, std=0.2, seed=1)


def bumps():
    return maps.bumps(512, std=0.15, width=4.0, seed=2)


def build(name: str):
    """The scene `name`, empty of materials: (scene, object, image)."""
    kind = SCENES[name]
    scene = cycles.empty_scene(size=(SIZE, SIZE))
    image = maps.blender_image(kind.pixels, globals()[kind.pixels]())
    if kind.shape == "plane":
        # Larger than the view, so that no pixel is half empty.
        thing = cycles.add_plane(scene, 4.0, repeats=8.0)
        cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    else:
        # Near its highlight: where it is dark, Blender's nodes have nothing to converge to but rare sparks.
        thing = _sphere(scene, repeats=12.0)
        cycles.add_camera(scene, (0, -4, 0.5), (0.2, -0.8, 0.4), angle=0.3)
    if kind.light == "sun":
        cycles.add_sun(scene, (0.05, 1, 1), angle=math.radians(0.5))
    else:
        _point_light(scene, (1.5, -3, 2.5), radius=0.05, power=50.0)
    return scene, thing, image


def with_nodes(name: str):
    """The scene with Blender's own nodes."""
    kind = SCENES[name]
    scene, thing, image = build(name)
    thing.data.materials.append(
        truth_material("Truth", image, roughness=math.sqrt(kind.alpha), interpolation=kind.interpolation)
    )
    return scene


def with_lobe(name: str):
    """The scene with the glint material, prepared."""
    kind = SCENES[name]
    scene, thing, image = build(name)
    thing.data.materials.append(
        create_glint_material("Glint", image, roughness=math.sqrt(kind.alpha), interpolation=kind.interpolation)
    )
    prepare_scene(scene)
    return scene


def luminance(scene, spp: int, seed: int) -> np.ndarray:
    """Mean of the linear RGB of a render, float64 (SIZE, SIZE)."""
    scene.cycles.samples = spp
    scene.cycles.seed = seed
    return cycles.rendered(scene)[..., :3].mean(axis=2, dtype=np.float64)


def stored(name: str):
    """The truth of a scene: (mean, variance of the mean), float64 (SIZE, SIZE)."""
    with np.load(FOLDER / f"{name}.npz") as data:
        return data["mean"].astype(np.float64), data["variance"].astype(np.float64)


def relative_rmse(picture, truth, variance=0.0) -> float:
    """Root of the mean squared difference, less the truth's own variance, in units of the truth's mean."""
    square = np.mean((picture - truth) ** 2) - np.mean(variance)
    return math.sqrt(max(square, 0.0)) / truth.mean()


def energy_bias(picture, truth) -> float:
    """Mean brightness above the truth's, relative."""
    return picture.mean() / truth.mean() - 1.0


def render_truth(name: str, spp: int, seeds: int):
    """Render and store a truth from `seeds` independent pictures of `spp` samples of Blender's nodes."""
    scene = with_nodes(name)
    scene.cycles.shading_system = False  # the same nodes, without the cost of OSL
    pictures = np.stack([luminance(scene, spp, 1000 + seed) for seed in range(seeds)])
    variance = pictures.var(axis=0, ddof=1) / seeds
    FOLDER.mkdir(exist_ok=True)
    np.savez_compressed(
        FOLDER / f"{name}.npz",
        mean=pictures.mean(axis=0).astype(np.float32),
        variance=variance.astype(np.float16) if variance.max() < 6e4 else variance.astype(np.float32),
        spp=spp,
        seeds=seeds,
        blender=bpy.app.version_string,
    )
    noise = math.sqrt(variance.mean()) / pictures.mean()
    sys.stderr.write(f"{name}: {seeds} x {spp} spp, relative noise {noise:.4f}\n")


def _sphere(scene, repeats):
    """A smooth UV sphere whose UVs run 0..2 repeats around and 0..repeats from pole to pole."""
    thing = cycles.add_sphere(scene)
    layer = thing.data.uv_layers.active
    uvs = np.empty(2 * len(layer.uv), np.float32)
    layer.uv.foreach_get("vector", uvs)
    layer.uv.foreach_set("vector", (uvs.reshape(-1, 2) * (2 * repeats, repeats)).astype(np.float32).ravel())
    return thing


def _point_light(scene, location, *, radius, power):
    data = bpy.data.lights.new("Point", "POINT")
    data.shadow_soft_size = radius
    data.energy = power
    thing = bpy.data.objects.new("Point", data)
    thing.location = location
    scene.collection.objects.link(thing)
    return thing


if __name__ == "__main__":
    arguments = sys.argv[1:]
    spp, seeds = (int(arguments[1]), int(arguments[2])) if len(arguments) == 3 else (16384, 16)
    render_truth(arguments[0], spp, seeds)
