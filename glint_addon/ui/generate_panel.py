"""Properties > Material > Glint > Generate: make maps, and change the settings of the one that is shown."""

import bpy

from ..generate import GENERATORS, Coloring, settings_of
from ..operators.generate_map import active_map
from ..operators.generated_settings import PART_GROUPS, kind_settings
from ..operators.live_map import is_coming
from .place import GlintPanel
from .text import draw_sentence


class GLINT_PT_generate(GlintPanel, bpy.types.Panel):
    """Make normal maps of flakes, scratches, grains and more, and edit them"""

    bl_idname = "GLINT_PT_generate"
    bl_label = "Generate"
    bl_parent_id = "GLINT_PT_material"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        layout.operator_menu_enum("glint.generate_map", "kind", text="New Map")
        image = active_map(context)
        if image is not None:
            draw_map(layout, context, image)


def draw_map(layout, context, image):
    """The settings of a generated map, and what stands in the way of showing them."""
    state = image.glint
    layout.label(text=image.name, icon="IMAGE_DATA")
    if state.problem:
        draw_sentence(layout, context, state.problem, "ERROR")
    if state.is_edited:
        operator = layout.operator("glint.regenerate_map", text="Overwrite Edits", icon="FILE_REFRESH")
        operator.image, operator.overwrite = image.name, True
    if is_coming(image):
        layout.label(text="This is a small map: the full one follows", icon="TIME")
    column = layout.column()
    column.use_property_split = True
    column.prop(state, "kind")
    column.prop(state, "resolution")
    draw_settings(column, GENERATORS[state.kind], kind_settings(state))
    draw_settings(column, Coloring, state.coloring)


def draw_settings(layout, owner, group):
    """The settings of a dataclass that have an effect, of the property group that holds them."""
    for name, described in settings_of(owner).items():
        other, values = described.only
        if other and getattr(group, other) not in values:
            continue
        if name in PART_GROUPS:
            draw_parts(layout, described, name, getattr(group, name))
        else:
            layout.prop(group, name)


def draw_parts(layout, described, name, parts):
    """A box for each part, with a button that removes it, and a button that adds one."""
    for number, part in enumerate(parts):
        box = layout.box()
        if len(parts) > 1:
            operator = box.operator("glint.change_parts", text=f"Remove {number + 1}", icon="REMOVE")
            operator.part, operator.remove = name, number
        draw_settings(box, PART_GROUPS[name][0], part)
    operator = layout.operator("glint.change_parts", text=f"Add to {described.label}", icon="ADD")
    operator.part, operator.remove = name, -1
