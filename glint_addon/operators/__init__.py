"""What the user can do: each operator checks, calls one function of the extension and reports."""

import bpy

from . import generated_settings, live_map
from .add_material import GLINT_FH_normal_map, GLINT_OT_add_material
from .add_node_group import GLINT_OT_add_node_group
from .add_preset import GLINT_OT_add_preset
from .change_map import GLINT_OT_change_map
from .generate_map import GLINT_OT_change_parts, GLINT_OT_generate_map, GLINT_OT_regenerate_map
from .keep_glints import GLINT_OT_keep_glints
from .prepare import GLINT_OT_prepare
from .radial_uvs import GLINT_OT_add_radial_uvs
from .scene_state import GLINT_PG_line, GLINT_PG_material_light, GLINT_PG_scene

classes = (
    *generated_settings.classes,
    GLINT_PG_line,
    GLINT_PG_material_light,
    GLINT_PG_scene,
    GLINT_OT_add_material,
    GLINT_OT_add_preset,
    GLINT_OT_change_map,
    GLINT_OT_generate_map,
    GLINT_OT_regenerate_map,
    GLINT_OT_change_parts,
    GLINT_OT_prepare,
    GLINT_OT_keep_glints,
    GLINT_OT_add_radial_uvs,
    GLINT_OT_add_node_group,
    GLINT_FH_normal_map,
)


def register():
    """Register the operators, the `glint` property of scenes and images, and what follows generated maps."""
    for cls in classes:
        bpy.utils.register_class(cls)
    bpy.types.Scene.glint = bpy.props.PointerProperty(type=GLINT_PG_scene)
    bpy.types.Image.glint = bpy.props.PointerProperty(type=generated_settings.GLINT_PG_generated)
    live_map.register()


def unregister():
    """Remove what `register` added."""
    live_map.unregister()
    del bpy.types.Image.glint
    del bpy.types.Scene.glint
    for cls in reversed(classes):
        bpy.utils.unregister_class(cls)
