"""Flakes of production sharpness in a crop of a frame of 1080 lines, 10^4 in a pixel; a floor lit by a small lamp."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1e4  # a pixel, about
SURFACE = {"roughness": 0.05, "interpolation": "CLOSEST"}
TRUTH = "exact"


def normal_map():
    return maps.flakes(1024, std=0.3, seed=45)


def build(scene, material):
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    stage.add_sheet(scene, "Floor", corners, material, repeats=96.0)
    stage.add_camera(scene, (0, -4, 2.4), (0, 0, 0), angle=stage.FRAME_CROP)
    stage.add_lamp(scene, "POINT", (0.3, 3, 2), power=100.0, shadow_soft_size=0.02)
