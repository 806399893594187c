"""A sheet brushed along the view, at eighty degrees, 10^4 texels in a pixel, very sharp streaks; sun."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1e4  # a pixel, about
SURFACE = {"roughness": 0.003**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.brushed(1024, std=0.12, width=1.5, length=80.0, seed=18)


def build(scene, material):
    corners = [(8, -8, 0), (8, 8, 0), (-8, 8, 0), (-8, -8, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=26.0)
    stage.add_camera(scene, (0, -30, 5.3), (0, 0, 0), angle=0.04)
    stage.add_sun(scene, (0, 30, 5.3), strength=0.1)
