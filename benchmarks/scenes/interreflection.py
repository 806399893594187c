"""A ball of flakes in a white room: the lamp shines on the ceiling, all light is reflected by walls first."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = False
TEXELS = 300.0  # a pixel, about
SURFACE = {"roughness": 0.03**0.5, "interpolation": "CLOSEST"}


def normal_map():
    return maps.flakes(512, std=0.15, seed=23)


def build(scene, material):
    stage.add_room(scene, stage.diffuse_material("Back", stage.WHITE), left=(0.7, 0.1, 0.1), lamp_power=0.0)
    stage.add_sphere(scene, material, centre=(0, 0, 0.8), radius=0.8, repeats=(4.0, 2.0))
    stage.add_lamp(scene, "AREA", (0, -0.9, 1.2), (0, -0.9, 2), power=30.0, size=0.3)
