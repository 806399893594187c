"""One small stage for every kind of light: four tiles, flakes and bumps, each at a middle and at a far distance.

All lights stand in one direction, where the stage mirrors them to the camera, shine on it about as strongly and, where
nothing else is said, are about as wide as the sun: what differs between two rows of a table is the kind of light.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import bpy
import numpy as np
from mathutils import Vector

from demo_scenes import maps, stage
from demo_scenes.truth import truth_material
from glint_addon.materials.create import create_glint_material

from .suite import scene_digest

SIDE = 32  # pixels of the picture; a tile has a quarter of them
MAP_SIDE = 512  # texels
SLOPE = 0.15  # standard deviation: of 300 texels about three mirror the sun to the camera
MAPS = {  # from the left
    "flakes": ("CLOSEST", lambda: maps.flakes(MAP_SIDE, std=SLOPE, seed=41)),
    "bumps": ("LINEAR", lambda: maps.bumps(MAP_SIDE, std=SLOPE, width=3.0, seed=42)),
}
DISTANCES = {"middle": 300.0, "far": 1e4}  # texels in a pixel, about; from the bottom
ROUGHNESS = 0.02**0.5
NODES, LOBE = "nodes", "lobe"

CAMERA = (0.0, -4.0, 4.0)
WIDTH = 2.0  # metres across the view
SHEET = 2.0  # metres, a side of each tile's sheet, which reaches beyond the picture
LIGHT = Vector((0.1, 4.0, 4.0)).normalized()  # of every light; its half vector is near the normal of the stage
DISTANCE = 6.0  # metres, of lights that have a place
PLACE = LIGHT * DISTANCE
RADIUS = DISTANCE * math.tan(stage.SUN_ANGLE / 2)  # metres: as wide as the sun, seen from the middle of the stage
FLUX = 4.0 * math.pi * DISTANCE**2  # watts of a lamp that shines to all sides, for 1 W/m^2 on the stage

HDRI_HEIGHT = 512  # pixels; twice as wide
HDRI_SUN = math.radians(1.5)  # across, four pixels: images spread a sun over some
HDRI_SKY = (0.03, 0.08)  # W/m^2/sr at the horizon and at the zenith: a sixth of the light
SKY_STRENGTH = 0.01  # the Sky Texture is in units of its own


@dataclass(frozen=True)
class LightStage:
    """scene: with one light; sheets: (object, name of its map) of each tile; materials: {method: {name of map: it}}."""

    scene: bpy.types.Scene
    sheets: tuple
    materials: dict

    def dress(self, method, *, osl=True):
        """Show the stage in NODES or LOBE, with or without Open Shading Language."""
        for sheet, name in self.sheets:
            sheet.data.materials[0] = self.materials[method][name]
        self.scene.cycles.shading_system = osl


def light_stage(add_light: Callable, side=SIDE) -> LightStage:
    """The stage under the light of `add_light(scene)`, dressed in NODES; drops all open data. side: of the picture."""
    scene = stage.empty_scene((side, side), 1)
    scene.render.use_texture_cache = False
    materials = {NODES: {}, LOBE: {}}
    for name, (interpolation, encoded) in MAPS.items():
        image = maps.blender_image(name, encoded())
        settings = {"roughness": ROUGHNESS, "interpolation": interpolation}
        materials[NODES][name] = truth_material(f"Nodes, {name}", image, **settings)
        materials[LOBE][name] = create_glint_material(f"Glint, {name}", image, **settings)
    sheets = []
    for (column, name), (row, texels) in product(enumerate(MAPS), enumerate(DISTANCES.values())):
        x, y = (column - 1) * SHEET, (row - 1) * SHEET
        corners = [(x, y, 0), (x + SHEET, y, 0), (x + SHEET, y + SHEET, 0), (x, y + SHEET, 0)]
        sheet = stage.add_sheet(scene, f"{name} {row}", corners, None, repeats=_repeats(texels, side))
        sheets.append((sheet, name))
    stage.add_camera(scene, CAMERA, (0, 0, 0), angle=2 * math.atan(WIDTH / 2 / math.hypot(*CAMERA)))
    add_light(scene)
    made = LightStage(scene, tuple(sheets), materials)
    made.dress(NODES, osl=False)
    return made


def tiles(side=SIDE) -> dict[str, tuple[slice, slice]]:
    """Rows and columns of each tile in a picture, by name."""
    half = side // 2
    return {
        f"{name}, {distance}": (slice(row * half, (row + 1) * half), slice(column * half, (column + 1) * half))
        for (column, name), (row, distance) in product(enumerate(MAPS), enumerate(DISTANCES))
    }


def stage_hash(made: LightStage) -> str:
    """Digest of what the right answer depends on: maps, HDRI, objects, light, world; emitters by their radiance."""
    images = sorted((each for each in bpy.data.images if each.type != "RENDER_RESULT"), key=lambda each: each.name)
    return scene_digest(made.scene, repr((made.scene.render.resolution_x, ROUGHNESS, EMITTER_RADIANCE)), images)


def sun(degrees) -> tuple[str, Callable]:
    """(name, function that adds it) of a sun `degrees` across."""
    return f"sun, {degrees:g} degrees", lambda scene: stage.add_sun(scene, LIGHT, angle=math.radians(degrees))


def add_point(scene):
    stage.add_lamp(scene, "POINT", PLACE, power=FLUX, shadow_soft_size=RADIUS)


def add_spot(scene):
    """The soft edge of its cone lies across the stage."""
    settings = {"shadow_soft_size": RADIUS, "spot_size": math.radians(28), "spot_blend": 0.5}
    stage.add_lamp(scene, "SPOT", PLACE, power=FLUX, **settings)


def add_square(scene):
    # A quarter of FLUX: ahead of a flat lamp the light is four times that of a lamp to all sides.
    stage.add_lamp(scene, "AREA", PLACE, power=FLUX / 4, shape="SQUARE", size=2 * RADIUS)


def add_disk(scene):
    """So narrow a spread that the stage's corners are dimmer; a flat lamp's light, gathered by a tenth."""
    settings = {"shape": "DISK", "size": 2 * RADIUS, "spread": math.radians(40)}
    stage.add_lamp(scene, "AREA", PLACE, power=FLUX / 40, **settings)


EMITTER_RADIANCE = FLUX / (4 * math.pi**2 * RADIUS**2)  # W/m^2/sr of a ball


def add_emitter(scene):
    """A small ball of 80 shining triangles."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=RADIUS, location=PLACE)
    ball = bpy.context.object
    ball.name = "Emitter"
    ball.data.materials.append(emission_material(EMITTER_RADIANCE))


def emission_material(strength) -> bpy.types.Material:
    """White emission of `strength` W/m^2/sr."""
    material = bpy.data.materials.new("Emission")
    tree = material.node_tree
    tree.nodes.clear()
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Strength"].default_value = strength
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return material


def add_hdri(scene):
    """An image of a sky with a small sun."""
    tree = scene.world.node_tree
    environment = tree.nodes.new("ShaderNodeTexEnvironment")
    environment.image = maps.blender_image("HDRI", hdri())
    tree.links.new(environment.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def hdri(height=HDRI_HEIGHT, direction=LIGHT) -> np.ndarray:
    """Radiance (height, 2 height, 3), float32, row 0 at the bottom: a brighter zenith, a sun of 1 W/m^2."""
    latitude = ((np.arange(height) + 0.5) / height - 0.5)[:, None] * math.pi
    longitude = (0.5 - (np.arange(2 * height) + 0.5) / (2 * height))[None, :] * 2 * math.pi  # 0 along +X
    along = (np.cos(latitude) * (np.cos(longitude) * direction[0] + np.sin(longitude) * direction[1])
             + np.sin(latitude) * direction[2])
    horizon, zenith = HDRI_SKY
    sky = horizon + (zenith - horizon) * np.clip(np.sin(latitude), 0.0, None)
    is_sun = along > math.cos(HDRI_SUN / 2)
    solid_angles = np.cos(latitude) * (math.pi / height) ** 2 * np.ones_like(along)
    radiance = sky + is_sun / solid_angles[is_sun].sum()
    return np.repeat(radiance[..., None], 3, axis=-1).astype(np.float32)


def add_sky(scene):
    """Blender's Sky Texture with its sun."""
    tree = scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_rotation = math.asin(LIGHT.z), math.atan2(LIGHT.x, LIGHT.y)
    tree.nodes["Background"].inputs["Strength"].default_value = SKY_STRENGTH
    tree.links.new(sky.outputs["Color"], tree.nodes["Background"].inputs["Color"])


KINDS = {
    **dict([sun(0.5)]),
    "point": add_point,
    "spot with blend": add_spot,
    "area, square": add_square,
    "area, disk with spread": add_disk,
    "mesh emitter": add_emitter,
    "HDRI with a sun": add_hdri,
    "Sky Texture's sun": add_sky,
}


def _repeats(texels, side) -> float:
    """Of the map on a sheet, for so many texels in a pixel in the middle of a picture of `side` pixels."""
    # Seen at 45 degrees a pixel is longer than wide.
    pixel_area = (WIDTH / side) ** 2 * math.sqrt(2.0)
    return math.sqrt(texels / pixel_area) * SHEET / MAP_SIDE
