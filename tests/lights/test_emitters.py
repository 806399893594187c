"""Emissive meshes as hints: which become one, how bright they are taken to be, and how drivers follow them."""

import math
import random

import bpy
import numpy as np
import pytest
from mathutils import Vector

from glint_addon.lights.drivers import connect_hints
from glint_addon.lights.emission import sampled_radiance
from glint_addon.lights.emitters import DEFORMS
from glint_addon.lights.softness import TOO_SOFT
from glint_addon.nodes import glint_bsdf, glint_lights
from glint_addon.nodes.glint_lights import KIND_LOCAL
from tests.helpers import cycles
from tests.helpers.scene_hints import scene_hints

# Blender keeps matrices and sockets in 32-bit floats, expressions seven digits; positions here are tens of metres.
PLACE_TOLERANCE = 1e-4
# A ball of 32 flat segments looks 1.3 % smaller than a round one; 256 samples leave a noise of 1 %.
IRRADIANCE_TOLERANCE = 0.04
STRENGTH = 8.0


def emissive(strength=STRENGTH, colour=(1, 1, 1)):
    """A material that Cycles samples as a light."""
    material, socket = cycles.emission_material("Bulb")
    material.cycles.emission_sampling = "AUTO"
    socket.default_value = (*colour, 1)
    socket.node.inputs["Strength"].default_value = strength
    return material


def add_bulb(scene, radius=0.1, location=(0, 0, 5), **settings):
    bulb = cycles.add_sphere(scene, radius, material=emissive(**settings), segments=32, rings=16)
    bulb.name = "Bulb"
    bulb.location = location
    return bulb


def add_glints(scene, size=2.0):
    """A square whose material has a Glint BSDF and reads the group of lights, but looks white."""
    square = cycles.add_plane(scene, size)
    square.data.materials.append(bpy.data.materials.new("Glints"))
    tree = square.data.materials[0].node_tree
    for group in (glint_bsdf.build(), glint_lights.build()):
        tree.nodes.new("ShaderNodeGroup").node_tree = group
    white = tree.nodes.new("ShaderNodeBsdfDiffuse")
    white.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(white.outputs["BSDF"], tree.get_output_node("CYCLES").inputs["Surface"])
    return square


def slot_values(slot=1, *, of_library=False):
    """Evaluated Light and Shape of a slot; of_library: as the group that is linked from another file reads them."""
    linked = [group for group in bpy.data.node_groups if group.name == glint_lights.NAME and group.library]
    group = linked[0] if of_library else glint_lights.build()
    nodes = group.evaluated_get(bpy.context.evaluated_depsgraph_get()).nodes
    return [[nodes[f"{name} {slot}"].inputs[axis].default_value for axis in "XYZ"] for name in ("Light", "Shape")]


def principled(material):
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.inputs["Emission Color"].default_value = (0.5, 0.25, 0, 1)
    node.inputs["Emission Strength"].default_value = 6.0
    tree.links.new(node.outputs["BSDF"], tree.get_output_node("CYCLES").inputs["Surface"])


def mixed(material):
    tree = material.node_tree
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.25
    tree.links.new(tree.nodes["Emission"].outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])


def added_to_itself(material):
    tree = material.node_tree
    add = tree.nodes.new("ShaderNodeAddShader")
    for socket in add.inputs:
        tree.links.new(tree.nodes["Emission"].outputs[0], socket)
    tree.links.new(add.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])


def in_a_group(material):
    """The strength comes from a Value node by way of the group's input."""
    group = bpy.data.node_groups.new("Lamp", "ShaderNodeTree")
    group.interface.new_socket("Power", in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketShader")
    emission, entry, end = (group.nodes.new(kind) for kind in
                            ("ShaderNodeEmission", "NodeGroupInput", "NodeGroupOutput"))
    group.links.new(entry.outputs["Power"], emission.inputs["Strength"])
    group.links.new(emission.outputs[0], end.inputs["Light"])
    tree = material.node_tree
    node, value = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeValue")
    node.node_tree = group
    value.outputs[0].default_value = 4.0
    tree.links.new(value.outputs[0], node.inputs["Power"])
    tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    emission.inputs["Color"].default_value = (1, 1, 1, 1)


def textured(material):
    tree = material.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeTexChecker").outputs["Color"], tree.nodes["Emission"].inputs["Color"])


def brighter_later(material):
    strength = material.node_tree.nodes["Emission"].inputs["Strength"]
    for frame, value in ((1, 0.0), (5, 30.0), (9, 0.0)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)


def not_sampled(material):
    material.cycles.emission_sampling = "NONE"


def weak(material):
    material.node_tree.nodes["Emission"].inputs["Strength"].default_value = 0.4


def weak_but_sampled(material):
    weak(material)
    material.cycles.emission_sampling = "FRONT"


@pytest.mark.parametrize(("change", "expected"), [
    (principled, 3.0), (mixed, 2.0), (added_to_itself, 16.0), (in_a_group, 4.0), (textured, 8.0),
    (brighter_later, 30.0), (not_sampled, 0.0), (weak, 0.0), (weak_but_sampled, 0.4),
])
def test_the_radiance_of_a_material_is_that_of_its_emission_as_cycles_samples_it(scene, change, expected):
    material = emissive()
    assert sampled_radiance(material) == STRENGTH
    change(material)
    assert sampled_radiance(material) == pytest.approx(expected)


def test_the_estimated_irradiance_of_a_bulb_is_what_cycles_puts_on_a_white_plane():
    scene = cycles.empty_scene(size=(4, 4), spp=256, osl=False)
    cycles.add_camera(scene, (0, 0, 1), width=0.005)
    add_glints(scene, 0.01)
    bulb = add_bulb(scene, 0.125)
    bulb.scale = (2, 2, 2)
    [hint], _ = scene_hints(scene)
    expected = math.pi * cycles.rendered(scene)[..., 0].mean()
    assert hint.power == pytest.approx(expected, rel=IRRADIANCE_TOLERANCE)


def test_the_middle_of_the_emissive_faces_is_followed_through_parents_shear_and_mirroring(scene):
    pick = random.Random(2)
    add_glints(scene)
    parent = bpy.data.objects.new("Parent", None)
    scene.collection.objects.link(parent)
    # Half of the mesh shines: a square around (3, -2, 1), and one does not.
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) / 10
    bulb = cycles.add_mesh(scene, np.concatenate([corners + (3, -2, 1), corners]), [(0, 1, 2, 3), (4, 5, 6, 7)])
    bulb.data.materials.append(emissive())
    bulb.data.materials.append(emissive(0.0))
    bulb.data.polygons[1].material_index = 1
    bulb.parent = parent
    connect_hints(glint_lights.build(), scene, scene_hints(scene)[0])
    for _ in range(30):
        for thing in (bulb, parent):
            thing.location = [pick.uniform(-10, 10) for _ in range(3)]
            thing.rotation_euler = [pick.uniform(-7, 7) for _ in range(3)]
            thing.scale = [pick.uniform(-2, 2) for _ in range(3)]
        bpy.context.view_layer.update()
        place, (kind, size, _) = slot_values()
        assert (Vector(place) - bulb.matrix_world @ Vector((3, -2, 1))).length < PLACE_TOLERANCE
        assert kind == KIND_LOCAL
        columns = [bulb.matrix_world.col[axis].to_3d().length for axis in range(3)]
        assert size == pytest.approx(0.1 * math.sqrt(2) * max(columns), rel=1e-5)


def test_a_deleted_or_hidden_bulb_is_no_light(scene):
    add_glints(scene)
    bulb = add_bulb(scene)
    bulb.hide_render = True
    bulb.keyframe_insert("hide_render", frame=1)
    bulb.hide_render = False
    bulb.keyframe_insert("hide_render", frame=2)
    scene.frame_set(1)
    connect_hints(glint_lights.build(), scene, scene_hints(scene)[0])
    assert slot_values()[1][0] == 0
    scene.frame_set(2)
    assert slot_values()[1][0] == KIND_LOCAL
    bpy.data.objects.remove(bulb)
    bpy.context.view_layer.update()
    assert slot_values()[1][0] == 0


def exclude_square(bulb):
    receivers = bulb.light_linking.receiver_collection = bpy.data.collections.new("Receivers")
    receivers.objects.link(bpy.data.objects["Mesh"])
    receivers.collection_objects[0].light_linking.link_state = "EXCLUDE"


@pytest.mark.parametrize(("spoil", "words"), [
    (lambda bulb: setattr(bulb, "hide_render", True), "hidden in renders"),
    (lambda bulb: setattr(bulb, "visible_glossy", False), "glossy"),
    (lambda bulb: setattr(bulb, "scale", (30, 30, 30)), TOO_SOFT),
    (lambda bulb: bulb.modifiers.new("Wave", "WAVE"), DEFORMS),
    (lambda bulb: bulb.shape_key_add().id_data.keyframe_insert("eval_time", frame=1), DEFORMS),
    (exclude_square, "light linking"),
], ids=["hidden", "glossy", "large", "wave", "shape keys", "linking"])
def test_an_emissive_object_that_needs_no_hint_is_skipped_and_the_reason_said(scene, spoil, words):
    add_glints(scene)
    bulb = add_bulb(scene)
    assert [hint.name for hint in scene_hints(scene)[0]] == ["Bulb"]
    spoil(bulb)
    hints, [(name, reason)] = scene_hints(scene)
    assert (hints, name) == ([], "Bulb")
    assert words in reason


def test_curves_and_text_that_shine_are_lights_too(scene):
    curve = bpy.data.curves.new("Neon", "FONT")
    curve.body, curve.size, curve.extrude = "Open", 0.1, 0.01
    curve.materials.append(emissive())
    sign = bpy.data.objects.new("Neon", curve)
    sign.location = (1, 2, 3)
    scene.collection.objects.link(sign)
    [hint], _ = scene_hints(scene)
    assert (hint.name, hint.kind) == ("Neon", KIND_LOCAL)
    assert 0.05 < hint.size < 0.3
    assert (Vector(hint.middle(sign.matrix_world)) - sign.location).length < 0.3
