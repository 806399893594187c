"""What the images of a map's flakes hold, for the bake, and what state map and flakes are in together."""

from __future__ import annotations

import bpy
import numpy as np

from ..errors import SceneError
from ..images import ImageStates, image_pixels
from ..nodes.flake_nodes import THRESHOLD, flake_color_of, presence_of, presence_read
from .uses import image_of_pixels

# Luminance of red, green and blue, by which Cycles makes a number of a colour (Rec. 709).
LUMINANCE = np.array([0.2126729, 0.7151522, 0.0721750], np.float32)


def map_state(group: bpy.types.ShaderNodeTree, states: ImageStates) -> str:
    """A string that changes with the values of a group's map and of the images of its flakes; "" if one is missing."""
    state, flakes = states[image_of_pixels(group)], flakes_state(group, states)
    if flakes is None or not state:
        return ""
    return f"{state}\n{flakes}" if flakes else state


def flakes_state(group: bpy.types.ShaderNodeTree, states: ImageStates) -> str | None:
    """A string that changes with the values of the images of a group's flakes: "" without any, None if one is
    missing."""
    presence, color = presence_read(group), flake_color_of(group)
    found = [states[image] for image in (presence, color) if image is not None]
    if "" in found:
        return None
    space = [color.colorspace_settings.name] if color is not None else []
    return "\n".join([*found, *space])


def are_flakes(group: bpy.types.ShaderNodeTree) -> np.ndarray | None:
    """Which texels of a group's map are flakes: bool (height, width), row 0 at the bottom, or None if all are.

    Raises MapError if the image cannot be read, SceneError if it is gone.
    """
    if presence_of(group) is None:
        return None
    image = presence_read(group)
    if image is None:
        raise SceneError(f'Node group "{group.name}" has lost its presence image: choose one in the group, and '
                         "prepare again.")
    return image_pixels(image)[..., :3] @ LUMINANCE > np.float32(THRESHOLD)


def flake_colors(group: bpy.types.ShaderNodeTree) -> np.ndarray | None:
    """Linear colour of each texel's flake, as Cycles shows the image: float32 (height, width, 3), row 0 at the bottom,
    or None if all have the surface's own. Raises MapError if the image cannot be read."""
    image = flake_color_of(group)
    if image is None:
        return None
    # This module is imported when Blender starts; what reads colours is loaded only to bake.
    from ..bake.pyramid import srgb_decoded
    from ..images.stored import stored_image

    stored = stored_image(image)
    if not stored.encoded:
        return stored.pixels[..., :3]
    alpha = stored.pixels[..., 3:] if stored.associated else np.float32(1)
    divisor = np.where(alpha != 0, alpha, np.float32(1))
    return srgb_decoded(stored.pixels[..., :3] / divisor) * alpha
