"""The mip levels of images that copies of the node group "Glint Image Texture" show: baked, named, and looked for."""

from __future__ import annotations

from pathlib import Path

import bpy

from .. import paths
from ..properties import IMAGE_TEXTURE
from . import builder
from .image_texture import MIPMAP_NODE, image_of


def bake_missing(folder=None) -> list[str]:
    """Bake the pyramid of every image that a node shows with the filter Mipmap; names of the images baked now.

    Pixels are compared by content, so an image painted since is baked again. Raises as `image_choice.set_image`.
    """
    baked = []
    for group in _groups_with_mipmap():
        image = image_of(group)
        if image is not None and bake_levels(group.nodes[MIPMAP_NODE], image, folder):
            baked.append(image.name)
    return baked


def bake_levels(script, image, folder) -> bool:
    """Bake the pyramid of `image` and point the Script node to it; whether a file was written."""
    # This module is imported when Blender starts; what bakes is loaded only to bake.
    from ..bake.pyramid import bake_pyramid
    from ..images.stored import stored_image

    stored = stored_image(image)
    path, written = bake_pyramid(
        stored.pixels,
        Path(folder) if folder is not None else paths.table_folder(bpy.data.filepath),
        encoded=stored.encoded,
        associated=stored.associated,
        half=stored.half,
        name=image.name,
    )
    height, width = stored.pixels.shape[:2]
    values = {"File": paths.stored_path(path), "Width": width, "Height": height}
    values |= {"Encoded": int(stored.encoded), "Associated": int(stored.associated)}
    for name, value in values.items():
        script.inputs[name].default_value = value
    return written


def shows_mip_levels() -> bool:
    """Whether any node shows an image with the filter Mipmap, which needs OSL and baked levels."""
    return bool(_groups_with_mipmap())


def change_paths(group, change):
    """Let change(path) say what stands for the path of the pyramid that a copy of the group names; others name none."""
    script = group.nodes.get(MIPMAP_NODE) if IMAGE_TEXTURE in group else None
    builder.change_text(script.inputs.get("File") if script is not None else None, change)


def _groups_with_mipmap():
    owners = [*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights]
    trees = [owner.node_tree for owner in owners] + list(bpy.data.node_groups)
    nodes = [node for tree in trees if tree is not None for node in tree.nodes if node.type == "GROUP"]
    used = [
        node.node_tree
        for node in nodes
        if node.node_tree is not None and IMAGE_TEXTURE in node.node_tree
        and node.inputs["Filter"].default_value == "Mipmap"
    ]
    return [group for group in dict.fromkeys(used) if MIPMAP_NODE in group.nodes and group.library is None]
