"""Large surfaces whose map repeats hundreds of times: Repeat, which shows its tiles, beside Shuffle."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import glint_addon

from . import measure, picture, preset_stage, showcase, stage

NAME = "endless"
SIZE = (960, 540)
SPP = 8
VARIATIONS = ("REPEAT", "SHUFFLE")
PANEL = (4.0, 1.4)  # metres


def draw(out: Path, size=SIZE, spp=SPP):
    """Write `out`/endless.png: a row for each surface, a column for each variation."""
    rows = []
    for title, build in SURFACES.items():
        panels = [(variation.title(), showcase.seen(rendered(build, variation, size, spp))) for variation in VARIATIONS]
        rows.append((title, panels, 1.0))
    picture.save_rows(out / f"{NAME}.png", rows)


def rendered(build, variation, size=SIZE, spp=SPP) -> np.ndarray:
    """Scene-linear pixels of a surface of SURFACES."""
    scene = stage.empty_scene(size, spp)
    build(scene, variation)
    glint_addon.prepare_scene(scene)
    return measure.rendered(scene)


def build_panel(scene, variation):
    """A bent panel in the paint Metallic Red."""
    # From right to left, so that the faces look to the camera.
    across, up = np.meshgrid(np.linspace(1, -1, 120), np.linspace(-1, 1, 60))
    bend = 0.25 * (1 - across**2) + 0.2 * (1 - up**2)
    places = np.stack([PANEL[0] / 2 * across, -bend, PANEL[1] / 2 * (up + 1) + 0.1], axis=-1)
    material = glint_addon.create_glint_material("Paint", preset="Metallic Red", variation=variation)
    showcase.grid_object(scene, "Panel", places, material, uvs=places[..., [0, 2]])
    preset_stage.add_table(scene)
    stage.add_sun(scene, (-0.35, -1.0, 0.75), strength=2.0, color=(1.0, 0.94, 0.86))
    preset_stage.add_gradient_sky(scene)
    stage.add_camera(scene, (0.6, -4.2, 1.3), (0.0, 0.0, 0.75), angle=0.9)


def build_field(scene, variation):
    """A flat field of Fresh Snow, seen over 20 m against a low sun."""
    material = glint_addon.create_glint_material("Snow", preset="Fresh Snow", variation=variation)
    side = 20.0
    corners = [(-side, 0, 0), (side, 0, 0), (side, side, 0), (-side, side, 0)]
    stage.add_sheet(scene, "Field", corners, material, repeats=side)
    stage.add_sun(scene, (0.1, 1.0, 0.42), strength=2.2, color=(1.0, 0.9, 0.76))
    preset_stage.add_gradient_sky(scene)
    stage.add_camera(scene, (0.0, -0.4, 1.5), (0.0, 4.0, 0.0), angle=0.9)


SURFACES = {"A car panel of 4 m, Metallic Red": build_panel, "A field of 20 m, Fresh Snow": build_field}
