"""Paint of production sharpness: flakes with slopes of 0.3 and lobes of a seventh of a degree, 10^4 of them in a pixel,
of which one or two shine; sun, plane."""

from __future__ import annotations

from demo_scenes import maps, stage

SMALL_LIGHTS = True
TEXELS = 1e4  # a pixel, about
SURFACE = {"roughness": 0.05, "interpolation": "CLOSEST"}
TRUTH = "exact"  # Blender's nodes would need 10^7 samples a pixel


def normal_map():
    return maps.flakes(1024, std=0.3, seed=41)


def build(scene, material):
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    stage.add_sheet(scene, "Sheet", corners, material, repeats=11.5)
    stage.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.5)
    stage.add_sun(scene, (0.05, 1, 1))
