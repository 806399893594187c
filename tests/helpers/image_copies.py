"""Copies of images that read them as data, asked whether they follow."""

from __future__ import annotations

import bpy

from glint_addon.images import data_image
from glint_addon.properties import COPY_STATE


def follow(copy: bpy.types.Image, original: bpy.types.Image) -> bool:
    """Let `copy`, in use until now, follow its original, and tell whether it changed; no further copy stays behind."""
    images, state = set(bpy.data.images), copy.get(COPY_STATE)
    data_image(original, copy)
    bpy.data.batch_remove(set(bpy.data.images) - images)
    return copy.get(COPY_STATE) != state
