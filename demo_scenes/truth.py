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
    presence=None,
    flake_color=None,
    base_color=(0.8, 0.8, 0.8),
) -> bpy.types.Material:
    """Image Texture (Non-Color) -> Normal Map (tangent space) -> BSDF, as Blender's manual tells to do.

    The BSDF is Glossy, Metallic, or Principled without any other lobe than the specular one. The arguments are those of
    `glint_addon.create_glint_material`: roughness 0..1 of a facet (alpha is its square), and values of the choices of
    the same names (a dielectric is always GGX); presence and flake_color are images. `image` must be Non-Color data.
    Raises ValueError for an image shown as colour, KeyError or TypeError for an unknown choice or a value that the BSDF
    has not.
    """
    if not image.colorspace_settings.is_data:
        raise ValueError(f'Image "{image.name}" is shown as colour: set its colour space to Non-Color.')
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()

    coordinates = tree.nodes.new("ShaderNodeUVMap")
    coordinates.uv_map = uv_map
    texture = _texture(tree, image, coordinates, INTERPOLATION.value(interpolation).native)
    normal_map = tree.nodes.new("ShaderNodeNormalMap")
    normal_map.convention = convention
    normal_map.uv_map = uv_map
    normal_map.inputs["Strength"].default_value = strength
    facets = _facets(tree, surface, color=color, edge_tint=edge_tint, ior=ior, extinction=extinction)
    facets.distribution = "GGX" if surface == "DIELECTRIC" else distribution
    facets.inputs["Roughness"].default_value = roughness
    tree.links.new(texture.outputs["Color"], normal_map.inputs["Color"])
    tree.links.new(normal_map.outputs["Normal"], facets.inputs["Normal"])
    shader = facets.outputs["BSDF"]
    if flake_color is not None:
        _multiply(tree, facets.inputs[COLORS[surface]], _texture(tree, flake_color, coordinates).outputs["Color"])
    if presence is not None:
        shader = _over_base(tree, shader, _texture(tree, presence, coordinates).outputs["Color"], base_color)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader, output.inputs["Surface"])
    return material


def _texture(tree, image, coordinates, interpolation="Closest"):
    """An Image Texture node at the UVs of the node `coordinates`."""
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, interpolation
    tree.links.new(coordinates.outputs["UV"], node.inputs["Vector"])
    return node


def _multiply(tree, socket, color):
    """Multiply the value of an input by `color`."""
    product = tree.nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    product.inputs[0].default_value = socket.default_value[:3]
    tree.links.new(color, product.inputs[1])
    tree.links.new(product.outputs["Vector"], socket)


def _over_base(tree, shader, presence, base_color):
    """`shader` where presence is above 0.5, else a Principled BSDF."""
    base = tree.nodes.new("ShaderNodeBsdfPrincipled")
    base.inputs["Base Color"].default_value = (*base_color, 1.0)
    is_flake = tree.nodes.new("ShaderNodeMath")
    is_flake.operation = "GREATER_THAN"
    is_flake.inputs[1].default_value = 0.5
    mix = tree.nodes.new("ShaderNodeMixShader")
    for one, other in ((presence, is_flake.inputs[0]), (is_flake.outputs[0], mix.inputs["Factor"]),
                       (base.outputs["BSDF"], mix.inputs[1]), (shader, mix.inputs[2])):
        tree.links.new(one, other)
    return mix.outputs[0]


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
