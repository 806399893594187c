"""A few hundred flakes in a pixel, each a spark of its own; sun, plane."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 300.0  # a pixel, about
SURFACE = {"roughness": 0.01**0.5, "interpolation": "CLOSEST"}


def normal_map():
    return maps.flakes(512, std=0.08, seed=12)


def build(scene, material):
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=4.0)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.5)
    stage.add_sun(scene, (0.05, 1, 1))
