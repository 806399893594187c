"""Entries in the Shader Editor's Add menu: BSDFs under Shader, lights under Input, scale under Vector, all others under
Texture; and in the 3D Viewport's Object menu."""

import bpy

from ..nodes import GROUPS


def draw_inputs(menu, context):
    """Add > Input."""
    _draw(menu, [name for name in GROUPS if name.endswith("Lights")])


def draw_shaders(menu, context):
    """Add > Shader."""
    _draw(menu, [name for name in GROUPS if name.endswith("BSDF")])


def draw_textures(menu, context):
    """Add > Texture."""
    _draw(menu, [name for name in GROUPS if not name.endswith(("Lights", "BSDF", "Scale"))])


def draw_vectors(menu, context):
    """Add > Vector."""
    _draw(menu, [name for name in GROUPS if name.endswith("Scale")])


def draw_objects(menu, context):
    """Object."""
    menu.layout.separator()
    menu.layout.operator("glint.add_radial_uvs")


def _draw(menu, names):
    if not names:
        return
    menu.layout.separator()
    for name in names:
        properties = menu.layout.operator("glint.add_node_group", text=name)
        properties.group = name
        properties.use_transform = True


def register():
    """Append the entries."""
    bpy.types.VIEW3D_MT_object.append(draw_objects)
    bpy.types.NODE_MT_category_shader_input.append(draw_inputs)
    bpy.types.NODE_MT_category_shader_shader.append(draw_shaders)
    bpy.types.NODE_MT_category_shader_texture.append(draw_textures)
    bpy.types.NODE_MT_category_shader_vector.append(draw_vectors)


def unregister():
    """Remove the entries."""
    bpy.types.NODE_MT_category_shader_vector.remove(draw_vectors)
    bpy.types.NODE_MT_category_shader_texture.remove(draw_textures)
    bpy.types.NODE_MT_category_shader_shader.remove(draw_shaders)
    bpy.types.NODE_MT_category_shader_input.remove(draw_inputs)
    bpy.types.VIEW3D_MT_object.remove(draw_objects)
