"""Bumps far away on a floor seen at a grazing angle, 10^5 texels in a pixel; small area lamp."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1e5  # a pixel, about
SURFACE = {"roughness": 0.03**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.bumps(1024, std=0.12, width=4.0, seed=16)


def build(scene, material):
    corners = [(-20, -20, 0), (20, -20, 0), (20, 20, 0), (-20, 20, 0)]
    stage.add_sheet(scene, "Floor", corners, material, repeats=250.0)
    stage.add_camera(scene, (0, -6, 0.8), (0, 0, 0), angle=0.25)
    stage.add_lamp(scene, "AREA", (0.3, 5, 0.8), power=50.0, size=0.1)
