"""Normal map filtering with a wider roughness: what people do against the fireflies of a normal map.

Olano, Baker: LEAN Mapping, I3D 2010 (mean and covariance of the slopes in a mip level, to which the lobe's own
covariance alpha^2 / 2 is added), as Toksvig: Mipmapping Normal Maps, Journal of Graphics Tools 10(3), 2005, did with
one number. For a Beckmann lobe, whose density of slopes s is exp(-|s|^2 / alpha^2) / (pi alpha^2), adding slopes of
variance sigma^2 along an axis gives alpha'^2 = alpha^2 + 2 sigma^2 along it. GGX has no variance; there the same
formula is in use and used.
"""

from __future__ import annotations

import math

import bpy
import numpy as np

from demo_scenes import maps
from demo_scenes.truth import truth_material
from glint_addon.images import image_pixels

LARGEST_ANISOTROPY = 0.99  # Cycles clamps there


def widened_material(image, texels, *, roughness=0.1, interpolation="LINEAR", strength=1.0, uv_map="", **surface):
    """Blender's nodes for `image` at the level whose texel is a pixel of `texels` texels, its roughness widened.

    The other arguments are those of `truth_material`. A mip level is interpolated; the map itself as it is told.
    """
    slopes = maps.decoded_slopes(image_pixels(image)[..., :3]) * strength
    level = mip_level(texels, slopes.shape[:2])
    mean, covariance = block_moments(slopes, level)
    filtered = maps.blender_image("Mean slopes", maps.encoded_normals(mean))
    lobes = maps.blender_image("Lobes", lobe_parameters(covariance, roughness**2))
    chosen = interpolation if level == 0 else "LINEAR"
    material = truth_material("Widened", filtered, interpolation=chosen, uv_map=uv_map, **surface)
    _link_lobes(material.node_tree, lobes, uv_map)
    return material


def mip_level(texels, size) -> int:
    """The level of a map of `size` = (height, width) whose texel covers about `texels` texels of the map."""
    largest = int(math.log2(min(size) & -min(size)))
    return min(max(round(math.log2(max(texels, 1.0)) / 2), 0), largest)


def block_moments(slopes, level):
    """Mean (h, w, 2) and covariance (h, w, 2, 2) of the slopes (height, width, 2) in blocks of 2^level texels."""
    side = 1 << level
    height, width = slopes.shape[0] // side, slopes.shape[1] // side
    blocks = slopes.reshape(height, side, width, side, 2)
    mean = blocks.mean(axis=(1, 3))
    second = np.einsum("abcdi,abcdj->acij", blocks, blocks) / side**2
    return mean, second - mean[..., :, None] * mean[..., None, :]


def lobe_parameters(covariance, alpha) -> np.ndarray:
    """Roughness, anisotropy and rotation (0..1 turns) of Blender's Glossy BSDF, float32 (h, w, 3), for each block.

    Blender's lobe of roughness r and anisotropy a has alpha_x = r^2 (1 - a) along the rotated tangent, alpha_y =
    r^2 / (1 - a) across.
    """
    variances, axes = np.linalg.eigh(covariance)
    narrow, wide = np.moveaxis(np.sqrt(alpha**2 + 2.0 * np.maximum(variances, 0.0)), -1, 0)
    anisotropy = np.minimum(1.0 - np.sqrt(narrow / wide), LARGEST_ANISOTROPY)
    angle = np.arctan2(axes[..., 1, 0], axes[..., 0, 0])
    rotation = (angle / (2.0 * math.pi)) % 0.5
    return np.stack([np.sqrt(np.sqrt(narrow * wide)), anisotropy, rotation], axis=-1).astype(np.float32)


def _link_lobes(tree: bpy.types.NodeTree, lobes, uv_map):
    """Let the tree's Glossy BSDF take its roughness, anisotropy and rotation from the picture `lobes`."""
    glossy = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfAnisotropic")
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = lobes
    # Rotations must not be interpolated: between two that differ by half a turn, the same lobe, lies another.
    texture.interpolation = "Closest"
    coordinates = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeUVMap")
    tree.links.new(coordinates.outputs["UV"], texture.inputs["Vector"])
    split = tree.nodes.new("ShaderNodeSeparateColor")
    tree.links.new(texture.outputs["Color"], split.inputs["Color"])
    for channel, name in (("Red", "Roughness"), ("Green", "Anisotropy"), ("Blue", "Rotation")):
        tree.links.new(split.outputs[channel], glossy.inputs[name])
    tangent = tree.nodes.new("ShaderNodeTangent")
    tangent.direction_type = "UV_MAP"
    tangent.uv_map = uv_map
    tree.links.new(tangent.outputs["Tangent"], glossy.inputs["Tangent"])
