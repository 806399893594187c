"""What the extension keeps on a scene: the map picked for the next material, and what the last preparation found."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, PointerProperty, StringProperty

from ..prepare.memory import DEFAULT_BUDGET
from ..prepare.report import Report

RENDERED_IMAGES = {"RENDER_RESULT", "COMPOSITING"}  # image types that hold no file or pixels of their own


class GLINT_PG_line(bpy.types.PropertyGroup):
    """One line of the report: a light, table or warning (`name`, Blender's own), and what there is to say about it."""

    detail: StringProperty(name="Detail")


class GLINT_PG_material_light(bpy.types.PropertyGroup):
    """A light (`name`) as one material has it."""

    material: StringProperty(name="Material")
    detail: StringProperty(name="Detail", description="Why the light is left to chance; empty if it is looked for")


class GLINT_PG_scene(bpy.types.PropertyGroup):
    """Glint's part of a scene; the panel's draw functions read it and nothing else."""

    normal_map: PointerProperty(
        name="Normal Map",
        description="Tangent-space normal map for the next Glint material",
        type=bpy.types.Image,
        poll=lambda _self, image: image.type not in RENDERED_IMAGES,
    )
    bake_unseen: BoolProperty(
        name="Also Bake Unseen",
        description="Bake tables for objects outside every camera's view too: for glints that show only in mirrors. "
        "Without it these render as Blender's own nodes, right but noisy",
    )
    table_budget: IntProperty(
        name="Table Budget (MiB)",
        description="Memory that the tables of all normal maps together may take in a render. Beyond it, far "
        "views of the largest maps get noisier, then these render as Blender's own nodes",
        default=DEFAULT_BUDGET,
        min=0,
        soft_min=64,
    )
    prepared: BoolProperty(name="Prepared", description="Whether this scene has been prepared for glints")
    hints: CollectionProperty(type=GLINT_PG_line)
    skipped_lights: CollectionProperty(type=GLINT_PG_line)
    material_lights: CollectionProperty(type=GLINT_PG_material_light)
    tables: CollectionProperty(type=GLINT_PG_line)
    unseen: CollectionProperty(type=GLINT_PG_line)
    warnings: CollectionProperty(type=GLINT_PG_line)
    notes: CollectionProperty(type=GLINT_PG_line)


def store_report(scene, report: Report):
    """Keep the report of a preparation on `scene`, in place of the last one."""
    state = scene.glint
    state.prepared = True
    _fill(state.hints, [(name, "") for name in report.hints])
    _fill(state.skipped_lights, report.skipped_lights)
    state.material_lights.clear()
    for material, names in report.hints_by_material.items():
        pairs = [(name, "") for name in names] + report.left_by_material[material]
        _add(state.material_lights, pairs, material=material)
    tables = [(path, "baked") for path in report.baked] + [(path, "reused") for path in report.reused]
    _fill(state.tables, tables)
    _fill(state.unseen, [(name, "") for name in report.unseen])
    _fill(state.warnings, [(sentence, "") for sentence in report.warnings])
    _fill(state.notes, [(sentence, "") for sentence in report.notes])


def _fill(lines, pairs):
    lines.clear()
    _add(lines, pairs)


def _add(lines, pairs, **more):
    """Add a line for each (name, detail), with more properties. Each is filled before the next: Blender moves all of a
    collection when it grows, and who holds a line from before writes to memory that is no longer its own."""
    for name, detail in pairs:
        line = lines.add()
        line.name, line.detail = name, detail
        for key, value in more.items():
            setattr(line, key, value)
