"""The right answer as a material: Blender's own nodes, which converge to the truth with enough samples."""

from __future__ import annotations

import bpy

from glint_addon.nodes.map_choices import CONVENTION, DISTRIBUTION, INTERPOLATION


def truth_material(
    name,
    image,
    *,
    roughness=0.1,
    distribution=DISTRIBUTION.default,
    interpolation=INTERPOLATION.default,
    convention=CONVENTION.default,
    strength=1.0,
    color=(1.0, 1.0, 1.0),
    uv_map="",
) -> bpy.types.Material:
    """Image Texture (Non-Color) -> Normal Map (tangent space) -> Glossy BSDF, as Blender's manual tells to do.

    The arguments are those of `glint_addon.create_glint_material`: roughness 0..1 of a facet (alpha is its square), and
    values of the choices of the same names. `image` must be Non-Color data. Raises ValueError for an image shown as
    colour, KeyError or TypeError for an unknown choice.
    """
    if not image.colorspace_settings.is_data:
        raise ValueError(f'Image "{image.name}" is shown as colour: set its colour space to Non-Color.')
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()

    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    texture.interpolation = INTERPOLATION.value(interpolation).native
    normal_map = tree.nodes.new("ShaderNodeNormalMap")
    normal_map.convention = convention
    normal_map.uv_map = uv_map
    normal_map.inputs["Strength"].default_value = strength
    glossy = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    glossy.distribution = distribution
    glossy.inputs["Color"].default_value = (*color, 1.0)
    glossy.inputs["Roughness"].default_value = roughness
    output = tree.nodes.new("ShaderNodeOutputMaterial")

    coordinates = tree.nodes.new("ShaderNodeUVMap")
    coordinates.uv_map = uv_map
    tree.links.new(coordinates.outputs["UV"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], normal_map.inputs["Color"])
    tree.links.new(normal_map.outputs["Normal"], glossy.inputs["Normal"])
    tree.links.new(glossy.outputs["BSDF"], output.inputs["Surface"])
    return material
