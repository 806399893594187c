"""Far view: a metal disc brushed in circles, a thousand texels and more in a pixel."""

from __future__ import annotations

from . import maps, stage

NAME = "brushed_far"
TITLE = "Brushed disc, far view: about 2000 texels in a pixel"
SPP = 4
TRUTH_SPP = 32768
EXPOSURE = 0.4
SURFACE = {"roughness": 0.1414, "interpolation": "LINEAR", "color": (0.9, 0.92, 1.0)}


def normal_map():
    """Encoded normals of streaks along u, which runs around the disc."""
    return maps.brushed(1024, std=0.15, width=1.5, length=80.0, seed=6)


def build(scene, material):
    """The disc in `material`, a sun beside the mirror direction, so that the highlight is a bow, and the camera."""
    stage.add_disc(scene, material, repeats=(8, 1.5))
    stage.add_camera(scene, (0, -6, 8), (0, 0, 0), angle=0.21)
    stage.add_sun(scene, (1, 3, 4), strength=0.1)
