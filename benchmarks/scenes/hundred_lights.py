"""A hundred small lamps at random over four tilted sheets and a ball, each with a material and lights of its own.

Direct light alone: what surfaces throw on each other is the subject of another scene.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 500.0  # a pixel, about
SURFACE = {"roughness": 0.03**0.5, "interpolation": "CLOSEST"}
TRUTH_NOISE = 0.09  # errors here are from one to eight: Cycles asks one lamp of a hundred for each sample
LAMPS = 100
RADIUS = 0.04  # metres: about a degree across
SEED = 31


def normal_map():
    return maps.flakes(512, std=0.1, seed=30)


def build(scene, material):
    for x, y in product((-1, 1), (-1, 1)):
        sheet = stage.add_sheet(scene, f"Sheet {x} {y}", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)],
                                material.copy(), repeats=1.0)
        sheet.location = (1.05 * x, 1.05 * y, 0)
        sheet.rotation_euler = (math.radians(-6 * y), math.radians(6 * x), 0)
    stage.add_sphere(scene, material, centre=(0, 0, 0.8), radius=0.5, repeats=(2.0, 1.0))
    stage.add_camera(scene, (0, -6, 5), (0, 0, 0.2), angle=0.5)
    add_lamps(scene)
    scene.cycles.max_bounces = 0


def add_lamps(scene, count=LAMPS):
    """Small lamps over the stage, from a watt to fifty, as many dim as bright ones."""
    generator = np.random.default_rng(SEED)
    for _ in range(count):
        x, y, z = generator.uniform((-4, -4, 2.5), (4, 4, 5))
        power = math.exp(generator.uniform(0.0, math.log(50.0)))
        stage.add_lamp(scene, "POINT", (x, y, z), power=power, shadow_soft_size=RADIUS)
