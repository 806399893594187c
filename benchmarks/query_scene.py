"""One query of the map in each pixel: a wall of squares seen from above, each showing another part of the map.

Every pixel's samples hit the centre of its square (a pixel filter of a hundredth of a pixel), where the map is at a
random place; the scale of the UVs gives the footprint its half-width. So a picture is as many queries as pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np

from demo_scenes import maps, stage
from glint_addon.lights.drivers import connect_hints
from glint_addon.materials.create import create_glint_material
from glint_addon.nodes import glint_lights
from glint_addon.prepare.scene import prepare_scene

SIDE = 24  # pixels
TEXELS = 1024  # of the maps, a side
ALPHA = 0.01
SLOPE = 0.15  # standard deviation of the maps' slopes
BUMP_WIDTH = 8.0  # texels, correlation length of the bumps
HALF_WIDTHS = (1, 3, 6, 12, 24, 48, 96, 128)  # texels: where the footprint's kernel ends
# Slopes of the half vectors of the NDF: one near the middle of the distribution, one a deviation out.
HALF_VECTORS = ((0.05, 0.0), (-0.1, 0.1))
FOOTPRINT_RADIUS = 1.1  # pixels, of one sample: FOOTPRINT_SCALE of osl/footprint.h; a test compares
FILTER_WIDTH = 0.01  # pixels, the narrowest that Cycles allows
PLACES_SEED = 7


@dataclass(frozen=True)
class QueryMap:
    """encoded: normals, square (rows, columns, 3); interpolation: 'LINEAR' or 'CLOSEST'."""

    encoded: np.ndarray
    interpolation: str


def query_map(name, texels=TEXELS) -> QueryMap:
    """The map "bumps" or "flakes", `texels` a side. Raises KeyError for another name."""
    make = {
        "bumps": lambda: QueryMap(maps.bumps(texels, std=SLOPE, width=BUMP_WIDTH, seed=5), "LINEAR"),
        "flakes": lambda: QueryMap(maps.flakes(texels, std=SLOPE, seed=5), "CLOSEST"),
    }
    return make[name]()


MAPS = ("bumps", "flakes")


def places() -> np.ndarray:
    """UV coordinates of the pixels' centres, (SIDE * SIDE, 2) in 0..1; row by row from the bottom."""
    return np.random.default_rng(PLACES_SEED).random((SIDE * SIDE, 2))


def query_scene(kind: QueryMap, half_width, half_vector, *, sun_angle=0.0):
    """(scene, report of `prepare_scene`): the wall in the glint material, and a sun seen in its half vector.

    half_width: of the footprint of one sample a pixel, texels; half_vector: a slope; sun_angle: radians across. The
    sun has an irradiance of 1 W/m^2.
    """
    scene = stage.empty_scene((SIDE, SIDE), 1)
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    scene.cycles.filter_width = FILTER_WIDTH
    material = create_glint_material(
        "Glint", maps.blender_image("Map", kind.encoded), roughness=math.sqrt(ALPHA), interpolation=kind.interpolation
    )
    add_wall(scene, material, half_width / FOOTPRINT_RADIUS / TEXELS)
    camera = stage.add_camera(scene, (SIDE / 2, SIDE / 2, 10), (SIDE / 2, SIDE / 2, 0), angle=1.0)
    camera.data.type, camera.data.ortho_scale = "ORTHO", SIDE
    stage.add_sun(scene, light_direction(half_vector), angle=sun_angle)
    return scene, prepare_scene(scene)


def drop_hints(scene):
    """Take the hints away: the same material is then one closure. The lights stay."""
    connect_hints(glint_lights.build(), scene, [])


def light_direction(half_vector) -> np.ndarray:
    """Direction to the light whose half vector with the view from above has the slope `half_vector`."""
    h = unit_normal(half_vector)
    return 2.0 * h[2] * h - np.array((0.0, 0.0, 1.0))


def unit_normal(slope) -> np.ndarray:
    """Unit normal (3,) of a slope (n.x / n.z, n.y / n.z)."""
    n = np.array((*slope, 1.0))
    return n / np.linalg.norm(n)


def add_wall(scene, material, repeats) -> bpy.types.Object:
    """Unit squares, one for each pixel, around `places()`; `repeats`: of the map in a square."""
    column, row = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    corner = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    lower_left = np.stack([column.ravel(), row.ravel()], axis=-1)[:, None]
    points = np.concatenate([lower_left + corner, np.zeros((SIDE * SIDE, 4, 1))], axis=-1).reshape(-1, 3)
    uvs = places()[:, None] + (corner - 0.5) * repeats
    mesh = bpy.data.meshes.new("Wall")
    mesh.from_pydata(points.tolist(), [], np.arange(len(points)).reshape(-1, 4).tolist())
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uvs.astype(np.float32).ravel())
    mesh.materials.append(material)
    return stage.place(scene, "Wall", mesh)
