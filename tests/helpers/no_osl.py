"""A Blender that was built without Open Shading Language, for as long as a test runs."""

from __future__ import annotations

from types import SimpleNamespace

import bpy

from glint_addon.nodes import script_node


class BlenderWithoutOsl:
    """Blender's module as that Blender has it: the same in all but `app.build_options.cycles_osl`."""

    app = SimpleNamespace(build_options=SimpleNamespace(cycles_osl=False))

    def __getattr__(self, name):
        return getattr(bpy, name)


def take_osl_away(monkeypatch):
    """Let the extension find no Open Shading Language; it asks in one place."""
    monkeypatch.setattr(script_node, "bpy", BlenderWithoutOsl())
