"""A disc brushed in circles, 150 texels in a pixel, under two small lights at once."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 150.0  # a pixel, about
SURFACE = {"roughness": 0.01**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.brushed(512, std=0.1, width=1.5, length=60.0, seed=17)


def build(scene, material):
    stage.add_disc(scene, material, hole=0.2, repeats=(2.0, 0.4))
    stage.add_camera(scene, (0, -5, 5), (0, 0, 0), angle=0.28)
    stage.add_sun(scene, (0.12, 1, 1), strength=0.2)
    stage.add_lamp(scene, "POINT", (-1, 4.5, 5), power=300.0, shadow_soft_size=0.04)
