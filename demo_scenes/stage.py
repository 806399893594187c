"""The shared stage: an empty scene, a Cornell-like room, a studio with a sun, camera, objects, plain materials."""

from __future__ import annotations

import math

import bpy
from mathutils import Vector

THREADS = 2
SEED = 1
SUN_ANGLE = math.radians(0.5)  # angular diameter of the real sun
WHITE = (0.73, 0.73, 0.73)
# Radians that 48 pixels see of a frame of 1920 x 1080 pixels through Blender's default lens: 0.0004 a pixel.
FRAME_CROP = 48 * 0.0004
ROOM_CAMERA = (0.0, -3.6, 1.0)


def empty_scene(size, spp) -> bpy.types.Scene:
    """Drop everything; a scene for Cycles on the CPU, `size` = (width, height) pixels, `spp` samples a pixel.

    No denoiser, no adaptive sampling, no clamping: what is seen is what is measured.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = False
    render.threads_mode, render.threads = "FIXED", THREADS
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.seed = spp, SEED
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    scene.world = bpy.data.worlds.new("World")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
    return scene


def add_room(scene, wall_material, *, side=1.0, left=WHITE, right=WHITE, lamp_power=24.0):
    """A room open to the camera, from -side to side in x and y and 0 to 2 side in z, with a camera and a lamp.

    `wall_material` is the back wall's; floor and ceiling are white, `left` and `right` are linear RGB;
    the lamp under the ceiling, towards the camera, has `lamp_power` watts.
    """
    s, top = side, 2 * side
    white = diffuse_material("White", WHITE)
    walls = {
        "Back": (wall_material, [(-s, s, 0), (s, s, 0), (s, s, top), (-s, s, top)]),
        "Floor": (white, [(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)]),
        "Ceiling": (white, [(-s, s, top), (s, s, top), (s, -s, top), (-s, -s, top)]),
        "Left": (diffuse_material("Left", left), [(-s, -s, 0), (-s, s, 0), (-s, s, top), (-s, -s, top)]),
        "Right": (diffuse_material("Right", right), [(s, s, 0), (s, -s, 0), (s, -s, top), (s, s, top)]),
    }
    for name, (material, corners) in walls.items():
        add_sheet(scene, name, corners, material)
    add_camera(scene, ROOM_CAMERA, (0, 0, 1), angle=0.68)
    lamp = bpy.data.lights.new("Lamp", "AREA")
    lamp.size, lamp.energy = 0.6, lamp_power
    place(scene, "Lamp", lamp, (0, -0.55, top - 0.01))


def add_sheet(scene, name, corners, material, *, repeats=1.0) -> bpy.types.Object:
    """A quadrilateral from four corners, counter-clockwise from its front; UV 0..`repeats` from the first corner."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name="UVMap")
    for corner, uv in zip(layer.uv, [(0, 0), (1, 0), (1, 1), (0, 1)], strict=True):
        corner.vector = Vector(uv) * repeats
    mesh.materials.append(material)
    return place(scene, name, mesh)


def add_sphere(scene, material, *, centre=(0, 0, 0.6), radius=0.6, repeats=(1.0, 1.0)) -> bpy.types.Object:
    """A smooth UV sphere, poles on z; its map is repeated `repeats` times around and from pole to pole."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=radius, location=centre)
    sphere = bpy.context.object
    sphere.data.polygons.foreach_set("use_smooth", [True] * len(sphere.data.polygons))
    for corner in sphere.data.uv_layers.active.uv:
        corner.vector = (corner.vector[0] * repeats[0], corner.vector[1] * repeats[1])
    sphere.data.materials.append(material)
    return sphere


def add_disc(scene, material, *, radius=1.0, hole=0.08, segments=192, repeats=(1, 1)) -> bpy.types.Object:
    """A flat ring in the xy plane, normal +z; u runs around it, v from the hole to the rim, `repeats` times each."""
    vertices, faces, uvs = [], [], []
    for k in range(segments + 1):
        angle = 2 * math.pi * k / segments
        vertices += [(r * math.cos(angle), r * math.sin(angle), 0.0) for r in (hole, radius)]
    for k in range(segments):
        left, right = k * repeats[0] / segments, (k + 1) * repeats[0] / segments
        faces.append((2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2))
        uvs += [(left, 0), (left, repeats[1]), (right, repeats[1]), (right, 0)]
    mesh = bpy.data.meshes.new("Disc")
    mesh.from_pydata(vertices, [], faces)
    for corner, uv in zip(mesh.uv_layers.new(name="UVMap").uv, uvs, strict=True):
        corner.vector = uv
    mesh.materials.append(material)
    return place(scene, "Disc", mesh)


def add_camera(scene, location, target, *, angle=0.7, width=None) -> bpy.types.Object:
    """A camera at `location` looking at `target`; becomes the scene's own.

    Perspective, `angle` radians wide, or with a `width` in metres orthographic and that wide.
    """
    data = bpy.data.cameras.new("Camera")
    data.angle = angle
    if width is not None:
        data.type, data.ortho_scale = "ORTHO", width
    camera = place(scene, "Camera", data, location)
    camera.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    scene.camera = camera
    return camera


def add_sun(scene, direction, *, strength=1.0, angle=SUN_ANGLE, color=(1, 1, 1)) -> bpy.types.Object:
    """A sun seen in `direction`, irradiance `strength` W/m^2 on a surface that faces it, `angle` radians across."""
    data = bpy.data.lights.new("Sun", "SUN")
    data.energy, data.angle, data.color = strength, angle, color
    sun = place(scene, "Sun", data)
    sun.rotation_euler = Vector(direction).to_track_quat("Z", "Y").to_euler()
    return sun


def add_lamp(scene, kind, location, target=(0, 0, 0), *, power, **settings) -> bpy.types.Object:
    """A lamp of `power` watts at `location` shining at `target`; kind 'POINT', 'SPOT' or 'AREA'.

    `settings` are properties of the light, as shadow_soft_size (radius) or size, in metres.
    """
    data = bpy.data.lights.new(kind.title(), kind)
    data.energy = power
    for name, value in settings.items():
        setattr(data, name, value)
    lamp = place(scene, kind.title(), data, location)
    lamp.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    return lamp


def add_sky(scene, *, sun_elevation, strength=1.0):
    """Light the scene by Blender's Sky Texture without the sun's disc; `sun_elevation` in radians.

    Of Hosek and Wilkie: the newer models are computed for seconds before each render, which drowns small pictures.
    """
    tree = scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = "HOSEK_WILKIE"
    sky.sun_direction = (0.0, -math.cos(sun_elevation), math.sin(sun_elevation))
    background = tree.nodes["Background"]
    background.inputs["Strength"].default_value = strength
    tree.links.new(sky.outputs["Color"], background.inputs["Color"])


def place(scene, name, data, location=(0, 0, 0)) -> bpy.types.Object:
    """Link a new object of `data` into the scene."""
    thing = bpy.data.objects.new(name, data)
    thing.location = location
    scene.collection.objects.link(thing)
    return thing


def diffuse_material(name, color=WHITE) -> bpy.types.Material:
    """A diffuse material of one linear RGB colour; its Diffuse BSDF node is named "Diffuse"."""
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.name = "Diffuse"
    diffuse.inputs["Color"].default_value = (*color, 1.0)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def glossy_material(name, color=(1.0, 1.0, 1.0), roughness=0.1) -> bpy.types.Material:
    """Blender's Glossy BSDF (Beckmann) without a normal map: linear RGB colour, roughness 0..1."""
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    glossy = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    glossy.distribution = "BECKMANN"
    glossy.inputs["Color"].default_value = (*color, 1.0)
    glossy.inputs["Roughness"].default_value = roughness
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(glossy.outputs["BSDF"], output.inputs["Surface"])
    return material
