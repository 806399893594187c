"""Properties > Material > Glint > Lights: what the last preparation found, as far as it is still there."""

import bpy

from ..prepare import watch
from .place import PreparedPanel
from .text import draw_sentence

MOST_NAMES = 4  # lights named in one sentence


class GLINT_PT_lights(PreparedPanel, bpy.types.Panel):
    """Which lights make glints on the material, and why others do not"""

    bl_idname = "GLINT_PT_lights"
    bl_label = "Lights"

    def draw(self, context):
        layout, state = self.layout, context.scene.glint
        shown = context.material.name if context.material else ""
        lines = [line for line in state.material_lights if line.material == shown]
        draw_hints(layout, context, lines if shows_glints(context.material) else state.hints)
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


def draw_hints(layout, context, lines):
    """The lights that make glints, of a material or of the scene."""
    hints = [line.name for line in lines if not line.detail and is_there(line.name, context.scene)]
    for name in hints:
        layout.label(text=name, icon="LIGHT")
    if not hints and watch.changes(context.scene):
        draw_sentence(layout, context, "Which lights make glints is known after Prepare Glints.", "INFO")
    elif not hints:
        draw_sentence(layout, context, "No light makes glints: add a sun or a small light.", "INFO")


def shows_glints(material) -> bool:
    """Whether the material has a Glint BSDF with a map, in groups of the user's too."""
    from ..materials.find import is_glint_material

    return material is not None and is_glint_material(material)


def is_there(name: str, scene) -> bool:
    """Whether what the report calls a light by this name is still in the scene: an object, one that another shows, or
    a part of the world."""
    inner, _, outer = name.rpartition(" in ")
    shown_by = {outer, outer.rpartition(" ")[0]}  # further copies have numbers
    is_shown = inner in bpy.data.objects and any(each in scene.objects for each in shown_by - {""})
    worlds = {scene.world, *(layer.world_override for layer in scene.view_layers)} - {None}
    of_world = any(name == world.name or name.startswith((f"{world.name} sun", f"{world.name} spot"))
                   for world in worlds)
    return name in scene.objects or is_shown or of_world


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
