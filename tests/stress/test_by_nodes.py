"""Stress of glints by nodes alone: cameras, blur, objects, lights and facets of the other files, without OSL."""

from __future__ import annotations

import math

import bpy
import pytest

from demo_scenes import maps
from tests.helpers import cycles
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import add_lamp, add_square
from tests.stress import test_cameras as cameras
from tests.stress import test_geometry as geometry
from tests.stress import test_lights as lights
from tests.stress import test_meshes as meshes

pytestmark = stress("every camera, object and light by nodes alone", fast=[
    "nodes/test_places.py::test_the_mean_is_that_of_plain_nodes",
])

NODES, PLACES = (2048, 2), (256, 2)  # samples and seeds


def compared(record, build, **settings):
    compare(record, build, by_nodes=True, nodes=settings.pop("nodes", NODES), lobe=settings.pop("places", PLACES),
            **settings)


@pytest.mark.parametrize("view", cameras.VIEWS)
def test_view(stress_record, view):
    # So wide a pixel of a cylinder holds a whole highlight, of a bump or two.
    places = (1024, 2) if view == "cylinder" else PLACES
    compared(stress_record, cameras.seen_by(cameras.VIEWS[view]), places=places)


@pytest.mark.parametrize("blur", [cameras.defocus, cameras.move_camera, cameras.zoom, cameras.move_square,
                                  cameras.turn_square])
def test_blur(stress_record, blur):
    compared(stress_record, cameras.seen_by(blur))


@pytest.mark.parametrize("mesh", meshes.MESHES, ids=lambda function: function.__name__.replace("_", " "))
def test_mesh(stress_record, mesh):
    def build(scene, material):
        mesh(scene, material)
        meshes.add_view(scene)

    # The ball's highlight is two pixels wide: so narrow it takes a mean over many bumps.
    settings = {}
    if mesh is meshes.smooth_sphere_of_few_faces:
        settings = {"size": (24, 24), "normal_map": maps.bumps(512, std=0.08, width=3.0, seed=4)}
    compared(stress_record, build, lit=mesh is not meshes.normals_into_the_faces, **settings)


@pytest.mark.parametrize("instances", [geometry.instances_of_a_collection, geometry.instances_on_vertices,
                                       geometry.instances_by_geometry_nodes])
def test_instances(stress_record, instances):
    compared(stress_record, lambda scene, material: instances(scene, geometry.stage(scene, material)))


def bent(scene, material):
    """A square that a key deforms between its frames, seen at a frame where it was not prepared."""
    square = meshes.grid(scene, material)
    square.shape_key_add(name="Flat")
    key = square.shape_key_add(name="Bent")
    for point in key.data:
        point.co.z += 0.3 * math.sin(2 * point.co.x)
    for frame, value in ((1, 0.0), (10, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    meshes.add_view(scene)
    scene.frame_set(7)


def in_a_mirror(scene, material):
    """The square is seen in a mirror alone: after a glossy bounce, whose distance the footprint does not know."""
    add_square(scene, material)
    camera = scene.camera
    mirror = bpy.data.materials.new("Mirror")
    tree = mirror.node_tree
    tree.nodes.clear()
    glossy, output = tree.nodes.new("ShaderNodeBsdfAnisotropic"), tree.nodes.new("ShaderNodeOutputMaterial")
    glossy.inputs["Roughness"].default_value = 0.0
    tree.links.new(glossy.outputs["BSDF"], output.inputs["Surface"])
    wall = cycles.add_plane(scene, 6.0, material=mirror)
    wall.location, wall.rotation_euler = (0, 2.5, 0), (math.pi / 2, 0, 0)
    camera.location, camera.rotation_euler = (0, 0.5, 1.5), (math.radians(80), 0, 0)
    add_lamp(scene, "SUN", (0, -3, 3), power=1.0, angle=math.radians(4))


@pytest.mark.parametrize("build", [bent, in_a_mirror])
def test_other_scene(stress_record, build):
    compared(stress_record, build)


@pytest.mark.parametrize("shape", lights.SHAPES)
def test_shape_of_a_light(stress_record, shape):
    # A cone of light as wide as a footprint is blurred by it.
    many = {"nodes": (8192, 2), "places": (4096, 2)} if any(word in shape for word in ("1 degree", "of no")) else {}
    compared(stress_record, lights.under(lights.SHAPES[shape]), **many)


@pytest.mark.parametrize("source", [lights.emissive_ball, lights.hdri, lights.sky_with_sun])
def test_light_that_is_no_lamp(stress_record, source):
    def build(scene, material):
        add_square(scene, material)
        source(scene)

    compared(stress_record, build)


@pytest.mark.parametrize("transform", geometry.TRANSFORMS)
def test_transform_of_the_object(stress_record, transform):
    compared(stress_record, geometry.transformed(transform))


@pytest.mark.parametrize("alpha", [0.01, 0.1, 0.5, 1])
@pytest.mark.parametrize(("distribution", "interpolation"), [("BECKMANN", "LINEAR"), ("GGX", "CLOSEST")])
def test_alpha(stress_record, alpha, distribution, interpolation):
    normal_map = maps.flakes(64, std=0.08) if interpolation == "CLOSEST" else None
    surface = {"roughness": math.sqrt(alpha), "distribution": distribution, "interpolation": interpolation}
    compared(stress_record, geometry.stage, surface=surface, normal_map=normal_map)


@pytest.mark.parametrize("angle", geometry.GRAZING)
def test_grazing_view(stress_record, angle):
    compared(stress_record, lambda scene, material: geometry.tilted(scene, material, 90 - angle, 90 - angle),
             size=(8, 8))


@pytest.mark.parametrize("count", [1, 8, 100])
def test_number_of_lights(stress_record, count):
    compared(stress_record, lights.under(*suns(count)))


def suns(count):
    """So many suns around one direction, which together are as bright as one."""
    turns = [2 * math.pi * k / count for k in range(count)]
    return [lights.lamp("SUN", (1.5 * math.sin(turn), 3 + math.cos(turn), 3), power=1 / count, angle=lights.SUN_ANGLE)
            for turn in turns]


@pytest.mark.parametrize("count", [1, 8])
def test_two_lobes_of_one_material(stress_record, count):
    """Both, with all their lights, in one node stack of Cycles."""
    def build(scene, material):
        tree = material.node_tree
        output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
        surface = output.inputs["Surface"].links[0].from_node
        add = tree.nodes.new("ShaderNodeAddShader")
        if surface.bl_idname == "ShaderNodeGroup":
            second = tree.nodes.new("ShaderNodeGroup")
            second.node_tree = surface.node_tree
            tree.links.new(surface.inputs["Vector"].links[0].from_socket, second.inputs["Vector"])
        else:
            second = surface
        for node, socket in zip((surface, second), add.inputs, strict=True):
            tree.links.new(node.outputs["BSDF"], socket)
        if second is not surface:
            for name in ("Color", "Roughness", "Strength"):
                second.inputs[name].default_value = surface.inputs[name].default_value
        tree.links.new(add.outputs[0], output.inputs["Surface"])
        lights.under(*suns(count))(scene, material)

    compared(stress_record, build)
