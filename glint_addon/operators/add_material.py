"""Add a Glint material, made from a normal map, to the active object."""

import re
from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, StringProperty

from ..images import recipe_of
from ..nodes.glint_bsdf import ROUGHNESS, STRENGTH
from ..nodes.scale import SCALE
from ..nodes.surface_kinds import COLOR, EDGE_TINT, EXTINCTION, IOR, IORS, METALS
from .failing_softly import FailsSoftly
from .map_settings import MapSettings, check_uv_map

CUSTOM = "CUSTOM"
METAL_ITEMS = (*((name, name, f"Refractive index of {name.lower()}") for name in METALS),
               (CUSTOM, "Custom", "Numbers of your own"))
# The settings that describe each kind of surface, and the argument of `create_glint_material` that each becomes.
OF_SURFACE = {
    "TINT": {"color": "color"},
    "METAL": {"color": "color", "edge_tint": "edge_tint"},
    "CONDUCTOR": {"ior_rgb": "ior", "extinction": "extinction"},
    "DIELECTRIC": {"ior": "ior", "color": "color"},
}
OF_METAL = ("METAL", "CONDUCTOR")


def setting_of(socket) -> dict:
    """Name, tooltip, default and range of a setting that becomes the value of a socket of the new node."""
    default = socket.default[:3] if isinstance(socket.default, tuple) else socket.default
    return {"name": socket.name, "description": socket.setting_help or socket.help, "default": default,
            "min": socket.low, "max": socket.high}


class GLINT_OT_add_material(FailsSoftly, MapSettings, bpy.types.Operator):
    """Make a glint material from a normal map and put it into the active object's material slot"""

    bl_idname = "glint.add_material"
    bl_label = "Add Glint Material"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Name", description="Name of the material; empty takes the map's name", default="")
    roughness: FloatProperty(**setting_of(ROUGHNESS), subtype=ROUGHNESS.subtype)
    strength: FloatProperty(**setting_of(STRENGTH))
    metal: EnumProperty(name="Metal", description="Metal whose numbers are taken", items=METAL_ITEMS,
                        default="Titanium")
    color: FloatVectorProperty(**setting_of(COLOR), subtype="COLOR")
    edge_tint: FloatVectorProperty(**setting_of(EDGE_TINT), subtype="COLOR")
    ior: FloatProperty(**setting_of(IOR))
    ior_rgb: FloatVectorProperty(**setting_of(IORS))
    extinction: FloatVectorProperty(**setting_of(EXTINCTION))

    scale: FloatProperty(name=SCALE.name, description=SCALE.setting_help, min=SCALE.low, default=0.0,
                         subtype=SCALE.subtype)

    @classmethod
    def poll(cls, context):
        return is_target(cls, context)

    def invoke(self, context, event):
        """Run if a normal map is picked or dropped, else ask for a file."""
        if self.filepath or self.image or context.scene.glint.normal_map:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context):
        """Make the material and assign it."""
        from ..materials.create import create_glint_material
        from ..prepare.real_size import write_object_sizes

        target = context.object
        check_uv_map(target, self.uv_map, context)
        normal_map = self.chosen_map(context)
        self.follow_generated(normal_map)
        material = create_glint_material(
            self.name or f"Glint {map_title(normal_map)}",
            normal_map,
            roughness=self.roughness,
            strength=self.strength,
            scale=self.scale or self._generated_extent(normal_map),
            **self.reading(),
            **self._of_surface(),
        )
        assign(target, material)
        write_object_sizes(target, context.evaluated_depsgraph_get(), material)
        # The pick is spent: the next material starts with an empty field.
        context.scene.glint.normal_map = None
        self.report({"INFO"}, f'Gave "{material.name}" to {target.name}: press Prepare Glints before rendering')
        return {"FINISHED"}

    def _generated_extent(self, normal_map):
        """Metres that one repeat of a generated map measures, unless the user chose a scale; None of other maps."""
        recipe = recipe_of(normal_map) if isinstance(normal_map, bpy.types.Image) else None
        return recipe.generator.extent if recipe and not self.properties.is_property_set("scale") else None

    def _of_surface(self) -> dict:
        """The arguments of `create_glint_material` that describe the surface."""
        if self.surface in OF_METAL and self.metal != CUSTOM:
            return {"metal": self.metal}
        values = {argument: getattr(self, name) for name, argument in OF_SURFACE[self.surface].items()}
        return {argument: value if isinstance(value, float) else tuple(value) for argument, value in values.items()}

    def draw(self, context):
        """Settings in the Adjust Last Operation panel."""
        layout = self.layout
        layout.use_property_split = True
        for name in ("name", "roughness", "strength", "scale"):
            layout.prop(self, name)
        self.draw_map(context)
        if self.surface in OF_METAL:
            layout.prop(self, "metal")
        if self.surface not in OF_METAL or self.metal == CUSTOM:
            for name in OF_SURFACE[self.surface]:
                layout.prop(self, name)


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


def is_target(operator, context) -> bool:
    """Whether the active object can be given a material; the operator's poll message says why not."""
    target = context.object
    if target is None:
        operator.poll_message_set("Select an object to give the material to")
    elif not hasattr(target.data, "materials"):
        operator.poll_message_set(f"{target.name} is not an object that takes materials: select a mesh")
    elif not (target.is_editable and target.data.is_editable):
        operator.poll_message_set(f"{target.name} is linked from another file: make it local first")
    else:
        return True
    return False


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
