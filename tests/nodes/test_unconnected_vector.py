"""A Glint BSDF with nothing connected to Vector, as the Add menu gives it, reads the UV map as textures do."""

import bpy
import numpy as np
import pytest

from benchmarks.counters import counters
from glint_addon import create_glint_material, prepare_scene
from glint_addon.operators.change_map import follow_uv_map
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

SIZE = (16, 16)  # pixels
REPEATS = 5.0


@pytest.fixture
def material(tmp_path):
    """A material of flakes on a square with two UV maps, under a sun."""
    scene = cycles.empty_scene(size=SIZE, spp=4)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    material = create_glint_material("Sparkle", write_flake_map(tmp_path / "flakes.png", 64), interpolation="CLOSEST",
                                     roughness=0.2)
    square = cycles.add_plane(scene, material=material, repeats=REPEATS)
    other = square.data.uv_layers.new(name="Other")
    other.uv.foreach_set("vector", np.float32([0, 0, 1, 0, 1, 1, 0, 1]))
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 4), width=2.0)
    return material


def node_of(material):
    (node,) = [each for each in material.node_tree.nodes if each.bl_idname == "ShaderNodeGroup"]
    return node


def disconnected(material):
    tree, node = material.node_tree, node_of(material)
    tree.links.remove(node.inputs["Vector"].links[0])
    return node


def picture():
    return cycles.rendered(bpy.context.scene)[..., :3]


@pytest.mark.parametrize("osl", [True, False])
def test_unconnected_is_the_uv_map(material, osl):
    scene = bpy.context.scene
    prepare_scene(scene)
    scene.cycles.shading_system = osl
    connected = picture()
    disconnected(material)
    prepare_scene(scene)
    scene.cycles.shading_system = osl
    np.testing.assert_array_equal(picture(), connected)
    assert (connected > 0).any(axis=2).mean() > 0.2


def test_unconnected_costs_the_same(material):
    scene = bpy.context.scene
    prepare_scene(scene)
    connected = counters(scene, material, 1)
    disconnected(material)
    prepare_scene(scene)
    plain = counters(scene, material, 1)
    np.testing.assert_array_equal(plain.visited, connected.visited)
    np.testing.assert_array_equal(plain.fetches, connected.fetches)


def test_a_constant_that_is_connected_counts(material):
    """All of the surface is one texel then, in Blender's nodes and in the lobe."""
    scene = bpy.context.scene
    node = disconnected(material)
    constant = material.node_tree.nodes.new("ShaderNodeCombineXYZ")
    constant.inputs["X"].default_value = 0.3
    material.node_tree.links.new(constant.outputs[0], node.inputs["Vector"])
    prepare_scene(scene)
    scene.cycles.samples = 256
    pictures = {}
    for osl in (True, False):
        scene.cycles.shading_system = osl
        pictures[osl] = picture()
    np.testing.assert_allclose(pictures[True].mean(), pictures[False].mean(), rtol=0.02, atol=1e-6)


def test_another_uv_map_gets_a_node(material):
    node = disconnected(material)
    follow_uv_map(node, "")
    assert not node.inputs["Vector"].is_linked
    follow_uv_map(node, "Other")
    assert node.inputs["Vector"].links[0].from_node.uv_map == "Other"
