"""What the stress cases of lights, cameras and settings share: a square under a slanted camera, lights, a sky."""

from __future__ import annotations

import math

import bpy
from mathutils import Vector

from tests.helpers import cycles

SUN_ANGLE = math.radians(4)  # so large that Blender's nodes find it
MIDDLE = (0, 1.2, 1.2)  # where a lamp is mirrored into the middle of the view


def add_square(scene, material):
    """A square of 4 metres under a camera that looks down at 45 degrees, without lights: about nine texels a pixel."""
    square = cycles.add_plane(scene, 4.0, material=material, repeats=4.0)
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    return square


def sunny_square(scene, material):
    """`add_square` with a sun that is mirrored into the middle of the view."""
    square = add_square(scene, material)
    cycles.add_sun(scene, (0, 1, 1), angle=SUN_ANGLE)
    return square


def add_lamp(scene, kind="POINT", location=MIDDLE, *, target=(0, 0, 0), power=30.0, name=None, **settings):
    """A light object of `kind` at `location` that shines towards `target`; `settings` are properties of its light."""
    light = bpy.data.lights.new(name or kind.title(), kind)
    light.energy = power
    for key, value in settings.items():
        setattr(light, key, value)
    lamp = bpy.data.objects.new(name or kind.title(), light)
    lamp.location = location
    lamp.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(lamp)
    return lamp


def add_sky(scene, radiance=1.0):
    """A world of one `radiance`; returns its Background node."""
    scene.world = bpy.data.worlds.new("Sky")
    background = next(node for node in scene.world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (radiance, radiance, radiance, 1.0)
    return background


def diffuse_material(color=(0.7, 0.7, 0.7)):
    """A plain diffuse material of a linear RGB colour."""
    material = bpy.data.materials.new("Diffuse")
    tree = material.node_tree
    tree.nodes.clear()
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (*color, 1.0)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def add_wall(scene, material):
    """An upright square of 4 metres behind the middle of `add_square`, facing the camera."""
    wall = cycles.add_plane(scene, 4.0, material=material, repeats=4.0)
    wall.location = (0, 0.8, 0)
    wall.rotation_euler = (math.pi / 2, 0, 0)
    return wall
