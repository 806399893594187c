"""Make a material with glints, or the group that gives it one."""

from __future__ import annotations

from numbers import Real

import bpy

from ..errors import MapError
from ..images import ImageStates, data_image, image_pixels, image_stamp, normal_map_image, remove_unused_copies
from ..nodes.builder import add_node, arrange, version_of
from ..nodes.glint_bsdf import VERSION, MapBinding, follow_map, group_for, image_read, is_glint_group
from ..nodes.map_tables import MapTables


def create_glint_material(
    name,
    normal_map,
    *,
    roughness=0.1,
    distribution="BECKMANN",
    interpolation="LINEAR",
    convention="OPENGL",
    color=(1.0, 1.0, 1.0),
    strength=1.0,
    uv_map="",
    extension="REPEAT",
) -> bpy.types.Material:
    """A new material whose glints come from `normal_map`, a path or a bpy.types.Image.

    roughness 0..1 of a single facet (alpha is its square); distribution 'BECKMANN' or 'GGX'; interpolation 'LINEAR' or
    'CLOSEST'; convention 'OPENGL' (+Y) or 'DIRECTX' (-Y); color linear RGB; strength scales the slopes; uv_map "" is
    the active render UV map; extension 'REPEAT', 'EXTEND', 'CLIP' or 'MIRROR', as of an Image Texture node: all but
    the first are as noisy as Blender's own nodes where a footprint meets the map's edge, and beyond. Colour 1 and
    strength 1 reproduce Image Texture -> Normal Map -> Glossy BSDF.
    Raises MapError or ShaderError, and then leaves nothing behind. Call `prepare_scene` before rendering.
    """
    _check_values(name, roughness, strength, color, uv_map)
    before = _data_blocks()
    try:
        group = _bound_group(normal_map, interpolation, convention, distribution, uv_map, extension)
        material = bpy.data.materials.new(name)
        _add_surface(material, group, roughness, color, strength, uv_map)
    except Exception:
        bpy.data.batch_remove(_data_blocks() - before)
        raise
    return material


def bound_group(
    normal_map, *, distribution, interpolation, convention, uv_map, extension="REPEAT"
) -> bpy.types.ShaderNodeTree:
    """The Glint BSDF group that reads `normal_map`, a path or an image, in this way; see `create_glint_material`.

    Raises MapError or ShaderError, and then leaves nothing behind.
    """
    before = _data_blocks()
    try:
        return _bound_group(normal_map, interpolation, convention, distribution, uv_map, extension)
    except Exception:
        bpy.data.batch_remove(_data_blocks() - before)
        raise


def _check_values(name, roughness, strength, color, uv_map):
    """Refuse at the door what Blender would refuse half-way, in other words."""
    for value, what, high in ((roughness, "Roughness", 1.0), (strength, "Strength", 10.0)):
        if not isinstance(value, Real) or not 0.0 <= value <= high:
            raise MapError(f"{what} {value} of glint material {name} is out of range: use 0 to {high:g}.")
    try:
        channels = [float(channel) for channel in color]
    except (TypeError, ValueError):
        channels = []
    if len(channels) not in (3, 4) or not all(0.0 <= channel < float("inf") for channel in channels):
        raise MapError(f"Color {color} of glint material {name} is no color: use three numbers from 0.")
    for value, what in ((name, "Name"), (uv_map, "UV map")):
        if not isinstance(value, str):
            raise MapError(f"{what} {value} of glint material {name} is no text: give its name.")


def _data_blocks() -> set:
    """All that creating a material may add to the file."""
    kinds = (bpy.data.images, bpy.data.materials, bpy.data.node_groups, bpy.data.texts)
    return {block for kind in kinds for block in kind}


def _bound_group(normal_map, interpolation, convention, distribution, uv_map, extension):
    image = normal_map_image(normal_map)
    states = ImageStates()
    _refuse_unusable(image, convention, states)
    group = group_for(MapBinding(image, interpolation, convention, distribution, uv_map, extension))
    # A group that was there may read a copy of what the image held before.
    follow_map(group, states)
    remove_unused_copies()
    return group


def _refuse_unusable(image, convention, states):
    """Refuse a map that the bake would refuse, before anything is made; it is decoded only to be baked."""
    from ..bake.normal_map import check_convention, check_normals

    check_convention(convention)
    data = data_image(image, states=states)
    if not _was_baked(data):
        check_normals(image_pixels(data), convention=convention, name=image.name)


def _was_baked(image) -> bool:
    """Whether tables were baked of the file of `image` as it is now, for any group: that refused nothing of it."""
    stamp = image_stamp(image)
    return stamp != "" and any(
        is_glint_group(group) and version_of(group) == VERSION and image_read(group) == image
        and MapTables.of(group).source == stamp for group in bpy.data.node_groups)


def _add_surface(material, group, roughness, color, strength, uv_map):
    tree = material.node_tree
    tree.nodes.clear()
    coordinates = add_node(tree, "ShaderNodeUVMap", uv_map=uv_map)
    surface = add_node(
        tree, "ShaderNodeGroup", "Glint BSDF", node_tree=group,
        inputs={"Roughness": roughness, "Color": (*color[:3], 1.0), "Strength": strength},
    )
    surface.width = 200.0
    output = add_node(tree, "ShaderNodeOutputMaterial")
    tree.links.new(coordinates.outputs["UV"], surface.inputs["Vector"])
    tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])
    arrange(tree)
