"""Bumps seen close, a pixel smaller than a texel: the slope changes along the pixel; spot lamp, sharp facets."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 0.3  # a pixel, about
SURFACE = {"roughness": 0.003**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.bumps(128, std=0.05, width=3.0, seed=14)


def build(scene, material):
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=0.25)
    stage.add_camera(scene, (0, -6, 6), (0, 0, 0), angle=0.13)
    stage.add_lamp(scene, "SPOT", (0, 8, 8), power=2000.0, shadow_soft_size=0.1, spot_size=0.15)
