"""Stress of what carries the material: slivers, n-gons, bent normals, displacement, hair, points, volumes."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

from tests.helpers import cycles
from tests.helpers.stress import SIZE, compare
from tests.helpers.stress_marks import stress

pytestmark = stress("every mesh against Blender's nodes", fast=[
    "stress/test_one_of_each.py::test_a_case_of_each_group_agrees_with_blenders_nodes",
])


def add_view(scene, sun_degrees=4):
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    cycles.add_sun(scene, (0, 1, 1), angle=math.radians(sun_degrees))


def grid(scene, material, *, cells=8, width=4.0, smooth=False, height=None):
    """A square grid in the xy plane, four repeats of the map over it; `height` gives z at (x, y)."""
    side = np.linspace(-width / 2, width / 2, cells + 1)
    x, y = (plane.ravel() for plane in np.meshgrid(side, side))
    z = 0 * x if height is None else height(x, y)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = np.stack([first, first + 1, first + cells + 2, first + cells + 1], axis=1)
    uvs = np.stack([x, y], axis=1)[faces.ravel()] * 4 / width
    return cycles.add_mesh(scene, np.stack([x, y, z], axis=1), faces, uvs=uvs, material=material, smooth=smooth)


def slivers_and_faces_without_area(scene, material):
    """A fan of triangles a hundred thousandth as wide as they are long, over a square with empty faces."""
    grid(scene, material)
    vertices = [(-2, -2, 0.01)]
    faces, uvs = [], []
    for k in range(40):
        x = -2 + 0.1 * k
        vertices += [(x, 2, 0.01), (x + 4e-5, 2, 0.01)]
        faces.append((0, 2 * k + 1, 2 * k + 2))
    faces += [(0, 1, 1 + 2), (0, 0 + 5, 5 + 1)]
    for face in faces:
        uvs += [vertices[index][:2] for index in face]
    cycles.add_mesh(scene, vertices, faces, uvs=uvs, material=material)
    point = [(0, 0, 0.02)] * 3
    cycles.add_mesh(scene, point, [(0, 1, 2)], uvs=[(0, 0), (1, 0), (0, 1)], material=material)
    line = [(-1, 0, 0.02), (0, 0, 0.02), (1, 0, 0.02)]
    cycles.add_mesh(scene, line, [(0, 1, 2)], uvs=[(0, 0), (1, 0), (0, 1)], material=material)


def n_gon(scene, material):
    """A concave star of 31 corners."""
    angle = np.arange(31) / 31 * 2 * np.pi
    radius = np.where(np.arange(31) % 2, 1.0, 2.5)
    corners = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    cycles.add_mesh(scene, corners, [tuple(range(31))], uvs=corners[:, :2], material=material)


def smooth_waves(scene, material):
    grid(scene, material, cells=24, smooth=True, height=lambda x, y: 0.05 * np.sin(4 * x) * np.cos(3 * y))


def smooth_sphere_of_few_faces(scene, material):
    sphere = cycles.add_sphere(scene, 0.6, material=material, segments=8, rings=5)
    for corner in sphere.data.uv_layers.active.uv:
        corner.vector = corner.vector * 4


def normals_far_from_the_faces(scene, material):
    """Custom normals up to 60 degrees off, different at each corner."""
    square = grid(scene, material, smooth=True)
    rng = np.random.default_rng(2)
    normals = rng.normal(0, 0.5, (len(square.data.loops), 3)) + (0, 0, 1)
    normals[:, 2] = np.abs(normals[:, 2])
    square.data.normals_split_custom_set(normals.tolist())


def normals_into_the_faces(scene, material):
    """Custom normals that point away from the faces' front."""
    square = grid(scene, material, smooth=True)
    square.data.normals_split_custom_set([(0.3, 0.1, -1)] * len(square.data.loops))


def displaced(scene, material, method):
    square = grid(scene, material, cells=24, smooth=True)
    tree = material.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 1.5
    displacement = tree.nodes.new("ShaderNodeDisplacement")
    displacement.inputs["Scale"].default_value = 0.3
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(noise.outputs["Fac"], displacement.inputs["Height"])
    tree.links.new(displacement.outputs["Displacement"], output.inputs["Displacement"])
    material.displacement_method = method
    return square


def displaced_truly(scene, material):
    displaced(scene, material, "DISPLACEMENT")


def displaced_by_bump(scene, material):
    displaced(scene, material, "BUMP")


def displaced_by_both(scene, material):
    displaced(scene, material, "BOTH")


def mist_inside(scene, material):
    """A box whose inside scatters, seen from outside; nothing of the glossy surface is transparent."""
    box = grid(scene, material)
    box.modifiers.new("Box", "SOLIDIFY").thickness = 0.5
    tree = material.node_tree
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(scatter.outputs["Volume"], output.inputs["Volume"])


def half_transparent(scene, material):
    """Mixed with a Transparent BSDF, two sheets over each other."""
    tree = material.node_tree
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    surface = output.inputs["Surface"].links[0].from_socket
    mix, clear = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    tree.links.new(clear.outputs["BSDF"], mix.inputs[1])
    tree.links.new(surface, mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    grid(scene, material)
    grid(scene, material).location = (0, 0, -0.3)


MESHES = [slivers_and_faces_without_area, n_gon, smooth_waves, smooth_sphere_of_few_faces, normals_far_from_the_faces,
          normals_into_the_faces, displaced_truly, displaced_by_bump, displaced_by_both, mist_inside, half_transparent]


@pytest.mark.parametrize("mesh", MESHES, ids=lambda function: function.__name__.replace("_", " "))
def test_mesh(stress_record, mesh):
    def build(scene, material):
        mesh(scene, material)
        add_view(scene)

    # The ball's highlight, two pixels wide in the picture's middle, would be blurred over quarters that are compared.
    size = (24, 24) if mesh is smooth_sphere_of_few_faces else SIZE
    # Normals into the faces leave nothing to see, with Blender's nodes either.
    compare(stress_record, build, nodes=(1024, 2), lit=mesh is not normals_into_the_faces, size=size)


def hair(scene, material):
    """Two hundred hairs from the new hair curves."""
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([2] * 200)
    rng = np.random.default_rng(3)
    roots = rng.uniform(-1, 1, (200, 3)) * (1, 1, 0)
    ends = roots + rng.normal(0, 0.2, (200, 3)) + (0, 0, 0.4)
    curves.position_data.foreach_set("vector", np.stack([roots, ends], axis=1).astype(np.float32).ravel())
    radius = curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(400, 0.02, np.float32))
    return curves


def point_cloud(scene, material):
    cloud = bpy.data.pointclouds.new("Points")
    cloud.resize(200)
    place = np.random.default_rng(3).uniform(-1, 1, (200, 3)) * (1, 1, 0.2)
    cloud.attributes["position"].data.foreach_set("vector", place.astype(np.float32).ravel())
    radius = cloud.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(200, 0.1, np.float32))
    return cloud


def beveled_curve(scene, material):
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.2
    spline = curve.splines.new("POLY")
    spline.points.add(3)
    for point, place in zip(spline.points, [(-1, -1, 0), (0, 1, 0), (0.5, 0, 0.3), (1, 1, 0)], strict=True):
        point.co = (*place, 1)
    return curve


def text(scene, material):
    letters = bpy.data.curves.new("Text", "FONT")
    letters.body, letters.size, letters.extrude = "XO", 1.2, 0.1
    return letters


def metaball(scene, material):
    ball = bpy.data.metaballs.new("Ball")
    ball.elements.new().radius = 1.0
    return ball


@pytest.mark.parametrize("data", [hair, point_cloud, beveled_curve, text, metaball],
                         ids=lambda function: function.__name__.replace("_", " "))
def test_what_is_no_mesh(stress_record, data):
    """Without tangents the Normal Map node leaves the surface's own normal, and so does the lobe."""

    def build(scene, material):
        block = data(scene, material)
        block.materials.append(material)
        scene.collection.objects.link(bpy.data.objects.new("Thing", block))
        add_view(scene, 20)

    compare(stress_record, build, surface={"roughness": 0.6}, nodes=(1024, 2), lobe=(1024, 2))
