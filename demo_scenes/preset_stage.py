"""One stage for all presets: a ball of 10 cm under the sun, a small lamp and the sky; and a close-up of it."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Vector

import glint_addon
from glint_addon.materials.presets import Preset, preset_named
from glint_addon.materials.radial_uvs import add_radial_uvs

from . import stage

RADIUS = 0.05  # metres
CENTRE = Vector((0.0, 0.0, RADIUS))
CAMERA = Vector((0.0, -0.6, 0.22))
WIDTH = 0.122  # metres that the picture of the ball shows
SUN = Vector((-0.5, -0.62, 0.72))
LAMP = Vector((0.30, -0.22, 0.26))
AXIS_TILT = math.radians(58)  # of turned surfaces' axis, from straight up towards the camera
BESIDE = math.radians(12)  # from where the sun is mirrored to the middle of a close-up
TABLE = (0.21, 0.20, 0.19)
# Height of the direction that is looked at (its z) and the sky's colour there; below 0 lies what is around the table.
SKY = ((-0.05, (0.10, 0.095, 0.09)), (0.0, (0.88, 0.83, 0.77)), (0.25, (0.52, 0.54, 0.58)), (1.0, (0.23, 0.27, 0.34)))
# What a close-up shows, in widths of the map's feature: the setting of its generator, and how many of it.
FEATURES = {"FLAKES": ("size", 40), "GRAINS": ("size", 24), "SEQUINS": ("size", 6), "DENTS": ("size", 5),
            "SCRATCHES": ("length", 2), "BRUSHED": ("length", 4), "BUMPS": ("wavelength", 12)}
NARROWEST, WIDEST = 0.003, 0.04  # metres of a close-up


def build(name: str, *, size=(512, 512), spp=64, close=False) -> bpy.types.Scene:
    """The stage with a ball of preset `name`, its UVs in metres; close: a narrow view of its highlight instead."""
    preset = preset_named(name)
    scene = stage.empty_scene(size, spp)
    material = glint_addon.create_glint_material(name, preset=name)
    add_ball(material, is_radial=preset.uvs == "RADIAL")
    add_table(scene)
    add_light(scene)
    target, width = (near_highlight(), close_width(preset)) if close else (CENTRE, WIDTH)
    add_camera(scene, target, width)
    return scene


def add_table(scene):
    """A matt table that goes on to the horizon."""
    side = 5.0
    corners = [(-side, -side, 0), (side, -side, 0), (side, side, 0), (-side, side, 0)]
    stage.add_sheet(scene, "Table", corners, stage.diffuse_material("Table", TABLE))


def add_light(scene):
    """The sun of half a degree, a lamp of 2 cm, and the sky."""
    stage.add_sun(scene, SUN, strength=2.0, color=(1.0, 0.94, 0.86))
    stage.add_lamp(scene, "AREA", LAMP, CENTRE, power=0.35, size=0.02)
    add_gradient_sky(scene)


def add_gradient_sky(scene):
    """The world: the colours of SKY by height, without any disc of a sun."""
    tree = scene.world.node_tree
    direction = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    height = tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    tree.links.new(direction, height.inputs[0])
    low = SKY[0][0]
    above = tree.nodes.new("ShaderNodeMapRange")
    above.inputs["From Min"].default_value = low
    tree.links.new(height.outputs["Z"], above.inputs["Value"])
    tree.links.new(above.outputs["Result"], ramp.inputs["Fac"])
    stops = ramp.color_ramp.elements
    while len(stops) < len(SKY):
        stops.new(1.0)
    for stop, (z, color) in zip(stops, SKY, strict=True):
        stop.position, stop.color = (z - low) / (1.0 - low), (*color, 1.0)
    background = tree.nodes["Background"]
    background.inputs["Strength"].default_value = 0.8
    tree.links.new(ramp.outputs["Color"], background.inputs["Color"])


def add_camera(scene, target, width):
    """A camera at its one place, whose picture is `width` metres wide at `target`."""
    angle = 2 * math.atan(0.5 * width / (target - CAMERA).length)
    stage.add_camera(scene, CAMERA, target, angle=angle)


def near_highlight() -> Vector:
    """A place of the ball beside that where it mirrors the sun to the camera."""
    towards_camera = (CAMERA - CENTRE).normalized()
    middle = (towards_camera + SUN.normalized()).normalized()
    beside = Vector((0, 0, 1)).cross(middle).normalized()
    return CENTRE + RADIUS * (middle + math.tan(BESIDE) * beside).normalized()


def close_width(preset: Preset) -> float:
    """Metres that the close-up of a preset shows: some of its flakes, grains or scratches."""
    generator = preset.recipe.generator
    name, count = FEATURES[generator.kind]
    owners = getattr(generator, "populations", (generator,))
    return min(max(count * max(getattr(owner, name) for owner in owners), NARROWEST), WIDEST)


def add_ball(material, *, centre=CENTRE, radius=RADIUS, is_radial=False) -> bpy.types.Object:
    """A ball, with equal-area UVs in metres around the point that faces the camera, so that no seam is seen; is_radial:
    UVs around an axis that leans towards the camera."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=7, radius=radius, location=centre)
    ball = bpy.context.object
    mesh = ball.data
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.materials.append(material)
    if is_radial:
        ball.rotation_euler = (AXIS_TILT, 0.0, 0.0)
        add_radial_uvs(mesh, repeat=preset_named(material.name).scale)
    else:
        _add_facing_uvs(mesh, (CAMERA - Vector(centre)).normalized(), radius)
    bpy.context.view_layer.update()
    return ball


def _add_facing_uvs(mesh, forward, radius):
    """Lambert's azimuthal equal-area projection around the direction `forward`: 2 sin(angle / 2) from its middle."""
    right = Vector((0, 0, 1)).cross(forward).normalized()
    frame = np.array([right, forward.cross(right), forward])
    places = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", places)
    x, y, z = frame @ (places.reshape(-1, 3) / radius).T
    scale = radius * np.sqrt(2 / np.maximum(1 + z, 1e-6))
    corners = np.empty(len(mesh.loops), int)
    mesh.loops.foreach_get("vertex_index", corners)
    layer = mesh.uv_layers.active or mesh.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", np.stack([x * scale, y * scale], axis=1)[corners].astype(np.float32).ravel())
