"""Build the material of a preset: its map is generated, unless the file holds it already."""

from __future__ import annotations

import bpy

from ..images import flake_images, is_edited, is_generated_map, new_generated_map, recipe_of
from ..nodes import car_paint
from ..nodes.builder import add_node
from ..nodes.flake_nodes import BASE
from ..nodes.glint_bsdf import BSDF, ROUGHNESS, STRENGTH, VECTOR, is_glint_group
from ..nodes.surface_kinds import KINDS, surface_of
from .build import built_material, leaving_nothing_behind
from .preset_base import add_base, is_of_colors, set_inputs
from .presets import Preset


def preset_material(name, preset: Preset, normal_map, defaults: dict, given: dict) -> bpy.types.Material:
    """A new material of a preset. normal_map: path or image instead of the preset's, or None; defaults: all settings of
    `create_glint_material` with their defaults; given: those that take the place of the preset's.

    Raises MapError, GenerateError or ShaderError, and then leaves nothing behind.
    """
    with leaving_nothing_behind():
        settings = defaults | {"scale": preset.scale, "interpolation": preset.recipe.generator.interpolation}
        settings |= preset.glint
        colors = None
        if normal_map is None:
            normal_map = _generated(preset)
            flakes = flake_images(normal_map)
            if is_of_colors(preset.base):
                colors = flakes.pop("flake_color", None)
            settings |= flakes
        material = built_material(name, normal_map, **settings | given)
        node = next(each for each in material.node_tree.nodes if is_glint_group(getattr(each, "node_tree", None)))
        if preset.paint is not None:
            _paint(material.node_tree, node, preset)
        elif preset.base:
            add_base(material.node_tree, node, preset.base, colors)
    return material


def _generated(preset: Preset) -> bpy.types.Image:
    """The normal map of a preset: one of this file that nobody edited, else a new one."""
    for image in bpy.data.images:
        is_ours = is_generated_map(image) and image.library is None and recipe_of(image) == preset.recipe
        if is_ours and not is_edited(image):
            return image
    return new_generated_map(preset.name, preset.recipe)


def _paint(tree, node, preset):
    """Put the Glint BSDF `node` into a Glint Car Paint, which takes its place."""
    glint, values = node.node_tree, {socket.name: socket.default_value for socket in node.inputs
                                     if hasattr(socket, "default_value")}
    paint = add_node(tree, "ShaderNodeGroup", car_paint.NAME, node_tree=car_paint.new_car_paint(glint))
    paint.width = 200.0
    flakes = paint.node_tree.nodes[car_paint.FLAKES_NODE]
    for name, value in values.items():
        flakes.inputs[name].default_value = value
    inner = KINDS[surface_of(glint)].color.name
    for socket, name in ((car_paint.FLAKE_COLOR, inner), (car_paint.FLAKE_ROUGHNESS, ROUGHNESS.name),
                         (car_paint.FLAKE_STRENGTH, STRENGTH.name)):
        paint.inputs[socket.name].default_value = values[name]
    set_inputs(paint, preset.paint)
    paint.location = node.location
    coordinates = node.inputs[VECTOR.name].links[0].from_socket
    tree.links.new(coordinates, paint.inputs[VECTOR.name])
    output = node.outputs[BSDF.name].links[0].to_socket
    if BASE.name in node.inputs:
        tree.nodes.remove(node.inputs[BASE.name].links[0].from_node)
    tree.nodes.remove(node)
    tree.links.new(paint.outputs[BSDF.name], output)
