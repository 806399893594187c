"""Prepare the scene for rendering glints: bake missing tables, find the lights, switch OSL on if they need it."""

import bpy

from ..nodes.glint_bsdf import is_glint_group
from ..nodes.map_binding import map_of
from ..prepare.memory import mebibytes
from ..prepare.report import Report
from ..prepare.watch import look_at
from ..properties import IMAGE_TEXTURE
from .failing_softly import FailsSoftly
from .in_background import RunsInBackground
from .scene_state import store_report


class GLINT_OT_prepare(FailsSoftly, RunsInBackground, bpy.types.Operator):
    """Bake missing tables, find the lights that make glints, and switch Open Shading Language on for them"""

    bl_idname = "glint.prepare"
    bl_label = "Prepare Glints"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not context.scene.is_editable:
            cls.poll_message_set("This scene is linked from another file: prepare it there")
        elif not has_glint_groups():
            cls.poll_message_set("This file has no Glint material yet: add one first")
        else:
            return True
        return False

    def steps(self, context):
        """What there is to do, as jobs."""
        from ..prepare.scene import preparation

        return preparation(context.scene)

    def finish(self, context, report):
        """Keep the report for the panel, and say it in words."""
        store_report(context.scene, report)
        look_at(context.scene)
        for sentence in report.warnings:
            self.report({"WARNING"}, sentence)
        for sentence in report.notes:
            self.report({"INFO"}, sentence)
        self.report({"INFO"}, summary(report))
        return {"FINISHED"}


def has_glint_groups() -> bool:
    """Whether the file has a group that bakes, a map's or an image's; asked at every redraw, so it looks no further."""
    groups = bpy.data.node_groups
    return any(IMAGE_TEXTURE in group or is_glint_group(group) and map_of(group) is not None for group in groups)


def summary(report: Report) -> str:
    """What a preparation did, in one sentence."""
    lights = counted(len(report.hints), "light")
    baked = counted(len(report.baked) + len(report.mip_levels), "table")
    osl = "OSL on" if report.osl else "OSL off"
    unseen = f", {counted(len(report.unseen), 'material')} that no camera sees left out" if report.unseen else ""
    return f"Glint: {lights} found, {baked} baked, {len(report.reused)} reused{unseen}, {osl}."


def counts_line(report: Report) -> str:
    """How much a preparation baked, and how much the scene uses, in one sentence."""
    counts = report.counts
    baked = f"{counts.tables_baked} baked ({mebibytes(counts.bytes_baked)})"
    used = f"{counts.tables_in_use} in use ({mebibytes(counts.bytes_in_use)})"
    return f"Tables: {baked}, {used}, {counted(counts.images_read, 'image')} read."


def counted(number: int, noun: str) -> str:
    """ "1 light", "2 lights"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
