"""What a panel shows, without a window: a layout that takes Blender's calls and keeps the words."""

from __future__ import annotations

from types import SimpleNamespace

import bpy

# Without a window Blender's own interface scale is 0.
SCREEN = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))


class Layout:
    """Stands in for Blender's layout: takes the same calls and keeps what would be seen."""

    def __init__(self, seen=None):
        self.seen = [] if seen is None else seen

    def column(self, **_settings):
        return Layout(self.seen)

    row = box = column

    def separator(self, **_settings):
        pass

    def label(self, *, text="", icon="NONE"):
        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items, icon
        self.seen.append(text)

    def prop(self, owner, name, *, text=""):
        self.seen.append(f"[{text or owner.bl_rna.properties[name].name}]")

    def operator(self, name, *, text="", icon="NONE"):
        self.seen.append(f"[{text or name}]")
        return SimpleNamespace()

    def operator_menu_enum(self, name, property, *, text=""):
        self.seen.append(f"[{text or name}: {property}]")

    def template_ID(self, data, name, **_settings):  # noqa: N802  (Blender's name)
        assert hasattr(data, name)
        self.seen.append(f"<{name}>")


def panel_context(width=400):
    """The context in which Blender draws a panel in a region `width` pixels wide."""
    thing = bpy.context.object
    return SimpleNamespace(
        scene=bpy.context.scene,
        object=thing,
        material=thing.active_material if thing else None,
        region=SimpleNamespace(width=width),
        preferences=SCREEN,
    )


def words_of(panel, *, width=400) -> list[str]:
    """What `panel` shows in a region `width` pixels wide."""
    layout = Layout()
    panel.draw(SimpleNamespace(layout=layout), panel_context(width))
    return layout.seen
