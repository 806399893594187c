"""Add a ready material to the active object."""

import bpy
from bpy.props import EnumProperty, StringProperty

from .add_material import assign, is_target
from .failing_softly import FailsSoftly
from .map_settings import check_uv_map

_items: list[tuple[str, str, str]] = []  # Blender keeps no reference to these strings


def preset_items(_self, _context):
    """The presets as Blender's EnumProperty takes them, read when a menu first shows them."""
    from ..materials.presets import presets

    if not _items:
        _items.extend((name, name, f"{preset.category}: {preset.description}") for name, preset in presets().items())
    return _items


class GLINT_OT_add_preset(FailsSoftly, bpy.types.Operator):
    """Make a ready material, whose map is generated, and put it into the active object's material slot"""

    bl_idname = "glint.add_preset"
    bl_label = "Add Glint Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: EnumProperty(name="Preset", description="Which ready material", items=preset_items)
    uv_map: StringProperty(
        name="UV Map", description="UV map that places the normal map; empty takes the one active for rendering"
    )

    @classmethod
    def poll(cls, context):
        return is_target(cls, context)

    def run(self, context):
        """Make the material and assign it."""
        from ..materials.create import create_glint_material
        from ..materials.presets import preset_named
        from ..prepare.real_size import write_object_sizes

        target = context.object
        check_uv_map(target, self.uv_map, context)
        material = create_glint_material(self.preset, preset=self.preset, uv_map=self.uv_map)
        assign(target, material)
        write_object_sizes(target, context.evaluated_depsgraph_get(), material)
        is_radial = preset_named(self.preset).uvs == "RADIAL"
        first = "give it UVs around its axis (Object > Radial UVs (Glint)), then " if is_radial else ""
        self.report({"INFO"}, f'Gave "{material.name}" to {target.name}: {first}press Prepare Glints before rendering')
        return {"FINISHED"}

    def draw(self, context):
        """Settings in the Adjust Last Operation panel."""
        self.layout.use_property_split = True
        self.layout.prop(self, "preset")
        if context.object and context.object.type == "MESH":
            self.layout.prop_search(self, "uv_map", context.object.data, "uv_layers")
