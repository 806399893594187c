"""The scene of the sweep: walls of queries in Blender's nodes and in the glint material, one for each footprint.

The walls (see query_scene.py) stand side by side in one picture, the glint material's above those of Blender's nodes,
and a render's border chooses one. So each table is baked and loaded once: Cycles keeps the scene between renders.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass

import bpy
import numpy as np

from demo_scenes import maps, measure, stage
from demo_scenes.truth import truth_material
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

from .cost import pinned_samples
from .query_scene import ALPHA, FILTER_WIDTH, FOOTPRINT_RADIUS, HALF_VECTORS, SIDE, add_wall, light_direction

AREAS = tuple(4**k for k in range(11))  # texels in the ellipse that one sample of one a pixel covers
NODES, GLINT = 0, 1  # rows of walls, from the bottom
SUNS = 8
RING = 0.15  # slope of the further suns' half vectors: one deviation of the maps' slopes
START_UPS = 3  # renders of a few pixels; their median counts


@dataclass(frozen=True)
class Sweep:
    """scene: both rows of walls, prepared; material: the glint material; suns: of which the first always shines."""

    scene: bpy.types.Scene
    material: bpy.types.Material
    suns: tuple


def build(kind, areas=AREAS) -> Sweep:
    """The scene of a QueryMap with walls for footprints of these `areas`, texels; all eight suns are hinted.

    Raises RuntimeError if a sun got no hint.
    """
    scene = stage.empty_scene((SIDE * len(areas), SIDE * 2), 1)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", FILTER_WIDTH
    image = maps.blender_image("Map", kind.encoded)
    settings = {"roughness": math.sqrt(ALPHA), "interpolation": kind.interpolation}
    materials = {NODES: truth_material("Nodes", image, **settings),
                 GLINT: create_glint_material("Glint", image, **settings)}
    for row, material in materials.items():
        for column, area in enumerate(areas):
            repeats = half_width(area) / FOOTPRINT_RADIUS / kind.encoded.shape[0]
            add_wall(scene, material, repeats).location = (SIDE * column, SIDE * row, 0)
    middle = SIDE * len(areas) / 2, SIDE
    stage.add_camera(scene, (*middle, 10), (*middle, 0), width=SIDE * len(areas))
    suns = tuple(stage.add_sun(scene, light_direction(slope)) for slope in half_vectors())
    report = prepare_scene(scene)
    if len(report["hints"]) != SUNS:
        raise RuntimeError(f"{len(report['hints'])} of {SUNS} suns got hints, so these queries are not to be measured.")
    scene.cycles.shading_system = scene.render.use_persistent_data = True
    return Sweep(scene, materials[GLINT], suns)


def half_width(area) -> float:
    """Half-width in texels of a round footprint of `area` texels."""
    return math.sqrt(area / math.pi)


def half_vectors() -> list[tuple[float, float]]:
    """Slopes of the suns' half vectors: that of the query table, and a ring of others."""
    angles = np.linspace(0.0, 2.0 * math.pi, SUNS - 1, endpoint=False)
    return [HALF_VECTORS[0], *((RING * math.cos(angle), RING * math.sin(angle)) for angle in angles)]


def shine(sweep: Sweep, suns: int):
    """Let only the first `suns` shine; the drivers take the others' hints away."""
    for index, sun in enumerate(sweep.suns):
        sun.hide_render = index >= suns


def block(column, row) -> tuple[slice, slice]:
    """Rows and columns of the picture that show the wall of `AREAS[column]` in a row of walls."""
    return slice(SIDE * row, SIDE * (row + 1)), slice(SIDE * column, SIDE * (column + 1))


@contextlib.contextmanager
def border(scene, rows: slice, columns: slice):
    """Render only these pixels of the picture."""
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x = (x / render.resolution_x for x in (columns.start, columns.stop))
    render.border_min_y, render.border_max_y = (y / render.resolution_y for y in (rows.start, rows.stop))
    try:
        yield
    finally:
        render.use_border = False


def start_up_seconds(sweep: Sweep, row) -> float:
    """Seconds of a render of four pixels of a row of walls, as `render_cost` renders: what it takes before a sample."""
    rows, columns = block(0, row)
    corner = slice(rows.start, rows.start + 2), slice(columns.start, columns.start + 2)
    with border(sweep.scene, *corner):
        times = []
        for _ in range(START_UPS + 1):
            with pinned_samples(1):
                times.append(measure.timed_render(sweep.scene)[1])
    return float(np.median(times[1:]))  # the first loads the tables
