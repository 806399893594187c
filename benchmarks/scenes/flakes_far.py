"""The highlight of a small lamp on a ball of metallic paint, 10^5 flakes in a pixel."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1e5  # a pixel, about
SURFACE = {"roughness": 0.03**0.5, "interpolation": "CLOSEST"}


def normal_map():
    return maps.flakes(1024, std=0.2, seed=13)


def build(scene, material):
    stage.add_sphere(scene, material, centre=(0, 0, 0), radius=1.0, repeats=(100.0, 50.0))
    stage.add_camera(scene, (0, -6, 0), (0.14, -0.9, 0.2), angle=0.15)
    stage.add_lamp(scene, "POINT", (2, -4, 2.5), power=100.0, shadow_soft_size=0.05)
