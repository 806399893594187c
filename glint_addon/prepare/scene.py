"""Make a scene ready to render glints: bake what is missing, find the light hints, switch OSL on if they need it."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

import bpy

from .. import paths
from ..errors import SceneError
from ..materials.find import glint_groups, glint_lobes
from ..nodes import glint_bsdf, image_texture
from ..nodes.glint_bsdf import image_read, lights_of, map_of, stored_text
from ..nodes.glint_lights import set_of
from ..nodes.script_node import osl_available
from ..seen.visibility import unseen_objects
from .changes import remember_preparation
from .jobs import Job, finished
from .light_sets import connect_lights
from .map_tables import bake_plan, is_missing, map_plans, named_levels, remember
from .shading_system import NO_OSL, ON_GPU, choose_shading_system, is_on
from .table_budget import DEFAULT_BUDGET, fit_budget
from .table_files import keep_tables
from .uses import glint_uses, unknown_materials

COUNTS = ("tables_baked", "tables_in_use", "bytes_baked", "bytes_in_use", "images_read")


def prepare_scene(scene, progress=None, *, bake_unseen=None, table_budget=None) -> dict:
    """Prepare every glint material of `scene` for rendering; safe to call again, then nothing is baked twice.

    progress(fraction 0..1, text) is called often while tables are baked; what it raises, `CancelledError` for one, ends
    the work and leaves scene and disk as they were. bake_unseen: whether to bake for materials that no camera sees as
    well; table_budget: memory in MiB, fractions too, that all tables together may take; both by default the scene's
    own setting. Returns what was done and skipped: "hints" (names of the lights whose glints are enumerated in
    any material), "skipped_lights" ([name, reason] of those in none), "hints_by_material" ({material: [name, ...]}),
    "left_by_material" ({material: [[name, reason], ...]}: left to chance there), "baked" and "reused" (table paths),
    "unseen" (names of the materials left without a table, because no camera sees them), "levels" ({map: [first, last]
    or None}: block sides in texels of the counts, those that the cameras' footprints reach), "mip_levels" (names of the
    images of Glint Image Textures whose levels were baked), "osl" (whether Open Shading Language is on now), "device",
    "warnings" (sentences), "notes" (sentences on what is as it should be, such as why OSL is off), "counts"
    ("tables_baked", "tables_in_use", "bytes_baked", "bytes_in_use", "images_read").
    Raises MapError, TableError, or SceneError for a scene that cannot be prepared; it is unchanged then.
    """
    progress = progress or (lambda fraction, text: None)
    return finished(preparation(scene, bake_unseen=bake_unseen, table_budget=table_budget), progress)


def preparation(scene, *, bake_unseen=None, table_budget=None):
    """`prepare_scene` in steps: a generator of `Job`s, to be sent what each returns; it returns the report.

    Closing it early, or an exception, leaves scene and disk as they were.
    """
    _check(scene)
    found = glint_uses(scene)
    groups = _by_name(found)
    report = _new_report(scene, _warnings(scene, groups) + _linked_warnings(found))
    # What is linked from another file cannot be changed here, but it looks for the lights of the scene being rendered.
    lit = {group: pairs for group, pairs in found.items() if group.library is None or _reads_scene(group)}
    looks_for_lights = any(group.library is not None and group not in lit and stored_text(group, "glint_table")
                           for group in groups)
    groups = [group for group in groups if group.library is None]
    if not lit and not image_texture.shows_mip_levels():
        return report

    # Leave out what nobody sees; a table that is there already stays in use and up to date.
    uses = {group: pairs for group, pairs in found.items() if group in groups}
    with_unseen = _setting(scene, "bake_unseen", bake_unseen, False)
    unseen = set() if with_unseen else _unseen_groups(scene, uses)
    left_out = [group for group in groups if group in unseen and not stored_text(group, "glint_table")]
    report["unseen"] = sorted({material.name for group in left_out for _, material in uses[group]})

    # Bake first: all that can fail happens before the scene is touched.
    plans, tables = [], []
    if osl_available():
        folder = paths.table_folder(bpy.data.filepath)
        with _baked_whole_or_not_at_all(folder, report["baked"]):
            plans = map_plans(scene, {group: uses[group] for group in groups if group not in left_out}, folder,
                              mirrored=with_unseen, keep_levels=len(bpy.data.scenes) > 1)
            report["warnings"] += fit_budget(plans, _setting(scene, "table_budget", table_budget, DEFAULT_BUDGET))
            for index, plan in enumerate(plans):
                values = yield from bake_plan(plan, folder, report, index / len(plans), (index + 1) / len(plans))
                tables.append(values)
            report["mip_levels"] = image_texture.bake_missing(folder)
            yield Job("Glints are ready", 1.0, 1.0, lambda progress: None)
        report["levels"] = named_levels(plans)
        _count_tables(report)

    _use_tables(plans, tables)
    if lit:
        lights = connect_lights(scene, lit)
        _bound_work(lights.pop("visits"))
        report |= lights
        looks_for_lights = looks_for_lights or _looks_for_lights(report)
    keep_tables()
    note = choose_shading_system(scene, is_needed=looks_for_lights)
    remember_preparation(scene, {image_read(plan.groups[0]): plan.stamp for plan in plans})
    return report | {"osl": is_on(scene), "notes": report["notes"] + [note] * bool(note)}


def _check(scene):
    """Raise SceneError for a scene that cannot be prepared."""
    if not hasattr(scene, "cycles"):
        raise SceneError("Cycles is switched off: switch it on in Preferences > Add-ons and try again.")
    if scene.library is not None:
        raise SceneError(f'Scene "{scene.name}" is linked from {scene.library.filepath}: prepare it in that file.')


def _use_tables(plans, tables):
    """Let the groups of each plan read its tables, whose values are `tables`."""
    for plan, values in zip(plans, tables, strict=True):
        for group in plan.groups:
            glint_bsdf.refresh(group)
            glint_bsdf.set_table(group, *values)
            remember(group, plan.stamp, *values)


def _new_report(scene, warnings) -> dict:
    """What `preparation` returns where there is nothing to do."""
    return {"hints": [], "skipped_lights": [], "hints_by_material": {}, "left_by_material": {}, "baked": [],
            "reused": [], "unseen": [], "levels": {}, "mip_levels": [], "osl": is_on(scene),
            "device": _device(scene), "warnings": warnings, "notes": [], "counts": dict.fromkeys(COUNTS, 0)}


def _looks_for_lights(report) -> bool:
    """Whether any material in view has a light to look for."""
    hinted = {name for name, lights in report["hints_by_material"].items() if lights}
    return not hinted <= set(report["unseen"])


def scene_glint_groups(scene) -> list[bpy.types.ShaderNodeTree]:
    """Glint BSDF groups with a map on objects that `scene` renders; each once, by name."""
    return _by_name(glint_uses(scene))


def _by_name(groups) -> list:
    return sorted(groups, key=lambda group: group.name_full)


def _bound_work(visits):
    """Tell each group what bounds a sample's work: visits, {material: elements of the map that it visits at most}, and
    closures, of which Cycles keeps 64 a shading point for all lobes that a material sums."""
    lobes, most = {}, {}
    for material, count in visits.items():
        for group in glint_groups(material):
            lobes[group] = max(lobes.get(group, 1), glint_lobes(material))
            most[group] = max(most.get(group, 1), count)
    for group in lobes:
        if group.library is None:
            glint_bsdf.share_closures(group, lobes[group])
            glint_bsdf.limit_visits(group, most[group])


def _setting(scene, name: str, wanted, otherwise):
    """The choice of the caller, else of the scene, which has one while the extension is registered."""
    return getattr(getattr(scene, "glint", None), name, otherwise) if wanted is None else wanted


def _unseen_groups(scene, uses) -> set:
    """The groups that only objects outside every camera's view use."""
    unseen = unseen_objects(scene, {thing for pairs in uses.values() for thing, _ in pairs})
    return {group for group, pairs in uses.items() if all(thing in unseen for thing, _ in pairs)}


@contextmanager
def _baked_whole_or_not_at_all(folder: Path, baked: list[str]):
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


def _count_tables(report):
    """Count each table file once, however many groups read it."""
    baked, used = ({Path(path) for path in names} for names in (report["baked"], report["baked"] + report["reused"]))
    report["counts"] |= {
        "tables_baked": len(baked), "tables_in_use": len(used),
        "bytes_baked": sum(path.stat().st_size for path in baked),
        "bytes_in_use": sum(path.stat().st_size for path in used),
    }


def _device(scene) -> str:
    return scene.cycles.device if hasattr(scene, "cycles") else "CPU"


def _warnings(scene, groups) -> list[str]:
    warnings = []
    if not osl_available():
        warnings.append(NO_OSL)
    if scene.render.engine != "CYCLES":
        warnings.append(f"The render engine is {scene.render.engine}: choose Cycles to render glints.")
    if _device(scene) == "GPU":
        warnings.append(ON_GPU)
    if scene.render.use_simplify and getattr(scene.cycles, "texture_limit_render", "OFF") != "OFF":
        warnings.append("Simplify limits texture sizes, which garbles the glint tables: set its limit to No Limit.")
    if scene.render.use_simplify and getattr(scene.cycles, "texture_resolution_render", 1.0) < 1.0:
        warnings.append("Simplify scales textures down, which garbles the glint tables: set their resolution to 1.")
    for group in groups:
        if group.library is None and is_missing(group):
            warnings.append(f'The normal map "{map_of(group).name}" is missing: find it with File > External Data.')
    return warnings + _hidden_warnings(scene)


def _hidden_warnings(scene) -> list[str]:
    """Sentences on objects whose materials cannot be found."""
    return [f'The materials that geometry nodes give to "{name}" are unknown while it, or its modifier, is hidden in '
            "the viewport: show it there and prepare again." for name in unknown_materials(scene)]


def _linked_warnings(uses) -> list[str]:
    """Sentences on glints of other files, which cannot be prepared here; one for each material."""
    return sorted({_linked_words(material.name, group) for group, pairs in uses.items() if group.library is not None
                   and not (stored_text(group, "glint_table") and _reads_scene(group)) for _, material in pairs})


def _linked_words(name, group) -> str:
    linked = f'The glints of "{name}" are linked from {group.library.filepath}'
    local = "make them local with Object > Relations > Make Local > All"
    if not _reads_scene(group):
        return (f"{linked}, saved with an older version of Glint, and look for the lights of that file alone: "
                f"prepare them in that file again, or {local}.")
    return (f"{linked}, where they were not prepared, and have the noise of Blender's own nodes: "
            f"prepare them in that file, or {local}.")


def _reads_scene(group) -> bool:
    """Whether a Glint BSDF group of another file reads the lights of the scene being rendered."""
    lights = lights_of(group)
    return lights is not None and set_of(lights) > 0
