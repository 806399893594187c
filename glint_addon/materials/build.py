"""Build a material with glints, or the group that gives it one."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from numbers import Real

import bpy

from ..errors import MapError
from ..images import (
    ImageStates,
    data_image,
    flake_color_image,
    image_pixels,
    image_shape,
    image_stamp,
    is_several,
    normal_map_image,
    presence_image,
    remove_unused_copies,
    sequence_frames,
)
from ..nodes import scale as scale_group
from ..nodes.builder import add_node, arrange, version_of
from ..nodes.flake_nodes import BASE
from ..nodes.glint_bsdf import (
    BSDF,
    NAME,
    ROUGHNESS,
    STRENGTH,
    VECTOR,
    VERSION,
    follow_map,
    group_for,
    is_glint_group,
)
from ..nodes.map_binding import READING, MapBinding, image_read
from ..nodes.map_tables import MapTables
from ..nodes.surface_kinds import BASE_COLOR
from .surface_values import checked, surface_values

GREY = (0.8, 0.8, 0.8, 1.0)  # of a new Principled BSDF


def built_material(name, normal_map, **settings) -> bpy.types.Material:
    """A new material of all the settings that `create_glint_material` takes, but for its preset.

    Raises MapError or ShaderError, and then leaves nothing behind.
    """
    uv_map, scale = settings["uv_map"], settings["scale"]
    _check_values(name, settings["roughness"], settings["strength"], uv_map)
    _check_scale(name, scale)
    of_surface = {each: settings[each] for each in ("metal", "color", "edge_tint", "ior", "extinction")}
    values = surface_values(name, settings["surface"], **of_surface)
    values |= {ROUGHNESS.name: settings["roughness"], STRENGTH.name: settings["strength"]}
    base = checked(name, BASE_COLOR, "Base Color", settings["base_color"])
    reading = MapBinding(**{each: settings[each] for each in READING})
    with leaving_nothing_behind():
        presence, color = settings["presence"], settings["flake_color"]
        reading = replace(reading, presence=presence and presence_image(presence),
                          flake_color=color and flake_color_image(color))
        group = _bound_group(normal_map, reading)
        material = bpy.data.materials.new(name)
        surface_node = _add_surface(material, group, values, uv_map)
        if scale is not None:
            _add_scale(material, uv_map, scale)
        if BASE.name in surface_node.inputs:
            link_base(material.node_tree, surface_node.inputs[BASE.name], base)
    return material


@contextmanager
def leaving_nothing_behind():
    """Within this block materials, groups and images may be made; if it fails, they are removed again."""
    before = _data_blocks()
    try:
        yield
    except Exception:
        bpy.data.batch_remove(_data_blocks() - before)
        raise


def bound_group(normal_map, reading: MapBinding) -> bpy.types.ShaderNodeTree:
    """The Glint BSDF group that reads `normal_map`, a path or an image, as `reading` says, whose own image is ignored.

    An image sequence without frames shows all its files from frame 1 on.

    Raises MapError or ShaderError, and then leaves nothing behind.
    """
    with leaving_nothing_behind():
        return _bound_group(normal_map, reading)


def _check_values(name, roughness, strength, uv_map):
    """Refuse at the door what Blender would refuse half-way, in other words."""
    for value, socket in ((roughness, ROUGHNESS), (strength, STRENGTH)):
        if not isinstance(value, Real) or not socket.low <= value <= socket.high:
            allowed = f"{socket.low:g} to {socket.high:g}"
            raise MapError(f"{socket.name} {value} of glint material {name} is out of range: use {allowed}.")
    for value, what in ((name, "Name"), (uv_map, "UV map")):
        if not isinstance(value, str):
            raise MapError(f"{what} {value} of glint material {name} is no text: give its name.")


def _check_scale(name, scale):
    """Refuse a width of a repeat that is none."""
    if scale is not None and not (isinstance(scale, Real) and 0.0 < scale < float("inf")):
        raise MapError(f"Scale {scale} of glint material {name} is no width: use metres above 0, or None.")


def _data_blocks() -> set:
    """All that creating a material may add to the file."""
    kinds = (bpy.data.images, bpy.data.materials, bpy.data.node_groups, bpy.data.texts)
    return {block for kind in kinds for block in kind}


def _bound_group(normal_map, reading):
    image = normal_map_image(normal_map)
    frames = sequence_frames(image)
    binding = replace(reading, image=image, frames=frames and (reading.frames or frames))
    states = ImageStates()
    _refuse_unusable(binding, states)
    group = group_for(binding)
    # A group that was there may read a copy of what the image held before.
    follow_map(group, states)
    remove_unused_copies()
    return group


def _refuse_unusable(binding, states):
    """Refuse a map that the bake would refuse, before anything is made; it is decoded only to be baked."""
    from ..bake.normal_map import check_normals

    shape = image_shape(binding.image)[:2]
    for image in (binding.presence, binding.flake_color):
        if image is not None and image_shape(image)[:2] != shape:
            sizes = [f"{width} x {height}" for height, width in (image_shape(image)[:2], shape)]
            raise MapError(f'Image "{image.name}" of flakes has {sizes[0]} pixels, and their normal map {sizes[1]}: '
                           "scale one of them to the size of the other.")
    data = data_image(binding.image, states=states)
    if not is_several(data) and not _was_baked(data):
        check_normals(image_pixels(data), convention=binding.convention, name=binding.image.name)


def _was_baked(image) -> bool:
    """Whether tables were baked of the file of `image` as it is now, for any group: that refused nothing of it."""
    stamp = image_stamp(image)
    return stamp != "" and any(
        is_glint_group(group) and version_of(group) == VERSION and image_read(group) == image
        and MapTables.of(group).source == stamp for group in bpy.data.node_groups)


def _add_surface(material, group, values, uv_map):
    """Nodes of a material whose surface is the group with `values` (socket name -> value), placed by `uv_map`; returns
    the group's node."""
    tree = material.node_tree
    tree.nodes.clear()
    coordinates = add_node(tree, "ShaderNodeUVMap", uv_map=uv_map)
    surface = add_node(tree, "ShaderNodeGroup", NAME, node_tree=group, inputs=values)
    surface.width = 200.0
    output = add_node(tree, "ShaderNodeOutputMaterial")
    tree.links.new(coordinates.outputs["UV"], surface.inputs[VECTOR.name])
    tree.links.new(surface.outputs[BSDF.name], output.inputs["Surface"])
    arrange(tree)
    return surface


def _add_scale(material, uv_map, scale):
    """Let one repeat of the map be `scale` metres wide: a Glint Scale, which has a UV Map node, replaces the other."""
    tree = material.node_tree
    coordinates = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeUVMap")
    inputs = [link.to_socket for link in coordinates.outputs["UV"].links]
    group = scale_group.group_for(uv_map)
    sized = add_node(tree, "ShaderNodeGroup", scale_group.NAME, node_tree=group, inputs={scale_group.SCALE.name: scale})
    for socket in inputs:
        tree.links.new(sized.outputs[scale_group.COORDINATES.name], socket)
    tree.nodes.remove(coordinates)
    arrange(tree)


def link_base(tree, socket, color=GREY):
    """Link to `socket` what lies between flakes: a Principled BSDF, as new materials have."""
    base = add_node(tree, "ShaderNodeBsdfPrincipled", inputs={"Base Color": color}, width=200.0)
    tree.links.new(base.outputs["BSDF"], socket)
    arrange(tree)
