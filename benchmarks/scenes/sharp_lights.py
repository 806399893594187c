"""Flakes of production sharpness with the long tails of GGX, 10^4 in a pixel, under two suns and two lamps."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1e4  # a pixel, about
SURFACE = {"roughness": 0.05, "interpolation": "CLOSEST", "distribution": "GGX"}
TRUTH = "exact"


def normal_map():
    return maps.flakes(1024, std=0.3, seed=43)


def build(scene, material):
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=11.5)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.5)
    stage.add_sun(scene, (0.05, 1, 1))
    stage.add_sun(scene, (-0.8, 0.3, 1), strength=2.0)
    stage.add_lamp(scene, "POINT", (1.5, 2, 2.5), power=150.0, shadow_soft_size=0.03)
    stage.add_lamp(scene, "POINT", (-1, -0.5, 3), power=100.0, shadow_soft_size=0.02)
