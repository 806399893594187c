"""What the user sees: the panel in the Material tab and the entries in the Add menus."""

import bpy

from . import menus
from .generate_panel import GLINT_PT_generate
from .lights_panel import GLINT_PT_lights
from .panel import GLINT_PT_material, GLINT_PT_tables

classes = (
    GLINT_PT_material,
    GLINT_PT_generate,
    GLINT_PT_lights,
    GLINT_PT_tables,
)


def register():
    """Register the panels and the menu entries."""
    for cls in classes:
        bpy.utils.register_class(cls)
    menus.register()


def unregister():
    """Remove what `register` added."""
    menus.unregister()
    for cls in reversed(classes):
        bpy.utils.unregister_class(cls)
