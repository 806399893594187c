"""Far view: a ball of metallic paint, a thousand flakes in a pixel."""

from __future__ import annotations

from . import maps, stage

NAME = "flakes_far"
TITLE = "Flakes, far view: a ball of metallic paint, about 1400 flakes in a pixel"
SPP = 8
TRUTH_SPP = 65536
EXPOSURE = 1.0
SURFACE = {"roughness": 0.12, "interpolation": "CLOSEST", "color": (1.0, 0.25, 0.12)}


def normal_map():
    """Encoded normals: each texel is a flake."""
    return maps.flakes(1024, std=0.5, cell=1, seed=4)


def build(scene, material):
    """The ball in `material`, a sun behind the camera's shoulder, and the camera."""
    stage.add_sphere(scene, material, centre=(0, 0, 0), radius=1.0, repeats=(10, 5))
    stage.add_camera(scene, (0, -6, 0), (0, 0, 0), angle=0.37)
    stage.add_sun(scene, (0.5, -1, 0.6), strength=3.0)
