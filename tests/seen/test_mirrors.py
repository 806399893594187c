"""Which surfaces count as mirrors: for lights what mirrors sharply alone, for footprints rough ones and glints too."""

import bpy
import pytest

from glint_addon import create_glint_material
from glint_addon.seen.mirrors import has_mirrors
from glint_addon.seen.scene_views import scene_views
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map


def shader(kind, tree=None, **inputs):
    """A material, or a node in `tree`, with one shader node alone."""
    material = None
    if tree is None:
        material = bpy.data.materials.new(kind)
        tree = material.node_tree
        tree.nodes.clear()
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return material or node


def grouped(kind, depth, **inputs):
    """A material with one shader node `depth` groups deep."""
    material = bpy.data.materials.new("Grouped")
    material.node_tree.nodes.clear()
    tree = material.node_tree
    for level in range(depth):
        inner = bpy.data.node_groups.new(f"Level {level}", "ShaderNodeTree")
        inner.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        tree.nodes.new("ShaderNodeGroup").node_tree = inner
        tree = inner
    shader(kind, tree, **inputs)
    return material


def linked_roughness():
    material = shader("ShaderNodeBsdfPrincipled", Roughness=0.9)
    tree = material.node_tree
    value = tree.nodes.new("ShaderNodeValue")
    tree.links.new(value.outputs[0], tree.nodes["Principled BSDF"].inputs["Roughness"])
    return material


def empty_group():
    material = bpy.data.materials.new("Lost")
    material.node_tree.nodes.clear()
    material.node_tree.nodes.new("ShaderNodeGroup")
    return material


# Material, whether it mirrors sharply, whether it shows anything at all.
CASES = {
    "a polished metal": (lambda: shader("ShaderNodeBsdfAnisotropic", Roughness=0.0), True, True),
    "a rough metal": (lambda: shader("ShaderNodeBsdfAnisotropic", Roughness=0.6), False, True),
    "Blender's default": (lambda: shader("ShaderNodeBsdfPrincipled", Roughness=0.5), False, True),
    "a coat over it": (lambda: shader("ShaderNodeBsdfPrincipled", Roughness=0.5, Coat_Weight=0.1), True, True),
    "roughness from elsewhere": (linked_roughness, True, True),
    "glass": (lambda: shader("ShaderNodeBsdfGlass"), True, True),
    "paper": (lambda: shader("ShaderNodeBsdfDiffuse"), False, False),
    "a lamp": (lambda: shader("ShaderNodeEmission"), False, False),
    "a group of paper": (lambda: grouped("ShaderNodeBsdfDiffuse", 2), False, False),
    "a group of polished metal": (lambda: grouped("ShaderNodeBsdfAnisotropic", 2, Roughness=0.0), True, True),
    "a group of rough metal": (lambda: grouped("ShaderNodeBsdfAnisotropic", 2, Roughness=0.6), False, True),
    "a group that is gone": (empty_group, False, False),
}


def counted(scene):
    """Whether mirrors are found of those that lights count, and of those that footprints count."""
    bpy.context.view_layer.update()
    return has_mirrors(scene, sharp=True), has_mirrors(scene, sharp=False)


@pytest.mark.parametrize("name", CASES)
def test_lights_count_sharp_mirrors_and_footprints_all_that_does_not_scatter_evenly(scene, name):
    build, sharp, at_all = CASES[name]
    plane = cycles.add_plane(scene, material=build())
    assert counted(scene) == (sharp, at_all)
    assert not has_mirrors(scene, sharp=False, besides=plane)
    scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = 0
    assert counted(scene) == (False, False)


def test_glints_blur_what_they_mirror_too_much_for_lights_but_not_for_footprints(scene, tmp_path):
    cycles.add_plane(scene, material=create_glint_material("Sparkle", write_flake_map(tmp_path / "flakes.png")))
    assert counted(scene) == (False, True)


def test_a_material_override_counts_as_what_it_is(scene):
    cycles.add_plane(scene, material=shader("ShaderNodeBsdfDiffuse"))
    layer = scene.view_layers[0]
    layer.material_override = shader("ShaderNodeBsdfTranslucent")
    assert counted(scene) == (False, False)
    layer.material_override = shader("ShaderNodeBsdfGlass")
    assert counted(scene) == (True, True)


def test_what_cameras_see_of_glints_is_told_to_be_sharply_mirrored_or_not(scene):
    cycles.add_camera(scene, (0, 0, 3))
    plane = cycles.add_plane(scene, material=CASES["a rough metal"][0]())
    assert not scene_views(scene).has_mirrors
    plane.data.materials[0] = CASES["a polished metal"][0]()
    assert scene_views(scene).has_mirrors
