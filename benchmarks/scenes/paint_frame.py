"""Metallic paint in a frame of 1080 lines, of which this is a crop: 40 flakes in a pixel, few of which shine; a ball
under the sun."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 40.0  # a pixel, about
SURFACE = {"roughness": 0.005**0.5, "interpolation": "CLOSEST"}
TRUTH = "exact"


def normal_map():
    return maps.flakes(1024, std=0.15, seed=44)


def build(scene, material):
    stage.add_sphere(scene, material, centre=(0, 0, 0), radius=1.0, repeats=(20.0, 10.0))
    stage.add_camera(scene, (0, -6, 0), (0.14, -0.98, 0.17), angle=stage.FRAME_CROP)
    stage.add_sun(scene, (0.35, -0.85, 0.42))
