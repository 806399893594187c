"""A hundred texels of smooth bumps in a pixel, seen by an orthographic camera; sun, plane."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 100.0  # a pixel, about
SURFACE = {"roughness": 0.01**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.bumps(512, std=0.08, width=4.0, seed=15)


def build(scene, material):
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=3.0)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), width=1.0)
    stage.add_sun(scene, (0.05, 1, 1))
