"""Give meshes UVs that run around an axis, as turned and radially brushed metal wants them."""

import bpy

from ..materials.radial_uvs import add_radial_uvs
from .failing_softly import FailsSoftly


class GLINT_OT_add_radial_uvs(FailsSoftly, bpy.types.Operator):
    """Add or fill the UV map Radial: u runs around the Z axis of each selected object, as turned metal wants it"""

    bl_idname = "glint.add_radial_uvs"
    bl_label = "Radial UVs (Glint)"
    bl_options = {"REGISTER", "UNDO"}

    repeat: bpy.props.FloatProperty(
        name="Repeat", description="Width of one repeat of the map: a whole number of them then goes around",
        default=0.02, min=0.0, subtype="DISTANCE",
    )

    @classmethod
    def poll(cls, context):
        if context.mode != "OBJECT":
            cls.poll_message_set("UV maps are added in Object Mode: leave the mode that you are in")
        elif not any(_takes_uvs(each) for each in context.selected_objects):
            cls.poll_message_set("No mesh with faces is selected that is part of this file: select one")
        else:
            return True
        return False

    def run(self, context):
        """Add the UV map to each mesh once."""
        meshes = {each.data for each in context.selected_objects if _takes_uvs(each)}
        for mesh in meshes:
            add_radial_uvs(mesh, repeat=self.repeat)
        self.report({"INFO"}, f"{len(meshes)} meshes have UVs around their Z axis")
        return {"FINISHED"}


def _takes_uvs(thing) -> bool:
    return thing.type == "MESH" and thing.data.is_editable and len(thing.data.polygons) > 0
