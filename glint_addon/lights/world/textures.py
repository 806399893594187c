"""The pictures and skies of a world's surface: its nodes followed from the output back to its textures."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..node_numbers import Groups, number, source

SENDERS = {"ShaderNodeBackground", "ShaderNodeEmission"}
TEXTURES = {"ShaderNodeTexEnvironment", "ShaderNodeTexSky"}
# Nodes that leave small bright places small and bright. They are taken to change no power.
COLOUR_CHANGES = {"ShaderNodeBrightContrast", "ShaderNodeClamp", "ShaderNodeGamma", "ShaderNodeHueSaturation",
                  "ShaderNodeMath", "ShaderNodeRGBCurve", "ShaderNodeRGBToBW", "ShaderNodeVectorMath"}
EVEN = {"ShaderNodeBlackbody", "ShaderNodeLightPath", "ShaderNodeRGB", "ShaderNodeValue", "ShaderNodeWavelength"}

UNKNOWN = 'its node "{}" cannot be looked into: small lights behind it are left to chance, which is noisier'


@dataclass(frozen=True)
class Texture:
    """A texture that the world shines with.

    node: its node; groups: the group nodes around it, outermost first; factor: the number by which its radiance is
    multiplied, as far as the nodes tell, and the largest over time.
    """

    node: bpy.types.ShaderNode
    groups: Groups
    factor: float


def world_textures(world: bpy.types.World) -> tuple[list[Texture], list[str]]:
    """The textures behind the surface of `world`, and why others are left out, in words."""
    output = world.node_tree.get_output_node("CYCLES") if world.node_tree else None
    walk = _Walk(world)
    if output is not None:
        walk.shader(output.inputs["Surface"], (), 1.0)
    textures = [Texture(*place, factor) for place, factor in walk.factors.items()]
    return textures, list(dict.fromkeys(walk.left_out))


class _Walk:
    """Follows shader and colour sockets and gathers the textures found."""

    def __init__(self, world: bpy.types.World) -> None:
        self.world = world
        self.factors: dict[tuple[bpy.types.ShaderNode, Groups], float] = {}
        self.left_out: list[str] = []

    def shader(self, socket: bpy.types.NodeSocket, groups: Groups, factor: float) -> None:
        """Follow a shader socket whose light is multiplied by `factor`."""
        end, groups = source(socket, groups)
        if factor <= 0 or end is None or not end.is_output:
            return
        node = end.node
        if node.bl_idname in SENDERS:
            found = number(self.world, node.inputs["Strength"], groups)
            strength = found.peak if found else 1.0
            if strength > 0:
                self.colour(node.inputs["Color"], groups, factor * strength)
            else:
                self.left_out.append(f'the strength of its node "{node.name}" is zero or negative')
        elif node.bl_idname == "ShaderNodeAddShader":
            for entry in node.inputs:
                self.shader(entry, groups, factor)
        elif node.bl_idname == "ShaderNodeMixShader":
            for entry, share in zip(node.inputs[1:], self.shares(node.inputs[0], groups), strict=True):
                self.shader(entry, groups, factor * share)
        else:
            self.left_out.append(UNKNOWN.format(node.name))

    def colour(self, socket: bpy.types.NodeSocket, groups: Groups, factor: float) -> None:
        """Follow a colour socket whose light is multiplied by `factor`; an even colour has no spots."""
        end, groups = source(socket, groups)
        if factor <= 0 or end is None or not end.is_output:
            return
        node = end.node
        if node.bl_idname in TEXTURES:
            self.factors[node, groups] = self.factors.get((node, groups), 0.0) + factor
        elif node.bl_idname == "ShaderNodeMix":
            shares = self.shares(node.inputs["Factor"], groups) if node.blend_type == "MIX" else (1.0, 1.0)
            ends = [entry for entry in node.inputs if entry.enabled and entry.identifier[0] in "AB"]
            for entry, share in zip(ends, shares, strict=True):
                self.colour(entry, groups, factor * share)
        elif node.bl_idname in COLOUR_CHANGES:
            for entry in node.inputs:
                self.colour(entry, groups, factor)
        elif node.bl_idname not in EVEN:
            self.left_out.append(UNKNOWN.format(node.name))

    def shares(self, socket: bpy.types.NodeSocket, groups: Groups) -> tuple[float, float]:
        """How much the first and the second of two mixed inputs count, at most over time."""
        end, _ = source(socket, groups)
        if end is not None and end.is_output and end.node.bl_idname == "ShaderNodeLightPath":
            # Rays to a light and mirrored rays are no camera rays, so the first input counts alone. Mirrored rays may
            # be of the other kinds, so both inputs count.
            return (1.0, 0.0) if end.name == "Is Camera Ray" else (1.0, 1.0)
        factor = number(self.world, socket, groups)
        if factor is None or factor.moves:
            return 1.0, 1.0
        value = min(max(factor.value, 0.0), 1.0)
        return 1.0 - value, value
