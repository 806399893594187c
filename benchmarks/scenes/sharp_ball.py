"""Flakes of production sharpness on a ball, 10^4 in a pixel; a small lamp."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1e4  # a pixel, about
SURFACE = {"roughness": 0.05, "interpolation": "CLOSEST"}
TRUTH = "exact"


def normal_map():
    return maps.flakes(1024, std=0.3, seed=42)


def build(scene, material):
    stage.add_sphere(scene, material, centre=(0, 0, 0), radius=1.0, repeats=(32.0, 16.0))
    stage.add_camera(scene, (0, -6, 0), (0.14, -0.9, 0.2), angle=0.15)
    stage.add_lamp(scene, "POINT", (2, -4, 2.5), power=100.0, shadow_soft_size=0.02)
