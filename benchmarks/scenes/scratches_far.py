"""The highlight of a small area lamp on a scratched ball, 10^4 texels in a pixel."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1e4  # a pixel, about
SURFACE = {"roughness": 0.03**0.5, "interpolation": "LINEAR"}


def normal_map():
    return maps.scratches(512, count=400, width=5.0, length=200.0, std=0.15, spread=10.0, seed=20)


def build(scene, material):
    stage.add_sphere(scene, material, centre=(0, 0, 0), radius=1.0, repeats=(62.0, 31.0))
    stage.add_camera(scene, (0, -6, 0), (-0.19, -0.9, 0.23), angle=0.15)
    stage.add_lamp(scene, "AREA", (-2, -4, 2.5), power=50.0, size=0.1)
