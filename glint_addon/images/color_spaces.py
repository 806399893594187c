"""Colours from one colour space to another, by the OpenColorIO configuration that Blender uses."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import numpy as np

from ..bake.openimageio import imported
from ..errors import MapError

# Alpha modes of images: Blender divides colours by alpha before it decodes them, so that edges keep their colour.
ASSOCIATED = ("STRAIGHT", "PREMUL")


def scene_linear(colors: np.ndarray, space: str, name: str) -> np.ndarray:
    """`colors` (..., 3) of colour space `space` in Blender's working space. name: of the image, for the MapError."""
    return _converted(colors, space, bpy.data.colorspace.working_space, name)


def stored_values(pixels: np.ndarray, image: bpy.types.Image) -> np.ndarray:
    """The values in the file of a float `image` that Blender decoded to `pixels` (height, width, channels).

    Raises MapError if OpenColorIO cannot convert to the image's colour space.
    """
    alpha, mode = _alpha(pixels, image)
    stored = pixels.copy()
    stored[..., :3] = _converted(pixels[..., :3] / alpha, bpy.data.colorspace.working_space, _space(image), image.name)
    if mode == "PREMUL":
        stored[..., :3] *= alpha
    return stored


def decoded_values(stored: np.ndarray, image: bpy.types.Image) -> np.ndarray:
    """The values in the file of a float `image` as Blender decodes them: scene-linear, alpha associated.

    Raises MapError if OpenColorIO cannot convert from the image's colour space.
    """
    alpha, mode = _alpha(stored, image)
    unassociated = stored[..., :3] / (alpha if mode == "PREMUL" else np.float32(1))
    pixels = stored.copy()
    pixels[..., :3] = _converted(unassociated, _space(image), bpy.data.colorspace.working_space, image.name)
    if mode in ASSOCIATED:
        pixels[..., :3] *= stored[..., 3:]
    if image.alpha_mode == "NONE":
        pixels[..., 3:] = 1.0
    return pixels


def _alpha(pixels, image):
    """The divisor of colours where alpha is associated, never 0, and the alpha mode of an image with alpha."""
    mode = image.alpha_mode if pixels.shape[2] == 4 else "NONE"
    alpha = pixels[..., 3:] if mode in ASSOCIATED else np.float32(1)
    return np.where(alpha != 0, alpha, np.float32(1)), mode


def _space(image) -> str:
    return image.colorspace_settings.name


def _converted(colors, source, target, name):
    if source == target:
        return colors
    ocio = imported("PyOpenColorIO")
    blenders = Path(bpy.utils.system_resource("DATAFILES")) / "colormanagement" / "config.ocio"
    try:
        config = ocio.Config.CreateFromFile(os.environ.get("OCIO") or str(blenders))
        processor = config.getProcessor(source, target)
    except ocio.Exception as error:
        raise MapError(
            f'Image "{name}" cannot be converted from "{source}" to "{target}" ({error}): choose sRGB.'
        ) from error
    converted = np.array(colors, dtype=np.float32, order="C")
    processor.getDefaultCPUProcessor().applyRGB(converted)
    return converted
