"""Tiny Cycles renders for tests: an empty scene, fixed settings, a picture as a linear float array.

bpy is imported once per process and keeps its state, so every test starts with `empty_scene()`.
"""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import bpy
import numpy as np

SEED = 1


def empty_scene(*, size=(32, 32), spp=1, osl=True, seed=SEED) -> bpy.types.Scene:
    """Drop all but the preferences and return an empty scene set up for Cycles on the CPU (see `set_up_cycles`)."""
    # `read_factory_settings` takes 40 ms instead of 8: it registers all of Blender's own add-ons anew.
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    set_up_cycles(scene, size=size, spp=spp, osl=osl, seed=seed)
    return scene


def set_up_cycles(scene, *, size=(32, 32), spp=1, osl=True, seed=SEED):
    """Cycles on the CPU, `size` = (width, height) pixels, `spp` samples; no denoiser, adaptive sampling or clamping.

    `osl` is the Open Shading Language switch. The pixel filter is left alone; see `box_filter`.
    """
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.film_transparent = False
    scene.render.use_compositing = False
    scene.render.use_sequencer = False
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 2
    scene.view_settings.view_transform = "Raw"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.shading_system = osl
    cycles.seed = seed
    cycles.use_animated_seed = False
    cycles.samples = spp
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    # Blender clamps indirect light at 10 unless told otherwise: the noisier a picture, the more light that takes away.
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.use_light_tree = False


def box_filter(scene, width=1.0):
    """A pixel filter of `width` pixels with equal weights: 1 averages the pixel's own square, 0.01 hits its centre."""
    scene.cycles.pixel_filter_type = "BOX" if width == 1.0 else "GAUSSIAN"
    scene.cycles.filter_width = max(width, 0.01)


def rendered(scene) -> np.ndarray:
    """Render `scene`: (height, width, 4) float32, scene-linear RGBA, row 0 at the BOTTOM (row index grows with v)."""
    image_settings = scene.render.image_settings
    image_settings.file_format = "OPEN_EXR"
    image_settings.color_mode = "RGBA"
    image_settings.color_depth = "32"
    image_settings.exr_codec = "ZIP"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "render.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        return read_image(scene.render.filepath)


def read_image(file) -> np.ndarray:
    """Pixels of an image file as Blender loads them: (height, width, 4) float32, row 0 at the bottom."""
    image = bpy.data.images.load(str(file))
    try:
        width, height = image.size
        pixels = np.empty(width * height * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)


def save_png(pixels, file, *, scale=1):
    """Write linear `pixels` (height, width, 3 or 4), row 0 at the bottom, as an sRGB PNG enlarged `scale` times."""
    pixels = np.asarray(pixels, dtype=np.float32)[..., :3].clip(0, 1)
    curve = np.where(pixels <= 0.0031308, 12.92 * pixels, 1.055 * pixels ** (1 / 2.4) - 0.055)
    curve = curve.repeat(scale, axis=0).repeat(scale, axis=1)
    height, width = curve.shape[:2]
    image = bpy.data.images.new("Glint picture", width, height)
    try:
        image.pixels.foreach_set(np.dstack([curve, np.ones_like(curve[..., :1])]).astype(np.float32).ravel())
        image.filepath_raw = str(file)
        image.file_format = "PNG"
        image.save()
    finally:
        bpy.data.images.remove(image)


def add_camera(scene, location=(0, 0, 1), target=(0, 0, 0), *, width=None, angle=0.7) -> bpy.types.Object:
    """Make a camera at `location` looking at `target` the scene's own.

    `width` in world units gives an orthographic view that wide, else a perspective one of `angle` radians.
    """
    from mathutils import Vector

    data = bpy.data.cameras.new("Camera")
    if width is None:
        data.angle = angle
    else:
        data.type = "ORTHO"
        data.ortho_scale = width
    camera = bpy.data.objects.new("Camera", data)
    camera.location = location
    camera.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def add_mesh(scene, vertices, faces, *, uvs=None, material=None, uv_map="UVMap", smooth=False) -> bpy.types.Object:
    """Add a mesh of `vertices` (n, 3) and `faces` (lists of indices); `uvs` is one (u, v) for each face corner."""
    mesh = bpy.data.meshes.new("Mesh")
    mesh.from_pydata([tuple(map(float, vertex)) for vertex in vertices], [], [list(face) for face in faces])
    if uvs is not None:
        layer = mesh.uv_layers.new(name=uv_map)
        layer.uv.foreach_set("vector", np.asarray(uvs, dtype=np.float32).ravel())
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    mesh.update()
    thing = bpy.data.objects.new("Mesh", mesh)
    if material is not None:
        mesh.materials.append(material)
    scene.collection.objects.link(thing)
    return thing


def add_plane(scene, size=2.0, *, material=None, repeats=1.0) -> bpy.types.Object:
    """Add a square in the xy plane, `size` wide, centred on the origin, normal +z, UV 0..`repeats`."""
    half = size / 2
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    uvs = [(0, 0), (repeats, 0), (repeats, repeats), (0, repeats)]
    return add_mesh(scene, corners, [(0, 1, 2, 3)], uvs=uvs, material=material)


def add_sphere(scene, radius=1.0, *, material=None, segments=64, rings=32) -> bpy.types.Object:
    """Add a smooth UV sphere of `radius` at the origin, poles on z."""
    places, uvs, corners, firsts = _sphere(radius, segments, rings)
    mesh = bpy.data.meshes.new("Sphere")
    mesh.vertices.add(len(places) // 3)
    mesh.vertices.foreach_set("co", places)
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(len(firsts))
    mesh.polygons.foreach_set("loop_start", firsts)
    mesh.polygons.foreach_set("use_smooth", np.ones(len(firsts), bool))
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uvs)
    mesh.update(calc_edges=True)
    thing = bpy.data.objects.new("Sphere", mesh)
    if material is not None:
        mesh.materials.append(material)
    scene.collection.objects.link(thing)
    return thing


@functools.cache
def _sphere(radius, segments, rings) -> tuple[np.ndarray, ...]:
    """Coordinates, UVs, each corner's vertex and each face's first corner of Blender's UV sphere, all flat.

    Kept, because Blender takes 1.2 s for the UVs of 256 x 128 faces.
    """
    import bmesh

    mesh = bpy.data.meshes.new("Sphere")
    shape = bmesh.new()
    shape.loops.layers.uv.new("UVMap")  # calc_uvs fills a layer, it makes none
    bmesh.ops.create_uvsphere(shape, u_segments=segments, v_segments=rings, radius=radius, calc_uvs=True)
    shape.to_mesh(mesh)
    shape.free()
    places, uvs = np.empty(3 * len(mesh.vertices), np.float32), np.empty(2 * len(mesh.loops), np.float32)
    corners, firsts = np.empty(len(mesh.loops), np.int32), np.empty(len(mesh.polygons), np.int32)
    mesh.vertices.foreach_get("co", places)
    mesh.uv_layers[0].uv.foreach_get("vector", uvs)
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.polygons.foreach_get("loop_start", firsts)
    bpy.data.meshes.remove(mesh)
    return places, uvs, corners, firsts


def emission_material(name="Emission"):
    """An empty material whose surface is an Emission of strength 1, no light: returns (material, its colour socket).

    Link the value under test to the socket and `rendered` shows it unlit.
    """
    material = bpy.data.materials.new(name)
    material.cycles.emission_sampling = "NONE"
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return material, emission.inputs["Color"]


def add_sun(scene, direction, *, angle=0.0, strength=1.0, color=(1, 1, 1)) -> bpy.types.Object:
    """Add a sun shining from `direction` (towards the light) with an angular diameter of `angle` radians."""
    from mathutils import Vector

    data = bpy.data.lights.new("Sun", "SUN")
    data.angle = angle
    data.energy = strength
    data.color = color
    thing = bpy.data.objects.new("Sun", data)
    thing.rotation_euler = Vector(direction).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(thing)
    return thing
