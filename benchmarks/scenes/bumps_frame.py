"""Smooth bumps in a crop of a frame of 1080 lines, 300 texels in a pixel; sun, plane."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 300.0  # a pixel, about
SURFACE = {"roughness": 0.01**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.bumps(512, std=0.08, width=4.0, seed=46)


def build(scene, material):
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=51.0)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=stage.FRAME_CROP)
    stage.add_sun(scene, (0.05, 1, 1))
