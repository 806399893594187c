"""All at once: a ball of flakes on a white floor under sun, lamp and sky, its glints also thrown on the floor."""

from __future__ import annotations

import math

from demo_scenes import maps, stage

SMALL_LIGHTS = False
TEXELS = 1000.0  # a pixel, about
SURFACE = {"roughness": 0.03**0.5, "interpolation": "CLOSEST"}


def normal_map():
    return maps.flakes(512, std=0.12, seed=24)


def build(scene, material):
    corners = [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)]
    stage.add_sheet(scene, "Floor", corners, stage.diffuse_material("White"))
    stage.add_sphere(scene, material, centre=(0, 0, 1), radius=1.0, repeats=(8.0, 4.0))
    stage.add_camera(scene, (0, -6, 2), (0, 0, 0.9), angle=0.4)
    stage.add_sun(scene, (0.6, -1, 0.9), strength=0.5)
    stage.add_lamp(scene, "POINT", (-2, -4, 2.5), power=60.0, shadow_soft_size=0.05)
    stage.add_sky(scene, sun_elevation=math.radians(25), strength=0.05)
