"""Glint: glints from a user's own normal map in Cycles. This file holds registration and the public functions only."""

from importlib import import_module

# Public functions and the modules they come from; loaded at first use, because they need Blender.
_PUBLIC = {
    "add_radial_uvs": "materials.radial_uvs",
    "changes_since_prepared": "prepare.changes",
    "create_glint_material": "materials.create",
    "prepare_scene": "prepare.scene",
    "presets": "materials.presets",
}

__all__ = [  # noqa: F822  (see __getattr__)
    "add_radial_uvs", "changes_since_prepared", "create_glint_material", "prepare_scene", "presets", "register",
    "unregister",
]


def __getattr__(name):
    if name in _PUBLIC:
        return getattr(import_module(f".{_PUBLIC[name]}", __package__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def register():
    """Register the extension with Blender."""
    from . import operators, ui
    from .cli import command
    from .prepare import file_events, watch

    operators.register()
    ui.register()
    file_events.register()
    watch.register()
    command.register()


def unregister():
    """Remove everything `register` added."""
    from . import operators, ui
    from .cli import command
    from .prepare import file_events, watch

    command.unregister()
    watch.unregister()
    file_events.unregister()
    ui.unregister()
    operators.unregister()
