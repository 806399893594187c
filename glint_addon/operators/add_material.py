"""Add a Glint material, made from a normal map, to the active object."""

import re
from pathlib import Path

import bpy
from bpy.props import FloatProperty, FloatVectorProperty, StringProperty

from ..nodes.glint_bsdf import COLOR, ROUGHNESS, STRENGTH
from .failing_softly import FailsSoftly
from .map_settings import MapSettings, check_uv_map


def setting_of(socket) -> dict:
    """Name, tooltip and range of a setting that becomes the value of a socket of the new node."""
    return {"name": socket.name, "description": socket.setting_help, "min": socket.low, "max": socket.high}


class GLINT_OT_add_material(FailsSoftly, MapSettings, bpy.types.Operator):
    """Make a glint material from a normal map and put it into the active object's material slot"""

    bl_idname = "glint.add_material"
    bl_label = "Add Glint Material"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Name", description="Name of the material; empty takes the map's name", default="")
    roughness: FloatProperty(**setting_of(ROUGHNESS), default=ROUGHNESS.default, subtype=ROUGHNESS.subtype)
    color: FloatVectorProperty(**setting_of(COLOR), default=COLOR.default[:3], subtype="COLOR")
    strength: FloatProperty(**setting_of(STRENGTH), default=STRENGTH.default)

    @classmethod
    def poll(cls, context):
        target = context.object
        if target is None:
            cls.poll_message_set("Select an object to give the material to")
        elif not hasattr(target.data, "materials"):
            cls.poll_message_set(f"{target.name} is not an object that takes materials: select a mesh")
        elif not (target.is_editable and target.data.is_editable):
            cls.poll_message_set(f"{target.name} is linked from another file: make it local first")
        else:
            return True
        return False

    def invoke(self, context, event):
        """Run if a normal map is picked or dropped, else ask for a file."""
        if self.filepath or self.image or context.scene.glint.normal_map:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context):
        """Make the material and assign it."""
        from ..materials.create import create_glint_material

        target = context.object
        check_uv_map(target, self.uv_map, context)
        normal_map = self.chosen_map(context)
        material = create_glint_material(
            self.name or f"Glint {map_title(normal_map)}",
            normal_map,
            roughness=self.roughness,
            color=tuple(self.color),
            strength=self.strength,
            **self.reading(),
        )
        assign(target, material)
        # The pick is spent: the next material starts with an empty field.
        context.scene.glint.normal_map = None
        self.report({"INFO"}, f'Gave "{material.name}" to {target.name}: press Prepare Glints before rendering')
        return {"FINISHED"}

    def draw(self, context):
        """Settings in the Adjust Last Operation panel."""
        self.layout.use_property_split = True
        for name in ("name", "roughness", "color", "strength"):
            self.layout.prop(self, name)
        self.draw_map(context)


class GLINT_FH_normal_map(bpy.types.FileHandler):
    """Lets the user drop an image file onto the Material tab of the Properties editor"""

    bl_idname = "GLINT_FH_normal_map"
    bl_label = "Glint Normal Map"
    bl_import_operator = "glint.add_material"
    bl_file_extensions = ".png;.tif;.tiff;.exr;.hdr;.jpg;.jpeg;.webp;.tga;.bmp;.jp2;.dpx"

    @classmethod
    def poll_drop(cls, context):
        space = context.space_data
        return space is not None and space.type == "PROPERTIES" and space.context == "MATERIAL"


def map_title(normal_map) -> str:
    """Name of the map without folder, file ending and Blender's number; `normal_map` is a path or an image."""
    if not isinstance(normal_map, bpy.types.Image):
        return Path(normal_map).stem
    return Path(re.sub(r"\.\d{3}$", "", normal_map.name)).stem


def assign(target, material):
    """Put `material` into the active slot of `target`, or into a first slot."""
    if target.material_slots:
        target.active_material = material
    else:
        target.data.materials.append(material)
