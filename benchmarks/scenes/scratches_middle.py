"""Scratched metal, 75 texels in a pixel; spot lamp, plane."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 75.0  # a pixel, about
SURFACE = {"roughness": 0.01**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.scratches(512, count=400, width=5.0, length=200.0, std=0.12, spread=10.0, seed=19)


def build(scene, material):
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=1.2)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.4)
    stage.add_lamp(scene, "SPOT", (0.6, 6, 6), power=1000.0, shadow_soft_size=0.08, spot_size=0.4)
