"""A camera that draws back from a plane, from one texel a pixel to a million; and a plane that recedes in one picture.

The camera of the dolly is orthographic, looks straight down, and its picture holds whole repeats of the map at every
step. So the mean brightness is the same at every step, whatever the pixels, and nothing is lost at the picture's edges,
where a footprint reaches over: what changes is an error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np

from demo_scenes import maps, stage

from .query_scene import HALF_VECTORS, TEXELS, light_direction, query_map


@dataclass(frozen=True)
class Variant:
    """alpha of a facet; sun_angle: radians across."""

    alpha: float
    sun_angle: float


@dataclass(frozen=True)
class Step:
    """A square picture `side` pixels wide of `repeats` of the map."""

    side: int
    repeats: int

    @property
    def texels(self) -> float:
        """Texels in a pixel."""
        return (TEXELS * self.repeats / self.side) ** 2


# The facets and the sun of the issue, and wider ones that Blender's nodes soon converge for.
VARIANTS = {"sharp": Variant(0.01, stage.SUN_ANGLE), "soft": Variant(0.05, math.radians(2.0))}
LEAST_SIDE = 24  # pixels
STEP_COUNT = 24
LARGEST_TEXELS = 1e6  # in a pixel, of the last step
PLANE = 64  # metres, one repeat of the map each: more than the largest view
# Where the camera stands, in repeats: no edge of a pixel is one of a texel or of a block of the table.
MIDDLE = (0.137, 0.291)

# The receding plane: from steep to grazing, 4 texels a pixel at the bottom, 60,000 at the top.
SIZE = (72, 160)  # pixels
ELEVATIONS = (math.radians(1.5), math.radians(45.0))  # of the view above the plane, at the picture's top and bottom
TEXELS_A_METRE = 256.0  # the camera is one metre above
FAR = 300.0  # metres: the plane ends behind the picture's top row, which sees 38 metres far, and 60 at its upper edge
RECEDING_SUN = math.radians(20.0)  # elevation, opposite the camera: half vectors within 1.5 deviations of the slopes


def steps(count=STEP_COUNT) -> list[Step]:
    """Steps from one texel in a pixel to LARGEST_TEXELS, evenly spaced in logarithms."""
    found = []
    for scale in np.geomspace(1.0, math.sqrt(LARGEST_TEXELS), count):
        repeats = math.ceil(LEAST_SIDE * scale / TEXELS)
        found.append(Step(round(TEXELS * repeats / scale), repeats))
    return found


STEPS = steps()


def dolly_scene(name, variant: Variant, make_material) -> bpy.types.Scene:
    """The plane with map `name` in `make_material(image, roughness=, interpolation=)`, seen as in the first step."""
    scene = stage.empty_scene((LEAST_SIDE, LEAST_SIDE), 1)
    half = PLANE / 2
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    stage.add_sheet(scene, "Plane", corners, _material(name, variant, make_material), repeats=PLANE)
    stage.add_camera(scene, (*MIDDLE, 10.0), (*MIDDLE, 0.0), width=1.0)
    stage.add_sun(scene, light_direction(HALF_VECTORS[0]), angle=variant.sun_angle)
    show(scene, STEPS[0])
    return scene


def show(scene, step: Step):
    """Move the camera of a dolly to a step."""
    scene.render.resolution_x = scene.render.resolution_y = step.side
    scene.camera.data.ortho_scale = step.repeats


def receding_scene(name, make_material) -> bpy.types.Scene:
    """A plane with map `name` from below the camera to the horizon, in the wide variant, against the sun."""
    variant = VARIANTS["soft"]
    scene = stage.empty_scene(SIZE, 1)
    corners = [(-FAR, 0, 0), (FAR, 0, 0), (FAR, FAR, 0), (-FAR, FAR, 0)]
    plane = stage.add_sheet(scene, "Plane", corners, _material(name, variant, make_material))
    for corner, (x, y, _) in zip(plane.data.uv_layers.active.uv, corners, strict=True):
        corner.vector = x * TEXELS_A_METRE / TEXELS, y * TEXELS_A_METRE / TEXELS
    middle = sum(ELEVATIONS) / 2
    target = (0.0, math.cos(middle), 1.0 - math.sin(middle))
    stage.add_camera(scene, (0, 0, 1), target, angle=ELEVATIONS[1] - ELEVATIONS[0])
    stage.add_sun(scene, (0, math.cos(RECEDING_SUN), math.sin(RECEDING_SUN)), angle=variant.sun_angle)
    return scene


def row_elevations() -> np.ndarray:
    """Elevation of the view above the plane for each row of the receding picture, from the bottom; radians."""
    low, high = ELEVATIONS
    place = (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2.0 - 1.0
    return (low + high) / 2 - np.arctan(place * math.tan((high - low) / 2))


def row_texels() -> np.ndarray:
    """Texels in a pixel in the middle of each row of the receding picture, from the bottom."""
    low, high = ELEVATIONS
    elevations = row_elevations()
    # A pixel's angle is smaller off the axis: by the cosine across the picture, by its square along it.
    from_axis = np.cos(elevations - (low + high) / 2)
    pixel = 2.0 * math.tan((high - low) / 2) / SIZE[1]
    return pixel**2 * from_axis**3 / np.sin(elevations) ** 3 * TEXELS_A_METRE**2


def _material(name, variant, make_material):
    kind = query_map(name)
    image = maps.blender_image("Map", kind.encoded)
    return make_material(image, roughness=math.sqrt(variant.alpha), interpolation=kind.interpolation)
