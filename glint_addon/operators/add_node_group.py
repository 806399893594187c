"""Add one of the extension's node groups to the shader being edited."""

import bpy
from bpy.props import BoolProperty, EnumProperty

from ..errors import SceneError
from .failing_softly import FailsSoftly

_items = []  # Blender does not keep the strings of a dynamic enumeration alive, so they are kept here


def group_items(_self, _context):
    """The groups as enumeration items: identifier and name as in the menu, description from the group's function."""
    from ..nodes import GROUPS

    _items[:] = [(name, name, group_help(function)) for name, function in GROUPS.items()]
    return _items


def group_help(function) -> str:
    """First line of the function's docstring, as a tooltip: without the final period."""
    return (function.__doc__ or "").strip().partition("\n")[0].rstrip(".")


class GLINT_OT_add_node_group(FailsSoftly, bpy.types.Operator):
    """Add a Glint node group to the shader"""

    bl_idname = "glint.add_node_group"
    bl_label = "Add Glint Node Group"
    bl_options = {"REGISTER", "UNDO"}

    group: EnumProperty(name="Group", description="Which node group to add", items=group_items)
    use_transform: BoolProperty(
        name="Use Transform",
        description="Let the new node follow the pointer until it is placed",
        default=False,
        options={"HIDDEN", "SKIP_SAVE"},
    )

    @classmethod
    def description(cls, _context, properties):
        from ..nodes import GROUPS

        return group_help(GROUPS[properties.group]) if properties.group in GROUPS else cls.__doc__

    @classmethod
    def poll(cls, context):
        space = context.space_data
        if space is None or space.type != "NODE_EDITOR" or space.tree_type != "ShaderNodeTree":
            cls.poll_message_set("Open the Shader Editor to add node groups")
        elif space.edit_tree is None:
            cls.poll_message_set("The Shader Editor shows no material: select an object that has one")
        elif not space.edit_tree.is_editable:
            cls.poll_message_set("This material is linked from another file: make it local first")
        else:
            return True
        return False

    def invoke(self, context, event):
        """Add the node under the pointer and, from the menu, let it follow the pointer."""
        context.space_data.cursor_location_from_region(event.mouse_region_x, event.mouse_region_y)
        result = self.execute(context)
        if self.use_transform and "FINISHED" in result:
            bpy.ops.node.translate_attach_remove_on_cancel("INVOKE_DEFAULT")
        return result

    def run(self, context):
        """Build the group if the file lacks it and add a node that uses it."""
        from ..nodes import GROUPS

        space = context.space_data
        tree = space.edit_tree
        group = GROUPS[self.group]()
        if group == tree or group.contains_tree(tree):
            raise SceneError(f'"{group.name}" cannot be added to itself: leave the group (Tab) and add it there.')
        for node in tree.nodes:
            node.select = False
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.name = group.name
        node.width = group.default_group_node_width
        node.location = space.cursor_location
        node.select = True
        tree.nodes.active = node
        return {"FINISHED"}
