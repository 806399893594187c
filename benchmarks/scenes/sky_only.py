"""A bumpy ball under a clear sky without its sun: no small light at all, so nothing to gain and nothing to lose."""

from __future__ import annotations

import math

from demo_scenes import maps, stage

SMALL_LIGHTS = False
TEXELS = 100.0  # a pixel, about
SURFACE = {"roughness": 0.03**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.bumps(512, std=0.15, width=4.0, seed=22)


def build(scene, material):
    stage.add_sphere(scene, material, centre=(0, 0, 0), radius=1.0, repeats=(2.4, 1.2))
    stage.add_camera(scene, (0, -6, 0), (0, 0, 0), angle=0.38)
    stage.add_sky(scene, sun_elevation=math.radians(25))
