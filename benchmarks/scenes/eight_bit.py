"""A map of eight bits, whose slopes come in steps of 1/127, a thousand texels in a pixel; sun, plane."""

from __future__ import annotations

import numpy as np

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1000.0  # a pixel, about
SURFACE = {"roughness": 0.01**0.5, "interpolation": "LINEAR"}


def normal_map():
    return np.round(maps.bumps(512, std=0.06, width=4.0, seed=21) * 255) / np.float32(255)


def build(scene, material):
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=7.0)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.5)
    stage.add_sun(scene, (0.05, 1, 1))
