"""A Glint BSDF group as version 9 left it in files: custom properties said what it read."""

from __future__ import annotations

from glint_addon.nodes.builder import STAMP
from glint_addon.nodes.glint_bsdf import UV_NODE, group_binding
from glint_addon.nodes.map_binding import ORIGINAL_NODE


def make_old(group):
    """Let `group`, of the present version, be one of version 9."""
    binding = group_binding(group)
    group["glint_image"] = binding.image
    for name in ("interpolation", "convention", "distribution", "uv_map", "extension"):
        group[f"glint_{name}"] = getattr(binding, name)
    for name in (ORIGINAL_NODE, UV_NODE):
        if name in group.nodes:
            group.nodes.remove(group.nodes[name])
    group.interface.items_tree["Vector"].hide_value = False
    group[STAMP] = 9
