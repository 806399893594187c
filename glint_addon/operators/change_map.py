"""Give the Glint BSDF nodes of the active material another normal map, or read the same one another way."""

import bpy

from ..nodes.builder import COLUMN_WIDTH
from ..nodes.glint_bsdf import VECTOR, group_binding, is_glint_group
from ..nodes.map_binding import MapBinding, map_of
from ..nodes.places import count_of, keep_count
from ..nodes.scale import group_for as scale_group_for
from ..nodes.scale import is_scale_group
from .failing_softly import FailsSoftly
from .map_settings import FLAKES, MapSettings, check_uv_map


class GLINT_OT_change_map(FailsSoftly, MapSettings, bpy.types.Operator):
    """Choose the normal map of this material's Glint BSDF, and how it is read"""

    bl_idname = "glint.change_map"
    bl_label = "Change Normal Map"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        material = active_material(context)
        if material is None:
            cls.poll_message_set("Select an object with a Glint material")
        elif not material.is_editable:
            cls.poll_message_set(f"{material.name} is linked from another file: make it local first")
        elif not glint_nodes(material):
            cls.poll_message_set(f"{material.name} has no Glint BSDF node: add one, or add a Glint material")
        else:
            return True
        return False

    def invoke(self, context, event):
        """Start from what the material has now, or the image picked in the panel, and ask."""
        binding = group_binding(glint_nodes(active_material(context))[0].node_tree)
        self.start_from(binding)
        image = context.scene.glint.normal_map or binding.image
        self.image = image.name if image is not None else ""
        if image != binding.image:
            for name in FLAKES:
                setattr(self, name, "")
        return context.window_manager.invoke_props_dialog(self, width=350)

    def run(self, context):
        """Let every Glint BSDF node of the material use the group that reads the chosen map."""
        from ..images import remove_unused_copies
        from ..materials.build import bound_group
        from ..materials.replace_group import replace_group

        material = active_material(context)
        if context.object is not None:
            check_uv_map(context.object, self.uv_map, context)
        normal_map = self.chosen_map(context)
        self.follow_generated(normal_map)
        # The frames of an image sequence stay as they were set.
        group = bound_group(normal_map, MapBinding(**self.reading(), frames=_frames(material, normal_map)))
        for node in glint_nodes(material):
            if group.users == 0:
                keep_count(group, count_of(node.node_tree))  # else it looks at as many as others set there
            left = node.node_tree
            replace_group(node, group)
            follow_uv_map(node, self.uv_map)
            if left.users == 0:
                bpy.data.node_groups.remove(left)
        remove_unused_copies()
        # The pick is spent, as after adding a material.
        context.scene.glint.normal_map = None
        self.report({"INFO"}, f'"{material.name}" reads another map: press Prepare Glints before rendering')
        return {"FINISHED"}

    def draw(self, context):
        """The dialog, and the Adjust Last Operation panel."""
        self.layout.use_property_split = True
        self.layout.prop_search(self, "image", bpy.data, "images", text="Normal Map")
        self.draw_map(context)


def _frames(material, image):
    """The frames at which the material reads `image`, if it is the sequence that it reads now."""
    groups = [node.node_tree for node in glint_nodes(material) if map_of(node.node_tree) == image]
    return group_binding(groups[0]).frames if groups else None


def active_material(context):
    """The material shown in the Properties editor, else the active object's."""
    shown = getattr(context, "material", None)
    if shown is None and context.object is not None:
        shown = context.object.active_material
    return shown


def glint_nodes(material) -> list:
    """Nodes of the material's own tree that are a Glint BSDF, with or without a map."""
    if material is None or material.node_tree is None:
        return []
    groups = (node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    return [node for node in groups if is_glint_group(node.node_tree)]


def follow_uv_map(node, uv_map: str):
    """Let the UV Map or Glint Scale node that feeds `node`, if there is one, read the UV map of the tangents.

    Where nothing is connected it is the active one; another needs a node.
    """
    vector = node.inputs[VECTOR.name]
    if uv_map and not vector.is_linked:
        tree = node.id_data
        coordinates = tree.nodes.new("ShaderNodeUVMap")
        coordinates.location = node.location.x - COLUMN_WIDTH, node.location.y
        tree.links.new(coordinates.outputs["UV"], vector)
    for link in vector.links:
        if link.from_node.bl_idname == "ShaderNodeUVMap":
            link.from_node.uv_map = uv_map
        elif is_scale_group(getattr(link.from_node, "node_tree", None)) and not link.from_node.inputs[0].is_linked:
            link.from_node.node_tree = scale_group_for(uv_map)
