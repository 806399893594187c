"""Flakes seen close: each fills several pixels, so that a footprint hardly leaves one; sun, plane."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 0.15  # a pixel, about
SURFACE = {"roughness": 0.03**0.5, "interpolation": "CLOSEST"}


def normal_map():
    return maps.flakes(64, std=0.08, seed=11)


def build(scene, material):
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=0.8)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.5)
    stage.add_sun(scene, (0.05, 1, 1))
