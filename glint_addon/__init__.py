"""Glint: glints from a user's own normal map in Cycles. This file holds registration and the public functions only."""


def register():
    """Register the extension with Blender."""


def unregister():
    """Remove everything `register` added."""
