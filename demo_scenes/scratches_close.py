"""Close-up: scratched metal, each scratch about a pixel wide."""

from __future__ import annotations

from . import maps, stage

NAME = "scratches_close"
TITLE = "Scratched metal, close-up"
SPP = 16
TRUTH_SPP = 32768
EXPOSURE = 1.0
SURFACE = {"roughness": 0.14, "interpolation": "LINEAR", "color": (0.9, 0.92, 1.0)}


def normal_map():
    """Encoded normals of scratches in all directions."""
    return maps.scratches(1024, count=700, width=7.0, length=250.0, std=0.22, spread=10.0, seed=5)


def build(scene, material):
    """The sheet in `material`, the sun mirrored to the camera beside the picture's centre, and the camera."""
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=1.5)
    stage.add_camera(scene, (0, -1.6, 1.6), (0, 0, 0), angle=0.5)
    stage.add_sun(scene, (-0.12, 1, 0.8), strength=0.05)
