"""Glint Car Paint: a base coat, flakes in it, and a clear coat over both.

Between the flakes of a Glint BSDF lies the base coat, a Principled BSDF. The clear coat lies over both: a Glossy BSDF
that reflects as much as Fresnel's equations say, and what it lets through is coloured by it. The map belongs to the
Glint BSDF inside, so there is one group for each material.
"""

from __future__ import annotations

import bpy

from .builder import Socket, add_math, add_node, add_sockets, arrange, new_group
from .flake_nodes import BASE
from .glint_bsdf import BSDF, ROUGHNESS, STRENGTH, VECTOR
from .surface_kinds import KINDS, surface_of

NAME = "Glint Car Paint"
VERSION = 1
FLAKES_NODE, BASE_NODE, COAT_NODE, COAT_MIX = "Flakes", "Base", "Coat", "Base or coat"

BASE_COLOR = Socket("Base Color", "NodeSocketColor", default=(0.1, 0.1, 0.1, 1.0), help="Color of the base coat")
BASE_ROUGHNESS = Socket(
    "Base Roughness", "NodeSocketFloat", default=0.5, low=0.0, high=1.0, subtype="FACTOR",
    help="Roughness of the base coat",
)
FLAKE_COLOR = Socket(
    "Flake Color", "NodeSocketColor", default=(1.0, 1.0, 1.0, 1.0), help="Factor of the flakes' colors"
)
FLAKE_ROUGHNESS = Socket(
    "Flake Roughness", "NodeSocketFloat", default=0.2, low=0.0, high=1.0, subtype="FACTOR", help="Roughness of a flake",
)
FLAKE_STRENGTH = Socket(
    "Flake Strength", "NodeSocketFloat", default=1.0, low=0.0, high=10.0, help="How far the flakes are tilted",
)
COAT_COLOR = Socket(
    "Coat Color", "NodeSocketColor", default=(1.0, 1.0, 1.0, 1.0), help="What the clear coat lets through: candy paints"
)
COAT_ROUGHNESS = Socket(
    "Coat Roughness", "NodeSocketFloat", default=0.03, low=0.0, high=1.0, subtype="FACTOR",
    help="Roughness of the clear coat",
)
COAT_IOR = Socket(
    "Coat IOR", "NodeSocketFloat", default=1.5, low=1.0, high=4.0, help="Refractive index of the clear coat; 1: none",
)
INPUTS = (BASE_COLOR, BASE_ROUGHNESS, FLAKE_COLOR, FLAKE_ROUGHNESS, FLAKE_STRENGTH, COAT_COLOR, COAT_ROUGHNESS,
          COAT_IOR, VECTOR)


def new_car_paint(glint: bpy.types.ShaderNodeTree) -> bpy.types.ShaderNodeTree:
    """A new group around the Glint BSDF group `glint`, whose surface must have a colour."""
    group = new_group(NAME, VERSION, "Base coat, flakes and clear coat")
    add_sockets(group, (BSDF,), INPUTS)
    source, output = add_node(group, "NodeGroupInput"), add_node(group, "NodeGroupOutput")

    def tinted(socket):
        return add_math(group, "MULTIPLY", source.outputs[socket.name], source.outputs[COAT_COLOR.name], vector=True)

    base = add_node(group, "ShaderNodeBsdfPrincipled", BASE_NODE, inputs={"Specular IOR Level": 0.0})
    flakes = add_node(group, "ShaderNodeGroup", FLAKES_NODE, node_tree=glint)
    coat = add_node(group, "ShaderNodeBsdfAnisotropic", COAT_NODE, distribution="GGX",
                    inputs={"Color": (1.0, 1.0, 1.0, 1.0)})
    fresnel = add_node(group, "ShaderNodeFresnel")
    mix = add_node(group, "ShaderNodeMixShader", COAT_MIX)
    links = [
        (tinted(BASE_COLOR), base.inputs["Base Color"]),
        (source.outputs[BASE_ROUGHNESS.name], base.inputs["Roughness"]),
        (tinted(FLAKE_COLOR), flakes.inputs[KINDS[surface_of(glint)].color.name]),
        (source.outputs[FLAKE_ROUGHNESS.name], flakes.inputs[ROUGHNESS.name]),
        (source.outputs[FLAKE_STRENGTH.name], flakes.inputs[STRENGTH.name]),
        (source.outputs[VECTOR.name], flakes.inputs[VECTOR.name]),
        (source.outputs[COAT_ROUGHNESS.name], coat.inputs["Roughness"]),
        (source.outputs[COAT_IOR.name], fresnel.inputs["IOR"]),
        (fresnel.outputs[0], mix.inputs["Factor"]),
        (flakes.outputs[BSDF.name], mix.inputs[1]),
        (coat.outputs["BSDF"], mix.inputs[2]),
        (mix.outputs[0], output.inputs[BSDF.name]),
    ]
    if BASE.name in flakes.inputs:
        links.append((base.outputs["BSDF"], flakes.inputs[BASE.name]))
    for one, other in links:
        group.links.new(one, other)
    group.interface.items_tree[VECTOR.name].hide_value = True
    arrange(group)
    return group
