"""Blender's entry point of the extension: a shim, so that pytest and `import glint_addon` never load the code twice."""


def register():
    """Register every class, menu entry and handler of the extension."""
    from . import glint_addon

    glint_addon.register()


def unregister():
    """Undo `register`; nothing of the extension is left behind."""
    from . import glint_addon

    glint_addon.unregister()
