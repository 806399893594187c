"""Close-up: a sheet of metallic flakes, each several pixels wide."""

from __future__ import annotations

from . import maps, stage

NAME = "flakes_close"
TITLE = "Flakes, close-up: each flake is several pixels wide"
SPP = 16
TRUTH_SPP = 16384
EXPOSURE = 1.0
SURFACE = {"roughness": 0.2, "interpolation": "CLOSEST", "color": (1.0, 0.72, 0.35)}


def normal_map():
    """Encoded normals of Voronoi flakes."""
    return maps.flakes(512, std=0.13, cell=8, seed=3)


def build(scene, material):
    """The sheet in `material`, the sun where its centre mirrors it to the camera, and the camera."""
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    stage.add_sheet(scene, "Sheet", corners, material)
    stage.add_camera(scene, (0, -1.6, 1.6), (0, 0, 0), angle=0.5)
    stage.add_sun(scene, (0, 1, 1), strength=0.12)
