"""The right answer as a material: Blender's own nodes, which converge to the truth with enough samples."""

from __future__ import annotations

import bpy

from glint_addon.nodes.map_choices import CONVENTION, DISTRIBUTION, INTERPOLATION, SURFACE

# Of each kind of surface Blender's node, and what that calls its colour.
NODES = {"TINT": "ShaderNodeBsdfAnisotropic", "METAL": "ShaderNodeBsdfMetallic", "CONDUCTOR": "ShaderNodeBsdfMetallic",
         "DIELECTRIC": "ShaderNodeBsdfPrincipled"}
COLORS = {"TINT": "Color", "METAL": "Base Color", "DIELECTRIC": "Specular Tint"}


def truth_material(
    name,
    image,
    *,
    roughness=0.1,
    distribution=DISTRIBUTION.default,
    interpolation=INTERPOLATION.default,
    convention=CONVENTION.default,
    strength=1.0,
    color=None,
    uv_map="",
    surface=SURFACE.default,
    edge_tint=None,
    ior=None,
    extinction=None,
) -> bpy.types.Material:
    """Image Texture (Non-Color) -> Normal Map (tangent space) -> BSDF, as Blender's manual tells to do.

    The BSDF is Glossy, Metallic, or Principled without any other lobe than the specular one. The arguments are those of
    `glint_addon.create_glint_material`: roughness 0..1 of a facet (alpha is its square), and values of the choices of
    the same names. `image` must be Non-Color data. Raises ValueError for an image shown as colour, KeyError or
    TypeError for an unknown choice or a value that the BSDF has not.
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
    facets = _facets(tree, surface, color=color, edge_tint=edge_tint, ior=ior, extinction=extinction)
    facets.distribution = distribution
    facets.inputs["Roughness"].default_value = roughness
    output = tree.nodes.new("ShaderNodeOutputMaterial")

    coordinates = tree.nodes.new("ShaderNodeUVMap")
    coordinates.uv_map = uv_map
    tree.links.new(coordinates.outputs["UV"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], normal_map.inputs["Color"])
    tree.links.new(normal_map.outputs["Normal"], facets.inputs["Normal"])
    tree.links.new(facets.outputs["BSDF"], output.inputs["Surface"])
    return material


def _facets(tree, surface, *, color, edge_tint, ior, extinction):
    """Blender's node for a kind of surface, with the values that are not None."""
    node = tree.nodes.new(NODES[surface])
    if surface == "TINT":
        node.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    elif surface == "DIELECTRIC":
        node.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    else:
        node.fresnel_type = "F82" if surface == "METAL" else "PHYSICAL_CONDUCTOR"
    values = {COLORS.get(surface): color and (*color[:3], 1.0), "Edge Tint": edge_tint and (*edge_tint[:3], 1.0),
              "IOR": ior, "Extinction": extinction}
    for name, value in values.items():
        if value is not None:
            node.inputs[name].default_value = value
    return node
