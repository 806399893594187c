"""Properties > Material > Glint. Draw functions read what is stored; they never compute, open files or change data."""

import bpy

from .. import watch
from ..errors import GlintError
from ..operators.change_map import glint_nodes
from ..operators.keep_glints import ADVICE, softens_glints
from ..operators.prepare import has_glint_groups
from ..shading_system import is_on
from .text import draw_sentence

# How the panel writes the values that a Glint BSDF group keeps.
WORDS = {
    "BECKMANN": "Beckmann",
    "GGX": "GGX",
    "LINEAR": "Linear",
    "CLOSEST": "Closest",
    "OPENGL": "OpenGL",
    "DIRECTX": "DirectX",
    "EXTEND": "Extend",
    "CLIP": "Clip",
    "MIRROR": "Mirror",
}

MOST_CHANGES = 5  # sentences on what changed
MOST_NAMES = 4  # lights named in one sentence


class GlintPanel:
    """Where the panels are: the Material tab of the Properties editor."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"


class GLINT_PT_material(GlintPanel, bpy.types.Panel):
    """Add a Glint material, prepare the scene, see what needs attention"""

    bl_idname = "GLINT_PT_material"
    bl_label = "Glint"

    @classmethod
    def poll(cls, context):
        return context.object is not None or context.material is not None

    def draw(self, context):
        layout = self.layout
        draw_maps(layout, context)
        draw_picker(layout, context, "glint.change_map" if glint_nodes(context.material) else "glint.add_material")
        draw_changes(layout, context)
        layout.operator("glint.prepare", icon="FILE_REFRESH")
        if has_glint_groups():
            draw_state(layout, context)


class PreparedPanel(GlintPanel):
    """A part of the report; shown once the scene has been prepared."""

    bl_parent_id = "GLINT_PT_material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.scene.glint.prepared


class GLINT_PT_lights(PreparedPanel, bpy.types.Panel):
    """Which lights make glints on the material, and why others do not"""

    bl_idname = "GLINT_PT_lights"
    bl_label = "Lights"

    def draw(self, context):
        layout, state = self.layout, context.scene.glint
        shown = context.material.name if context.material else ""
        lines = [line for line in state.material_lights if line.material == shown]
        hints = [line.name for line in lines or state.hints if not line.detail and is_there(line.name, context.scene)]
        if not hints:
            draw_sentence(layout, context, "No light makes glints: add a sun or a small light.", "INFO")
        for name in hints:
            layout.label(text=name, icon="LIGHT")
        left = [line for line in lines if line.detail and is_there(line.name, context.scene)]
        if left:
            layout.label(text="Left to chance on this material:")
        for reason, names in sorted(names_by_reason(left).items()):
            draw_sentence(layout, context, f"{names}: {reason}", "DOT")
        others = [line for line in state.skipped_lights if line.name not in {each.name for each in left}
                  and is_there(line.name, context.scene)]
        if others:
            layout.label(text="Left out (rendered as usual):")
        for line in others:
            draw_sentence(layout, context, f"{line.name}: {line.detail}", "DOT")


class GLINT_PT_tables(PreparedPanel, bpy.types.Panel):
    """The tables that were baked or found"""

    bl_idname = "GLINT_PT_tables"
    bl_label = "Tables"

    def draw(self, context):
        layout, state = self.layout, context.scene.glint
        if not bpy.app.build_options.cycles_osl:
            draw_sentence(layout, context, "This Blender has no Open Shading Language, which alone reads tables.")
        elif not state.tables:
            layout.label(text="No table is needed")
        lost = watch.lost_tables(context.scene)
        for line in state.tables:
            name = bpy.path.basename(line.name)
            layout.label(text=f"{name} ({'gone' if name in lost else line.detail})",
                         icon="ERROR" if name in lost else "FILE_CACHE")
        if state.tables:
            draw_sentence(layout, context, f"In {bpy.path.native_pathsep(folder_of(state.tables[0].name))}")
        layout.prop(state, "bake_unseen")
        layout.prop(state, "table_budget")
        for line in state.unseen:
            draw_sentence(layout, context, f"{line.name}: no camera sees it, so it has no table", "DOT")


def draw_picker(layout, context, operator):
    """Pick a normal map and use it."""
    column = layout.column()
    column.label(text="Normal Map:")  # template_ID's own text would take half of the width
    column.template_ID(context.scene.glint, "normal_map", open="image.open")
    column.operator(operator, icon="MATERIAL" if operator == "glint.add_material" else "TEXTURE")


def draw_maps(layout, context):
    """Say which maps the material uses and how."""
    from ..material import glint_groups
    from ..nodes.glint_bsdf import map_of

    without_map = [node.node_tree for node in glint_nodes(context.material) if map_of(node.node_tree) is None]
    for group in (*glint_groups(context.material), *dict.fromkeys(without_map)):
        image = map_of(group)
        column = layout.box().column(align=True)
        if image is None:
            column.label(text="No normal map: pick one below", icon="ERROR")
            continue
        column.label(text=image.name, icon="IMAGE_DATA")
        column.label(text=", ".join(binding_words(group)), icon="BLANK1")
        name = bpy.path.basename(group.get("glint_table", ""))
        if name in watch.lost_tables(context.scene):
            column.label(text="Its table is gone", icon="ERROR")
        elif name:
            column.label(text=name, icon="FILE_CACHE")
        elif context.material.name in context.scene.glint.unseen:
            column.label(text="No camera sees it: no table", icon="HIDE_ON")
        elif "glint_size" in group:
            column.label(text="Over the table budget: no table", icon="ERROR")
        elif bpy.app.build_options.cycles_osl:
            column.label(text="Not prepared yet", icon="ERROR")


def binding_words(group) -> list[str]:
    """How a group reads its map, in words; Repeat is what one expects, so it is not said."""
    from ..nodes.glint_bsdf import group_binding

    try:
        binding = group_binding(group)
    except GlintError as error:
        return [str(error)]
    values = (binding.distribution, binding.interpolation, binding.convention, binding.extension)
    return [WORDS[value] for value in values if value != "REPEAT"]


def draw_changes(layout, context):
    """What changed since the preparation, above the button that helps."""
    sentences = watch.changes(context.scene) if context.scene.glint.prepared else []
    for sentence in sentences[:MOST_CHANGES]:
        draw_sentence(layout, context, sentence, "ERROR")
    if len(sentences) > MOST_CHANGES:
        layout.label(text=f"And {len(sentences) - MOST_CHANGES} more changes", icon="BLANK1")


def draw_state(layout, context):
    """Engine, OSL and device in words, the warnings of the last preparation, and whether denoising costs glints."""
    scene, state = context.scene, context.scene.glint
    if not hasattr(scene, "cycles"):
        draw_sentence(layout, context, "Cycles is switched off: switch it on in Preferences > Add-ons.", "ERROR")
        return
    if scene.render.engine != "CYCLES":
        draw_sentence(layout, context, "Glints need Cycles: other engines show Blender's own nodes.", "ERROR")
        return
    if not state.prepared:
        draw_sentence(layout, context, "This scene is not prepared: without it glints are as noisy as usual.", "INFO")
        return
    is_right = is_on(scene) or len(state.notes) > 0
    layout.label(text=f"OSL {'on' if is_on(scene) else 'off'}, {scene.cycles.device}",
                 icon="CHECKMARK" if is_right else "ERROR")
    for line in state.notes:
        draw_sentence(layout, context, line.name, "INFO")
    for line in state.warnings:
        draw_sentence(layout, context, line.name, "ERROR")
    if softens_glints(scene):
        draw_sentence(layout, context, ADVICE, "INFO")
        layout.operator("glint.keep_glints")


def is_there(name: str, scene) -> bool:
    """Whether what the report calls a light by this name is still in the scene: an object, one that another shows, or
    a part of the world."""
    inner, _, outer = name.rpartition(" in ")
    is_shown = inner in bpy.data.objects and any(outer.startswith(thing.name) for thing in scene.objects)
    return name in scene.objects or is_shown or any(name.startswith(world.name) for world in bpy.data.worlds)


def names_by_reason(lines) -> dict[str, str]:
    """The lights of each reason, for a sentence: the first MOST_NAMES, then how many more."""
    found = {}
    for line in lines:
        found.setdefault(line.detail, []).append(line.name)
    return {
        reason: ", ".join(names) if len(names) <= MOST_NAMES else f"{', '.join(names[:MOST_NAMES])} and "
        f"{len(names) - MOST_NAMES} more"
        for reason, names in found.items()
    }


def folder_of(path: str) -> str:
    """The folder part of a path, as text: draw functions do not touch the disk."""
    return path[: -len(bpy.path.basename(path))]
