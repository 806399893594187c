"""Add a Glint material, made from a normal map, to the active object."""

import re
from pathlib import Path

import bpy
from bpy.props import FloatProperty, FloatVectorProperty, StringProperty

from .failing_softly import FailsSoftly
from .map_settings import MapSettings, check_uv_map


class GLINT_OT_add_material(FailsSoftly, MapSettings, bpy.types.Operator):
    """Make a glint material from a normal map and put it into the active object's material slot"""

    bl_idname = "glint.add_material"
    bl_label = "Add Glint Material"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Name", description="Name of the material; empty takes the map's name", default="")
    roughness: FloatProperty(
        name="Roughness",
        description="Roughness of each facet between the map's texels, as in Glossy BSDF; alpha is its square",
        default=0.1,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    color: FloatVectorProperty(
        name="Color",
        description="Colour of the reflection",
        default=(1.0, 1.0, 1.0),
        min=0.0,
        max=1.0,
        subtype="COLOR",
    )
    strength: FloatProperty(
        name="Strength",
        description="How much of the map's tilt is used, as in the Normal Map node",
        default=1.0,
        min=0.0,
        max=10.0,
    )

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
            distribution=self.distribution,
            interpolation=self.interpolation,
            convention=self.convention,
            extension=self.extension,
            color=tuple(self.color),
            strength=self.strength,
            uv_map=self.uv_map,
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
