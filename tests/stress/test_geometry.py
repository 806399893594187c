"""Stress of roughness, angles, sizes, transforms and instances, each against Blender's own nodes."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from demo_scenes import maps
from tests.helpers import cycles
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress

pytestmark = stress("every angle, size and transform against Blender's nodes", fast=[
    "osl/test_lobe.py::test_every_geometry_has_the_right_mean",
])

SUN = math.radians(4)  # so large that Blender's nodes find it


def stage(scene, material, *, scale=1.0, centre=(0, 0, 0), sun=SUN):
    """A square of 4 x `scale` metres around `centre` under a slanted camera, about nine texels a pixel, and a sun."""
    square = cycles.add_plane(scene, 4.0 * scale, material=material, repeats=4.0)
    square.location = centre
    point_camera(scene, Vector((0, -2, 2)) * scale, centre, scale)
    if sun:
        cycles.add_sun(scene, (0, 1, 1), angle=sun)
    return square


def point_camera(scene, offset, centre, scale=1.0):
    """A camera at `centre` + `offset` that looks there; it sees from a thousandth of `scale` to a thousand times it."""
    camera = cycles.add_camera(scene, Vector(centre) + Vector(offset), centre, angle=0.6)
    camera.data.clip_start, camera.data.clip_end = 0.001 * scale, 1000.0 * scale


def tilted(scene, material, elevation, sun_elevation, *, back=False, sun=SUN):
    """An orthographic view and a sun at angles above the surface (degrees): nine texels a pixel across the view."""
    # Long enough to fill the view; the texels stay square, so that a footprint is as long as the view is flat.
    length = 2.0 / math.sin(math.radians(elevation))
    corners = [(-1, -length, 0), (1, -length, 0), (1, length, 0), (-1, length, 0)]
    uvs = 2 * np.array(corners)[:, :2]
    face = (3, 2, 1, 0) if back else (0, 1, 2, 3)
    cycles.add_mesh(scene, corners, [face], uvs=uvs[list(face)], material=material)
    view, light = math.radians(elevation), math.radians(sun_elevation)
    cycles.add_camera(scene, (0, -4 * math.cos(view), 4 * math.sin(view)), (0, 0, 0), width=1.5)
    scene.camera.data.clip_end = 10 * length + 10
    cycles.add_sun(scene, (0, math.cos(light), math.sin(light)), angle=sun)


@pytest.mark.parametrize("alpha", [0, 1e-4, 1e-3, 0.01, 0.1, 0.5, 1])
@pytest.mark.parametrize(("distribution", "interpolation"), [("BECKMANN", "LINEAR"), ("GGX", "CLOSEST")])
def test_alpha(stress_record, alpha, distribution, interpolation):
    normal_map = maps.flakes(64, std=0.08) if interpolation == "CLOSEST" else None
    surface = {"roughness": math.sqrt(alpha), "distribution": distribution, "interpolation": interpolation}
    outcome = compare(stress_record, stage, surface=surface, normal_map=normal_map, nodes=(2048, 2),
                      lobe=(32, 2))
    assert outcome.report["hints"] == ["Sun"]


# At 80 degrees and more this lobe gives up its hints (osl/light_hint.h), and is as fast and as noisy as the nodes.
GRAZING = {60: (4, 2), 75: (4, 2), 82: (2048, 2), 85: (2048, 2), 89: (2048, 2), 89.9: (2048, 2), 89.99: (2048, 2)}


@pytest.mark.parametrize("angle", GRAZING)
def test_grazing_view(stress_record, angle):
    compare(stress_record, lambda scene, material: tilted(scene, material, 90 - angle, 90 - angle), nodes=(2048, 2),
            lobe=GRAZING[angle], size=(8, 8))


def test_grazing_view_of_sharp_facets_keeps_its_hints(stress_record):
    compare(stress_record, lambda scene, material: tilted(scene, material, 10, 10, sun=math.radians(1)),
            surface={"roughness": 0.12}, nodes=(8192, 2), lobe=(4, 2), size=(8, 8))


@pytest.mark.parametrize("angle", [75, 89, 89.99])
def test_grazing_light(stress_record, angle):
    # The half vector lies half-way to the light: a wide map reaches it.
    compare(stress_record, lambda scene, material: tilted(scene, material, 45, 90 - angle),
            normal_map=maps.bumps(64, std=0.3, width=3.0), surface={"roughness": 0.35}, nodes=(2048, 2),
            lobe=(8, 2) if angle < 80 else (2048, 2))


@pytest.mark.parametrize("angle", [45, 85, 89.9])
def test_back_face(stress_record, angle):
    compare(stress_record, lambda scene, material: tilted(scene, material, 90 - angle, 90 - angle, back=True),
            nodes=(2048, 2), lobe=GRAZING.get(angle, (4, 2)), size=(8, 8))


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 1e3, 1e6])
def test_scale_of_the_scene_in_metres(stress_record, scale):
    compare(stress_record, lambda scene, material: stage(scene, material, scale=scale))


@pytest.mark.parametrize("scale", [1e-4, 1e6])
def test_scale_of_the_scene_with_a_point_light(stress_record, scale):
    def build(scene, material):
        stage(scene, material, scale=scale, sun=0)
        light = bpy.data.lights.new("Point", "POINT")
        light.energy, light.shadow_soft_size = 30 * scale**2, 0.1 * scale
        lamp = bpy.data.objects.new("Point", light)
        lamp.location = (0, 2 * scale, 2 * scale)
        scene.collection.objects.link(lamp)

    assert compare(stress_record, build).report["hints"] == ["Point"]


@pytest.mark.parametrize("place", [(1e6, 0, 0), (1e6, -1e6, 1e6)], ids=str)
def test_object_far_from_the_origin(stress_record, place):
    compare(stress_record, lambda scene, material: stage(scene, material, scale=16.0, centre=place))


TRANSFORMS = {
    "mirrored": Matrix.Diagonal((-1, 1, 1, 1)),
    "mirrored thrice": Matrix.Diagonal((-1, -1, -1, 1)),
    "uneven": Matrix.Diagonal((3, 0.7, 0.9, 1)),
    "flattened to nothing": Matrix.Diagonal((1, 1, 0, 1)),
    "tiny": Matrix.Diagonal((1e-5, 1e-5, 1e-5, 1)),
    "sheared": Matrix.Shear("XY", 4, (0.5, 0.0)) @ Matrix.Shear("YZ", 4, (0.8, 0.0)),
}


def transformed(transform):
    """A build function: the square of `stage` with the object transform of that name."""
    matrix = TRANSFORMS[transform]

    def build(scene, material):
        square = stage(scene, material)
        if transform == "tiny":
            square.data.transform(matrix.inverted())
        if transform == "sheared":
            # No rotation and scale give a shear: a parent's matrix does.
            parent = bpy.data.objects.new("Parent", None)
            scene.collection.objects.link(parent)
            square.parent, square.matrix_parent_inverse = parent, matrix
        else:
            square.scale = matrix.to_scale() if matrix.determinant() > 0 else [matrix[k][k] for k in range(3)]

    return build


@pytest.mark.parametrize("transform", TRANSFORMS)
def test_transform_of_the_object(stress_record, transform):
    # Without OSL Blender's nodes are black on an object of no height, with OSL they are lit.
    compare(stress_record, transformed(transform), osl_nodes=transform == "flattened to nothing")


def instances_of_a_collection(scene, source):
    collection = bpy.data.collections.new("Squares")
    scene.collection.objects.unlink(source)
    collection.objects.link(source)
    for x in (-1.0, 1.0):
        empty = bpy.data.objects.new("Instance", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location, empty.scale = (x, 0, 0), (0.5 * x, 1, 1)
        scene.collection.objects.link(empty)


def instances_on_vertices(scene, source):
    source.scale = (0.5, 1, 1)
    points = cycles.add_mesh(scene, [(-1, 0, 0), (1, 0, 0)], [])
    points.instance_type = "VERTS"
    points.show_instancer_for_render = False
    source.parent = points


def instances_by_geometry_nodes(scene, source):
    """On the vertices of a mesh; the source itself is hidden, as is usual."""
    source.scale = (0.5, 1, 1)
    source.hide_render = True
    points = cycles.add_mesh(scene, [(-1, 0, 0), (1, 0, 0)], [])
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes = [tree.nodes.new(kind) for kind in ("NodeGroupInput", "GeometryNodeObjectInfo",
                                               "GeometryNodeInstanceOnPoints", "NodeGroupOutput")]
    nodes[1].inputs["Object"].default_value = source
    nodes[1].inputs["As Instance"].default_value = True
    nodes[2].inputs["Scale"].default_value = source.scale
    tree.links.new(nodes[0].outputs["Geometry"], nodes[2].inputs["Points"])
    tree.links.new(nodes[1].outputs["Geometry"], nodes[2].inputs["Instance"])
    tree.links.new(nodes[2].outputs["Instances"], nodes[3].inputs["Geometry"])
    points.modifiers.new("Instances", "NODES").node_group = tree


@pytest.mark.parametrize("instances", [instances_of_a_collection, instances_on_vertices, instances_by_geometry_nodes],
                         ids=lambda function: function.__name__.replace("_", " "))
def test_instances(stress_record, instances):
    outcome = compare(stress_record, lambda scene, material: instances(scene, stage(scene, material)))
    assert outcome.report["hints"] and (outcome.report["baked"] or outcome.report["reused"])
