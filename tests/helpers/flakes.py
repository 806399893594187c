"""Flakes with presence and colour: the truth by Blender's own nodes, and the lobe with tables that are baked here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from demo_scenes.maps import blender_image, encoded_normals
from demo_scenes.truth import truth_material
from glint_addon import create_glint_material, prepare_scene
from glint_addon.bake.counts import bake_counts, counts_levels
from glint_addon.bake.flakes import bake_flakes
from glint_addon.bake.normal_map import decoded_normals, flake_normals, slope_bounds
from glint_addon.bake.slope_index import bake_index
from glint_addon.bake.table import bake_table
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.map_tables import SCRIPT_NODE


@dataclass
class Sheet:
    """A map of flakes: encoded normals (size, size, 3), which texels are flakes, and their colours or None."""

    encoded: np.ndarray
    presence: np.ndarray
    colors: np.ndarray | None

    @property
    def name(self) -> str:
        return f"sheet {self.encoded.sum():.3f} {self.presence.sum()} {self.colors is not None}"


def populations(size, share, *, colored=True, std=0.2, seed=1) -> Sheet:
    """Flakes that cover `share` of the map: reddish ones that lie flat, and blueish ones that are tilted."""
    rng = np.random.default_rng(seed)
    kind = rng.random((size, size)) < 0.5
    slopes = rng.normal(0, std, (size, size, 2)) * np.where(kind, 1.0, 0.5)[..., None]
    colors = np.where(kind[..., None], [0.15, 0.3, 0.9], [0.9, 0.4, 0.1]) * rng.uniform(0.6, 1.1, (size, size, 1))
    presence = rng.random((size, size)) < share
    return Sheet(encoded_normals(slopes), presence, colors.astype(np.float32) if colored else None)


def diffuse(tree, color=(0.2, 0.25, 0.2)):
    """The output of a new Diffuse BSDF."""
    node = tree.nodes.new("ShaderNodeBsdfDiffuse")
    node.inputs["Color"].default_value = (*color, 1.0)
    return node.outputs["BSDF"]


def truth_of(sheet, *, base=diffuse, **settings) -> bpy.types.Material:
    """Mix Shader(presence, base, Glossy of the colour image): Image Textures (Closest) of the map's coordinates."""
    image = blender_image("Map", sheet.encoded)
    material = truth_material("Truth", image, interpolation="CLOSEST", **settings)
    tree = material.node_tree
    find = {node.bl_idname: node for node in tree.nodes}
    coordinates, glossy = find["ShaderNodeUVMap"].outputs["UV"], find["ShaderNodeBsdfAnisotropic"]

    def texture(name, pixels):
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image, node.interpolation = blender_image(name, pixels), "Closest"
        tree.links.new(coordinates, node.inputs["Vector"])
        return node.outputs["Color"]

    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(texture("Presence", np.repeat(sheet.presence[..., None], 3, 2).astype(np.float32)),
                   mix.inputs["Factor"])
    if sheet.colors is not None:
        product = tree.nodes.new("ShaderNodeVectorMath")
        product.operation = "MULTIPLY"
        product.inputs[0].default_value = glossy.inputs["Color"].default_value[:3]
        tree.links.new(texture("Colour", sheet.colors), product.inputs[1])
        tree.links.new(product.outputs["Vector"], glossy.inputs["Color"])
    if base is not None:
        tree.links.new(base(tree), mix.inputs[1])
    tree.links.new(glossy.outputs["BSDF"], mix.inputs[2])
    tree.links.new(mix.outputs["Shader"], find["ShaderNodeOutputMaterial"].inputs["Surface"])
    return material


def lobe_of(scene, thing, sheet, folder: Path, *, base=diffuse, counts=True, **settings) -> bpy.types.Material:
    """The glint material of a sheet on `thing`, prepared, whose Script node reads the sheet's tables."""
    image = blender_image("Map", sheet.encoded)
    material = create_glint_material("Glint", image, interpolation="CLOSEST", **settings)
    thing.material_slots[0].material = material
    prepare_scene(scene)
    (group,) = glint_groups(material)
    script = group.nodes[SCRIPT_NODE]
    normals = flake_normals(decoded_normals(sheet.encoded), sheet.presence)
    levels = counts_levels(*normals.shape[1::-1], "CLOSEST")
    low, high = slope_bounds(normals)
    values = {
        "Table": bake_table(normals, folder, interpolation="CLOSEST")[0], "IndexTable": bake_index(normals, folder)[0],
        "FlakesTable": bake_flakes(normals, sheet.colors, folder)[0], "FlakeColors": int(sheet.colors is not None),
        "SlopeLow": (*low, 0), "SlopeHigh": (*high, 0), "CountsFirst": 0,
    }
    if counts:
        path, _, low, high = bake_counts(normals, folder, interpolation="CLOSEST", levels=(levels[0], levels[-1]))
        values |= {"CountsTable": path, "CountsFirst": levels[0], "CountsLevels": len(levels), "BinLow": (*low, 0),
                   "BinHigh": (*high, 0)}
    for name, value in values.items():
        script.inputs[name].default_value = str(value) if isinstance(value, Path) else value
    if base is not None:
        group.links.new(base(group), script.inputs["Base"])
    return material
