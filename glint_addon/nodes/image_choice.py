"""Which image a copy of the node group "Glint Image Texture" shows: each image has a copy of its own."""

from __future__ import annotations

import bpy

from ..errors import SceneError
from ..images import image_shape
from ..properties import IMAGE_TEXTURE
from . import builder
from .image_texture import (
    BILINEAR_NODE,
    FILTERS,
    MAPPINGS,
    MIPMAP_NODE,
    NAME,
    NEAREST_NODE,
    ROW_NODE,
    UP_AXES,
    UV_NODE,
    image_of,
    new_tree,
)
from .mip_levels import bake_levels


def build_for_image(
    image, *, mapping="UV", filter="MIPMAP", up="Z", uv_map="", folder=None
) -> bpy.types.ShaderNodeTree:
    """The group that shows `image`: the file's own one if there is, else a new one, with these values for new nodes.

    mapping: 'UV' | 'SPHERICAL' | 'VECTOR'; filter: 'NEAREST' | 'BILINEAR' | 'MIPMAP'; up: 'Y' | 'Z'; uv_map: "" is the
    object's active one; folder: for the mip pyramid, which is baked if the filter is 'MIPMAP'
    (default `paths.table_folder` of the open file).
    Raises SceneError for an unknown choice, and whatever `set_image` raises.
    """
    _check_choices(mapping, filter, up)
    copies = [group for group in bpy.data.node_groups if group.library is None and IMAGE_TEXTURE in group]
    matching = [group for group in copies if image_of(group) == image and group.nodes[UV_NODE].uv_map == uv_map]
    unused = [group for group in copies if image_of(group) is None and group.users == 0]
    group = (matching or unused or [None])[0]
    is_new = group is None
    if is_new:
        builder.local_group(NAME)  # raises if the name is taken by someone else's group
        group = new_tree()
    try:
        set_image(group, image, bake=filter == "MIPMAP", folder=folder)
    except Exception:
        if is_new:
            bpy.data.node_groups.remove(group)
        raise
    group.nodes[UV_NODE].uv_map = uv_map
    for socket, value in (("Mapping", MAPPINGS[mapping]), ("Filter", FILTERS[filter]), ("Up Axis", UP_AXES[up])):
        group.interface.items_tree[socket].default_value = value
    return group


def add_node(tree, image, **options) -> bpy.types.ShaderNodeGroup:
    """Add a node of `build_for_image(image, **options)` to the node tree `tree`, with those options as its values."""
    group = build_for_image(image, **options)
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    for socket in ("Mapping", "Filter", "Up Axis"):
        node.inputs[socket].default_value = group.interface.items_tree[socket].default_value
    return node


def set_image(group, image, *, bake=True, folder=None):
    """Make a copy of the group (or the group of a node) show `image`; `bake` its mip pyramid into `folder` if missing.

    Raises SceneError if it is not such a group or there is no image, MapError if the image has no pixels or cannot
    have a pyramid, TableError if the pyramid cannot be written.
    """
    group = getattr(group, "node_tree", group)
    if group is None or IMAGE_TEXTURE not in group:
        raise SceneError(f'"{getattr(group, "name", None)}" is not a {NAME} group: add one from the Glint menu.')
    if image is None:
        raise SceneError(f'"{group.name}" needs an image: choose one.')
    script = group.nodes.get(MIPMAP_NODE)
    if bake and script is not None:
        bake_levels(script, image, folder)
    elif script is not None and image != image_of(group):
        script.inputs["File"].default_value = ""
    group.nodes[NEAREST_NODE].image = group.nodes[BILINEAR_NODE].image = image
    group.nodes[ROW_NODE].outputs[0].default_value = 0.5 / max(image_shape(image)[0], 1)


def _check_choices(mapping, filter, up):
    choices = (("mapping", mapping, MAPPINGS), ("filter", filter, FILTERS), ("up axis", up, UP_AXES))
    for what, value, allowed in choices:
        if value not in allowed:
            raise SceneError(f'Image texture {what} "{value}" is unknown: use one of {", ".join(allowed)}.')
