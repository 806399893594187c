"""Smooth bumps in a crop of a frame of 1080 lines, 15 texels in a pixel, about one bump; a small lamp, plane."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 15.0  # a pixel, about
SURFACE = {"roughness": 0.01**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.bumps(512, std=0.08, width=4.0, seed=47)


def build(scene, material):
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=11.4)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=stage.FRAME_CROP)
    stage.add_lamp(scene, "POINT", (0.1, 3, 3), power=100.0, shadow_soft_size=0.03)
