"""Seed figure: a glossy sphere before and after it gets the glint normal map."""

from __future__ import annotations

import glint_addon

from . import maps, stage

NAME = "glint_before_after"
TITLE = "Before and after the glint normal map"
SPP = 64
DENOISE = False  # a denoiser takes glints for noise
COLOR = (1.0, 0.75, 0.45)
ROUGHNESS = 0.15


def build(scene, glints=True):
    """The room with a metal sphere, lit by the lamp and by a sun from the camera's side; with or without the map."""
    wall = stage.diffuse_material("Wall", (0.1, 0.12, 0.16))
    stage.add_room(scene, wall, left=(0.5, 0.08, 0.06), right=(0.08, 0.3, 0.1), lamp_power=8.0)
    if glints:
        image = maps.blender_image("Flakes", maps.flakes(1024, std=0.25, cell=1, seed=9))
        material = glint_addon.create_glint_material(
            "Glint", image, roughness=ROUGHNESS, interpolation="CLOSEST", color=COLOR
        )
    else:
        material = stage.glossy_material("Glossy", COLOR, ROUGHNESS)
    stage.add_sphere(scene, material, repeats=(4, 2))
    stage.add_sun(scene, (-0.5, -1, 0.7), strength=1.0)


def panels(rendered):
    """(label, pixels) pairs; rendered(**options) renders `build(scene, **options)`."""
    return [("Before: a glossy sphere", rendered(glints=False)), ("After: the same with glints", rendered())]
