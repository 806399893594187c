"""How brightly materials and the nodes of lamps shine: an estimate from shader nodes, by which lights are ranked.

For materials it is the estimate of Cycles (`output_estimate_emission` in scene/shader.cpp), which decides what Cycles
samples as a light: a linked colour or strength counts as 1 if only a render could compute it, and mixed shaders count
by their factor. Animated numbers count at their highest key. For lamps the estimate also follows profiles (IES),
falloffs and products.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy

from .ies import peak_strength
from .node_numbers import Groups, number, source

# With the setting Auto, Cycles samples emission as a light above this radiance [W/(m^2 sr)].
LEAST_SAMPLED = 0.5
UNKNOWN = 1.0  # a colour or strength that is not a plain number

Rgb = tuple[float, float, float]  # linear


def sampled_radiance(material: bpy.types.Material) -> float:
    """Highest channel of the radiance [W/(m^2 sr)] of `material`; 0 if Cycles does not sample it as a light.

    Hints would not help there: only rays that meet such a light by chance find it, from a chosen facet too.
    """
    tree = material.node_tree if material else None
    output = tree.get_output_node("CYCLES") if tree else None
    if output is None or material.cycles.emission_sampling == "NONE":
        return 0.0
    found = max(_radiance(material, output.inputs["Surface"], (), _strength))
    return found if found > LEAST_SAMPLED or material.cycles.emission_sampling != "AUTO" else 0.0


def lamp_factor(light: bpy.types.Light) -> Rgb:
    """The largest factor, linear RGB, by which the nodes of a lamp multiply its light."""
    tree = light.node_tree
    if tree is None:
        return 1.0, 1.0, 1.0
    output = tree.get_output_node("CYCLES")
    return _radiance(light, output.inputs["Surface"], (), _strength_of_lamp) if output else (0.0, 0.0, 0.0)


def _radiance(
    holder: bpy.types.ID,
    socket: bpy.types.NodeSocket,
    groups: Groups,
    strength_of: Callable[[bpy.types.ID, bpy.types.NodeSocket, Groups], float],
) -> Rgb:
    """Radiance at a shader socket within `groups`; strength_of: function that estimates a strength."""

    def radiance(entry: bpy.types.NodeSocket) -> Rgb:
        return _radiance(holder, entry, groups, strength_of)

    def emission(colour: bpy.types.NodeSocket, strength: bpy.types.NodeSocket) -> Rgb:
        return _sum((_colour(colour, groups),), (strength_of(holder, strength, groups),))

    end, groups = source(socket, groups)
    node = end.node if end is not None and end.is_output else None
    if node is None:
        return 0.0, 0.0, 0.0
    if node.bl_idname == "ShaderNodeEmission":
        return emission(node.inputs["Color"], node.inputs["Strength"])
    if node.bl_idname == "ShaderNodeBsdfPrincipled":
        return emission(node.inputs["Emission Color"], node.inputs["Emission Strength"])
    if node.bl_idname == "ShaderNodeAddShader":
        return _sum([radiance(entry) for entry in node.inputs], (1.0, 1.0))
    if node.bl_idname == "ShaderNodeMixShader":
        factor, *shaders = node.inputs
        known = number(holder, factor, groups)
        weights = (1.0, 1.0) if known is None or known.moves else (1.0 - known.value, known.value)
        return _sum([radiance(entry) for entry in shaders], weights)
    return 0.0, 0.0, 0.0


def _colour(socket: bpy.types.NodeSocket, groups: Groups) -> Rgb:
    end, _ = source(socket, groups)
    if end is None or end.is_output and end.node.bl_idname != "ShaderNodeRGB":
        return UNKNOWN, UNKNOWN, UNKNOWN
    value = end.default_value
    if isinstance(value, (int, float)):
        return value, value, value  # the input of a group, where a number becomes grey
    red, green, blue, *_ = value
    return red, green, blue


def _sum(colours: Sequence[Rgb], weights: Sequence[float]) -> Rgb:
    """Colours added, each as often as its weight says."""
    red, green, blue = (sum(weight * channel for weight, channel in zip(weights, channels, strict=True))
                        for channels in zip(*colours, strict=True))
    return red, green, blue


def _strength(holder: bpy.types.ID, socket: bpy.types.NodeSocket, groups: Groups) -> float:
    known = number(holder, socket, groups)
    return UNKNOWN if known is None or known.moves and known.peak <= 0.0 else known.peak


def _strength_of_lamp(light: bpy.types.Light, socket: bpy.types.NodeSocket, groups: Groups) -> float:
    """As `_strength`; nodes that make light fall off otherwise than with distance squared count as at one metre."""
    end, inner = source(socket, groups)
    node = end.node if end is not None and end.is_output else None
    if node is None:
        return _strength(light, socket, groups)
    kind = node.bl_idname
    if kind == "ShaderNodeTexIES":
        return peak_strength(node) * _strength_of_lamp(light, node.inputs["Strength"], inner)
    if kind == "ShaderNodeLightFalloff":
        return _strength_of_lamp(light, node.inputs["Strength"], inner)
    if kind == "ShaderNodeMath" and node.operation == "MULTIPLY":
        first, second = node.inputs[:2]
        return _strength_of_lamp(light, first, inner) * _strength_of_lamp(light, second, inner)
    return _strength(light, socket, groups)
