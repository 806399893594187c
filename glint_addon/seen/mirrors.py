"""Which surfaces of a scene may show others: by the shader nodes of their materials, at any depth of groups.

Footprints and lights ask for different surfaces, because a mistake costs something different in each:
* Footprints count every surface that does not scatter light evenly: a ray that a rough surface or a glint sends on
  is as narrow as before, so what it meets has the footprint of the whole way. A range that is too wide costs memory,
  one that is too narrow noise and time.
* Lights count only what mirrors sharply: a rough surface or the facets of a glint blur what they show so much that the
  noise of a light left out is not seen there, and a wrong yes would keep every light of nearly every scene.
"""

from __future__ import annotations

import bpy

from ..materials.worn import worn_materials
from ..nodes.glint_bsdf import is_glint_group

# Rougher surfaces (alpha from 0.25) blur what they mirror so much that it needs no hints.
ROUGH = 0.5
# Shader nodes that scatter light evenly or not at all: no surface is seen in them.
NO_MIRRORS = {
    "ShaderNodeAddShader", "ShaderNodeBackground", "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent",
    "ShaderNodeBsdfTranslucent", "ShaderNodeEmission", "ShaderNodeHoldout", "ShaderNodeMixShader",
}


def renders_mirrors(scene: bpy.types.Scene) -> bool:
    """Whether a path of the scene may go on from a surface that mirrors or refracts."""
    cycles = scene.cycles
    return cycles.max_bounces > 0 and max(cycles.glossy_bounces, cycles.transmission_bounces) > 0


def has_mirrors(scene: bpy.types.Scene, *, sharp: bool, besides: bpy.types.Object | None = None) -> bool:
    """Whether surfaces of the scene, but for those of object `besides`, may show others.

    sharp: whether only those count that mirror sharply. Matrices and modifiers must be current.
    """
    if not renders_mirrors(scene):
        return False
    layers = [layer for layer in scene.view_layers if layer.use]
    shown = {material for thing in scene.objects if thing != besides for material in worn_materials(thing, layers)}
    # An override stands in for all materials.
    shown |= {layer.material_override for layer in scene.view_layers if layer.material_override is not None}
    return any(_mirrors(material.node_tree, sharp, set()) for material in shown)


def _mirrors(tree: bpy.types.NodeTree | None, sharp: bool, seen: set[bpy.types.NodeTree]) -> bool:
    """Whether a tree of nodes may mirror or refract."""
    if tree is None or tree in seen or sharp and is_glint_group(tree):
        return False
    seen.add(tree)
    return any(
        _mirrors(node.node_tree, sharp, seen) if node.bl_idname == "ShaderNodeGroup"
        else node.bl_idname not in NO_MIRRORS and _has_shader(node) and not (sharp and _is_rough(node))
        for node in tree.nodes
    )


def _has_shader(node: bpy.types.Node) -> bool:
    return any(output.type == "SHADER" for output in node.outputs)


def _is_rough(node: bpy.types.Node) -> bool:
    """Whether all that a shader node mirrors is blurred."""
    roughness, coat = node.inputs.get("Roughness"), node.inputs.get("Coat Weight")
    if roughness is None or roughness.is_linked or roughness.default_value < ROUGH:
        return False
    return coat is None or not coat.is_linked and coat.default_value == 0.0
