"""Properties > Material > Glint. Draw functions read what is stored; they never compute, open files or change data."""

from pathlib import Path

import bpy

from ..errors import GlintError
from ..images import is_several
from ..nodes.glint_bsdf import group_binding, is_by_nodes, is_way_chosen
from ..nodes.map_binding import map_of
from ..nodes.map_choices import CHOICES, IMAGE_NODE
from ..nodes.map_tables import MapTables
from ..nodes.places import count_node
from ..nodes.scale import SCALE, scale_nodes
from ..nodes.script_node import osl_available
from ..operators.change_map import glint_nodes
from ..operators.keep_glints import ADVICE, softens_glints
from ..operators.prepare import has_glint_groups
from ..prepare import watch
from ..prepare.shading_system import ENGINES, NO_OSL, ON_GPU, is_on
from .place import GlintPanel, PreparedPanel
from .text import draw_sentence

MOST_CHANGES = 5  # sentences on what changed
SEVERAL = {"TILED": "UDIM set", "SEQUENCE": "Image sequence"}
FRAMES = ("frame_duration", "frame_start", "frame_offset", "use_cyclic")  # of an image sequence


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
        layout.operator_menu_enum("glint.add_preset", "preset", text="Add Preset")
        draw_picker(layout, context, "glint.change_map" if glint_nodes(context.material) else "glint.add_material")
        draw_changes(layout, context)
        layout.operator("glint.prepare", icon="FILE_REFRESH")
        if has_glint_groups() or not hasattr(context.scene, "cycles"):
            draw_state(layout, context)


class GLINT_PT_tables(PreparedPanel, bpy.types.Panel):
    """The tables that were baked or found"""

    bl_idname = "GLINT_PT_tables"
    bl_label = "Tables"

    def draw(self, context):
        layout, state = self.layout, context.scene.glint
        tables = tables_of(context.scene)
        if not osl_available():
            draw_sentence(layout, context, "This Blender has no Open Shading Language, which alone reads tables.")
        elif not tables:
            layout.label(text="No table is in use")
        details = {Path(line.name).name: line.detail for line in state.tables}
        for table, wrong in tables.items():
            layout.label(text=f"{table.name} ({wrong or details.get(table.name, 'in use')})",
                         icon="ERROR" if wrong else "FILE_CACHE")
        for folder in dict.fromkeys(table.parent for table in tables):
            draw_sentence(layout, context, f"In {folder}")
        layout.prop(state, "bake_unseen")
        layout.prop(state, "table_budget")
        for line in state.unseen:
            if line.name in bpy.data.materials:
                words = f"{line.name}: no camera saw it when prepared, so it has no table"
                draw_sentence(layout, context, words, "DOT")


def draw_picker(layout, context, operator):
    """Pick a normal map and use it."""
    column = layout.column()
    column.label(text="Normal Map:")  # template_ID's own text would take half of the width
    column.template_ID(context.scene.glint, "normal_map", open="image.open")
    column.operator(operator, icon="MATERIAL" if operator == "glint.add_material" else "TEXTURE")


def draw_maps(layout, context):
    """Say which maps the material uses and how."""
    from ..materials.find import glint_groups

    without_map = [node.node_tree for node in glint_nodes(context.material) if map_of(node.node_tree) is None]
    for group in (*glint_groups(context.material), *dict.fromkeys(without_map)):
        image = map_of(group)
        column = layout.box().column(align=True)
        if image is None:
            column.label(text="No normal map: pick one below", icon="ERROR")
            continue
        column.label(text=image.name, icon="IMAGE_DATA")
        column.label(text=", ".join(binding_words(group)), icon="BLANK1")
        words, icon = table_words(group, context)
        if words:
            column.label(text=words, icon=icon)
        if image.source == "SEQUENCE" and IMAGE_NODE in group.nodes:
            for name in FRAMES:
                column.prop(group.nodes[IMAGE_NODE].image_user, name)
        if context.scene.glint.hints and hasattr(context.scene, "cycles") and is_by_nodes(group, context.scene):
            column.prop(count_node(group), "integer", text="Places")
    for node in scale_nodes(context.material):
        if not node.inputs[SCALE.name].is_linked:
            layout.prop(node.inputs[SCALE.name], "default_value", text=SCALE.name)


def table_words(group, context) -> tuple[str, str]:
    """What there is to say about the tables of a group, and its icon."""
    if is_several(map_of(group)):
        return f"{SEVERAL[map_of(group).source]}: glints by nodes", "INFO"
    lost, tables = watch.lost_tables(context.scene), MapTables.of(group)
    wrong = [lost[name] for name in map(bpy.path.basename, tables.paths) if name in lost]
    if not osl_available():
        return "", "NONE"
    if wrong:
        return f"A table is {wrong[0]}", "ERROR"
    if tables.path:
        return bpy.path.basename(tables.path), "FILE_CACHE"
    if context.material.name in context.scene.glint.unseen:
        return "No camera saw it when prepared: no table", "HIDE_ON"
    if is_way_chosen(group):
        return "", "NONE"
    if tables.size is not None:
        return "Over the table budget: no table", "ERROR"
    return "Not prepared yet", "ERROR"


def binding_words(group) -> list[str]:
    """How a group reads its map, in words; what one expects, as Repeat, is not said."""
    try:
        binding = group_binding(group)
    except GlintError as error:
        return [str(error)]
    chosen = [(choice, getattr(binding, name)) for name, choice in CHOICES.items()]
    return [choice.value(value).label for choice, value in chosen if value != choice.expected]


def draw_changes(layout, context):
    """What changed since the preparation, above the button that helps."""
    sentences = watch.changes(context.scene) if context.scene.glint.prepared else []
    for sentence in sentences[:MOST_CHANGES]:
        draw_sentence(layout, context, sentence, "ERROR")
    if len(sentences) > MOST_CHANGES:
        layout.label(text=f"And {len(sentences) - MOST_CHANGES} more changes", icon="BLANK1")


def draw_state(layout, context):
    """What renders the glints, the warnings of the last preparation, and whether denoising costs glints."""
    scene, state = context.scene, context.scene.glint
    if not hasattr(scene, "cycles"):
        draw_sentence(layout, context, "Cycles is switched off: switch it on in Preferences > Add-ons.", "ERROR")
        return
    if scene.render.engine not in ENGINES:
        draw_sentence(layout, context, "Glints need Cycles or EEVEE: choose one of them as render engine.", "ERROR")
        return
    if not state.prepared:
        words = "This scene is not prepared: without it glints are as noisy as usual."
        draw_sentence(layout, context, words, "INFO")
        return
    # What was said of the scene as it was prepared may be wrong since it changed.
    changes = watch.changes(scene)
    notes, warnings = ([], []) if changes else (state.notes, state.warnings)
    groups = [node.node_tree for node in glint_nodes(context.material)]
    layout.label(text=f"Glints: {way_of(scene, groups)}", icon="BLANK1" if changes else "CHECKMARK")
    for line in notes:
        draw_sentence(layout, context, line.name, "INFO")
    by_nodes = NO_OSL if not osl_available() else ON_GPU if scene.cycles.device == "GPU" else ""
    if by_nodes:
        draw_sentence(layout, context, by_nodes, "INFO")
    for line in warnings:
        if line.name not in (NO_OSL, ON_GPU):
            draw_sentence(layout, context, line.name, "ERROR")
    if softens_glints(scene):
        draw_sentence(layout, context, ADVICE, "INFO")
        layout.operator("glint.keep_glints")


def way_of(scene, groups) -> str:
    """What renders the glints of a scene that was prepared, those of a material's Glint BSDF groups, in words."""
    if not scene.glint.hints:
        return "plain"
    if scene.render.engine in ENGINES[1:]:
        return "by nodes (EEVEE)"
    if scene.cycles.device == "GPU":
        return "by nodes (GPU)"
    if not is_on(scene):
        return "by nodes (no OSL)"
    return "by nodes" if groups and all(map(is_way_chosen, groups)) else "exact (OSL)"


def tables_of(scene) -> dict[Path, str]:
    """The scene's tables and what is wrong with each: as of the last look at them, before the first as reported."""
    found = watch.tables(scene)
    return {Path(line.name): "" for line in scene.glint.tables} if found is None else found
