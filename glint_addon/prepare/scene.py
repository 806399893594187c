"""Make a scene ready to render glints: bake what is missing, find the light hints, switch OSL on if they need it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy

from .. import paths
from ..choice.ranking import Choice
from ..errors import SceneError
from ..images import ImageStates
from ..materials.find import glint_groups, glint_lobes
from ..nodes import glint_bsdf, mip_levels
from ..nodes.map_tables import MapTables
from ..nodes.script_node import osl_available
from ..seen.visibility import unseen_objects
from .changes import remember_preparation
from .jobs import Job, Steps, finished
from .light_sets import connect_lights
from .map_bake import DecodedMap, bake_plan
from .map_plans import MapPlan, map_plans, named_levels
from .memory import DEFAULT_BUDGET
from .real_size import write_sizes
from .report import Report
from .scene_warnings import device, reads_scene, scene_warnings
from .shading_system import LEFT_OFF, LEFT_ON, ONE_FILE, choose_shading_system, is_on, runs_lobe
from .table_budget import fit_budget
from .table_files import keep_tables
from .uses import Uses, glint_uses, regrouped
from .ways import choose_ways, maps_by_nodes


def prepare_scene(
    scene: bpy.types.Scene,
    progress: Callable[[float, str], None] | None = None,
    *,
    bake_unseen: bool | None = None,
    table_budget: float | None = None,
) -> dict[str, Any]:
    """Prepare every glint material of `scene` for rendering; safe to call again, then nothing is baked twice.

    progress(fraction 0..1, text) is called often while tables are baked; what it raises, `CancelledError` for one, ends
    the work and leaves scene and disk as they were. bake_unseen: whether to bake for materials that no camera sees as
    well; table_budget: memory in MiB, fractions too, that all tables together may take; both by default the scene's
    own setting. Returns what was done and skipped: "hints" (names of the lights whose glints are enumerated in
    any material), "skipped_lights" ([name, reason] of those in none), "hints_by_material" ({material: [name, ...]}),
    "left_by_material" ({material: [[name, reason], ...]}: lights without a hint), "baked" and "reused" (table paths),
    "unseen" (names of the materials left without a table, because no camera sees them), "levels" ({map: [first, last]
    or None}: block sides in texels of the counts, those that the cameras' footprints reach), "mip_levels" (names of the
    images of Glint Image Textures whose levels were baked), "osl" (whether Open Shading Language is on now), "device",
    "warnings" (sentences), "notes" (sentences on what is as it should be, such as why OSL is off), "counts"
    ("tables_baked", "tables_in_use", "bytes_baked", "bytes_in_use", "images_read").
    Raises MapError, TableError, or SceneError for a scene that cannot be prepared; it is unchanged then.
    """
    progress = progress or (lambda fraction, text: None)
    return finished(preparation(scene, bake_unseen=bake_unseen, table_budget=table_budget), progress).as_dict()


def preparation(
    scene: bpy.types.Scene, *, bake_unseen: bool | None = None, table_budget: float | None = None
) -> Steps[Report]:
    """`prepare_scene` in steps: a generator of `Job`s, to be sent what each returns; it returns the `Report`.

    Closing it early, or an exception, leaves scene and disk as they were.
    """
    _check(scene)
    found = glint_uses(scene)
    report = Report(osl=is_on(scene), device=device(scene), warnings=scene_warnings(scene, found))
    # What is linked from another file cannot be changed here, but it looks for the lights of the scene being rendered.
    lit = {group: pairs for group, pairs in found.items() if group.library is None or reads_scene(group)}
    if not lit and not mip_levels.shows_mip_levels():
        write_sizes(scene, found)
        return report

    # Bake first: all that can fail happens before the scene is touched.
    with_unseen = _setting(scene, "bake_unseen", bake_unseen, False)
    budget = _setting(scene, "table_budget", table_budget, DEFAULT_BUDGET)
    uses, report.unseen = _uses_in_view(scene, found, with_unseen)
    states = ImageStates()
    by_nodes, footprints = maps_by_nodes(scene, uses, states, mirrored=with_unseen)
    exact = {group: pairs for group, pairs in uses.items() if group not in by_nodes}
    baked: list[tuple[MapPlan, MapTables]] = []
    if osl_available():
        baked = yield from _baked(scene, exact, report, states, budget, mirrored=with_unseen)

    others_look = runs_lobe(scene) and _other_files_look(found, lit)
    exact_materials = {material.name for pairs in exact.values() for _, material in pairs}
    write_sizes(scene, found)
    _use_tables(baked)
    footprints |= {group: (plan.size, plan.footprints) for plan, _ in baked for group in plan.groups}
    choose_ways(scene, [group for group in lit if group.library is None], footprints)
    if lit:
        _bound_work(connect_lights(scene, lit, report))
    keep_tables()
    is_needed = not exact_materials.isdisjoint(report.lit_materials) or others_look
    is_of_no_use = choose_shading_system(scene, is_needed=is_needed)
    remember_preparation(scene, regrouped(found), states)
    if is_of_no_use and not report.lit_materials:
        report.notes.append(LEFT_ON if scene.cycles.shading_system else LEFT_OFF)
    if runs_lobe(scene) and by_nodes:
        report.notes.append(ONE_FILE)
    report.osl = is_on(scene)
    return report


def _uses_in_view(scene: bpy.types.Scene, found: Uses, with_unseen: bool) -> tuple[Uses, list[str]]:
    """Of the uses `found` those of the groups to prepare, by name, and the names of the materials that are left out.

    Left out is what nobody sees; a table that is there already stays in use and up to date.
    """
    by_name = sorted(found, key=lambda group: group.name_full)
    uses = {group: found[group] for group in by_name if group.library is None}
    unseen = set() if with_unseen else _unseen_groups(scene, uses)
    left_out = {group for group in unseen if not MapTables.of(group).path}
    names = {material.name for group in left_out for _, material in uses[group]}
    return {group: pairs for group, pairs in uses.items() if group not in left_out}, sorted(names)


def _baked(
    scene: bpy.types.Scene, uses: Uses, report: Report, states: ImageStates, budget: float, *, mirrored: bool
) -> Steps[list[tuple[MapPlan, MapTables]]]:
    """Bake all that is missing: a generator of jobs, which returns pairs of each plan and its tables."""
    folder = paths.table_folder(bpy.data.filepath)
    tables, decoded = [], DecodedMap()
    with _baked_whole_or_not_at_all(folder, report.baked):
        plans = map_plans(scene, uses, folder, states, mirrored=mirrored, keep_levels=len(bpy.data.scenes) > 1)
        report.warnings += fit_budget(plans, budget)
        for index, plan in enumerate(plans):
            start, end = index / len(plans), (index + 1) / len(plans)
            tables.append((yield from bake_plan(plan, folder, report, decoded, start, end)))
        report.mip_levels = mip_levels.bake_missing(folder)
        yield Job("Glints are ready", 1.0, 1.0, lambda progress: None)
    report.levels = named_levels(plans)
    report.count_tables()
    return list(zip(plans, tables, strict=True))


def _other_files_look(found: Uses, lit: Uses) -> bool:
    """Whether groups of other files look for the lights of those files, which cannot be changed here."""
    return any(group.library is not None and group not in lit and MapTables.of(group).path for group in found)


def _check(scene: bpy.types.Scene) -> None:
    """Raise SceneError for a scene that cannot be prepared."""
    if not hasattr(scene, "cycles"):
        raise SceneError("Cycles is switched off: switch it on in Preferences > Add-ons and try again.")
    if scene.library is not None:
        raise SceneError(f'Scene "{scene.name}" is linked from {scene.library.filepath}: prepare it in that file.')


def _use_tables(baked: list[tuple[MapPlan, MapTables]]) -> None:
    """Let the groups of each plan read its tables; baked: pairs of both."""
    for plan, tables in baked:
        for group in plan.groups:
            glint_bsdf.refresh(group)
            tables.from_source(plan.state).write_to(group)


def _bound_work(choices: dict[bpy.types.Material, Choice]) -> None:
    """Tell each group what bounds a sample's work: elements of the map that it visits at most, and closures, of which
    Cycles keeps 64 a shading point for all lobes that a material sums. choices: {material: its `Choice`}."""
    lobes: dict[bpy.types.ShaderNodeTree, int] = {}
    most: dict[bpy.types.ShaderNodeTree, int] = {}
    for material, choice in choices.items():
        for group in glint_groups(material):
            lobes[group] = max(lobes.get(group, 1), glint_lobes(material))
            most[group] = max(most.get(group, 1), choice.visits)
    for group in lobes:
        if group.library is None:
            glint_bsdf.share_closures(group, lobes[group])
            glint_bsdf.limit_visits(group, most[group])


def _setting[Value](scene: bpy.types.Scene, name: str, wanted: Value | None, otherwise: Value) -> Value:
    """The choice of the caller, else of the scene, which has one while the extension is registered."""
    return getattr(getattr(scene, "glint", None), name, otherwise) if wanted is None else wanted


def _unseen_groups(scene: bpy.types.Scene, uses: Uses) -> set[bpy.types.ShaderNodeTree]:
    """The groups that only objects outside every camera's view use."""
    unseen = unseen_objects(scene, {thing for pairs in uses.values() for thing, _ in pairs})
    return {group for group, pairs in uses.items() if all(thing in unseen for thing, _ in pairs)}


@contextmanager
def _baked_whole_or_not_at_all(folder: Path, baked: list[str]) -> Iterator[None]:
    """Within this block tables are written to `folder`; those in `baked` are taken back if anything ends it early."""
    is_new = not folder.exists()
    try:
        yield
    except BaseException:  # a cancelled bake and a closed generator too; all are raised again
        for path in baked:
            Path(path).unlink(missing_ok=True)
        if is_new and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        raise
