"""Make a scene ready to render glints: bake what is missing, find the light hints, switch OSL on."""

from __future__ import annotations

from pathlib import Path

import bpy

from . import paths
from .bake.normal_map import decoded_normals, slope_bounds
from .bake.table import bake_table
from .images import image_pixels, image_stamp
from .lights.animation import is_animated
from .lights.drivers import connect_hints
from .lights.hints import rendered_objects, scene_hints
from .material import glint_groups
from .nodes import glint_bsdf, glint_lights, image_texture
from .nodes.script_node import osl_available
from .visibility import unseen_objects

COUNTS = ("tables_baked", "tables_in_use", "bytes_baked", "bytes_in_use", "images_read")


def prepare_scene(scene, progress=None, *, bake_unseen=None) -> dict:
    """Prepare every glint material of `scene` for rendering; safe to call again, then nothing is baked twice.

    progress(fraction 0..1, text) is called while tables are baked. bake_unseen: whether to bake for materials that no
    camera sees as well, by default the scene's own setting. Returns what was done and skipped: "hints" (names of the
    lights whose glints are enumerated), "skipped_lights" ([name, reason]), "baked" and "reused" (table paths), "unseen"
    (names of the materials left without a table, because no camera sees them), "mip_levels" (names of the images of
    Glint Image Textures whose levels were baked), "osl" (whether Cycles can run the lobe), "device", "warnings"
    (sentences), "counts" ("tables_baked", "tables_in_use", "bytes_baked", "bytes_in_use", "images_read").
    Raises MapError or TableError; the scene is unchanged then.
    """
    progress = progress or (lambda fraction, text: None)
    groups = scene_glint_groups(scene)
    report = {"hints": [], "skipped_lights": [], "baked": [], "reused": [], "unseen": [], "mip_levels": [],
              "osl": osl_available(), "device": _device(scene), "warnings": _warnings(scene, groups),
              "counts": dict.fromkeys(COUNTS, 0)}
    # What is linked from another file cannot be changed here; a warning says so.
    groups = [group for group in groups if group.library is None]
    if not groups and not image_texture.shows_mip_levels():
        return report

    # Leave out what nobody sees; a table that is there already stays in use and up to date.
    unseen = {} if _bakes_unseen(scene, bake_unseen) else _unseen_groups(scene)
    left_out = [group for group in groups if group in unseen and not group["glint_table"]]
    report["unseen"] = sorted({name for group in left_out for name in unseen[group]})
    prepared = [group for group in groups if group not in left_out]

    # Bake first: all that can fail happens before the scene is touched.
    tables = []
    if report["osl"]:
        folder = paths.table_folder(bpy.data.filepath)
        report["mip_levels"] = image_texture.bake_missing(folder)
        for index, group in enumerate(prepared):
            progress(index / len(prepared), f'Baking "{group["glint_image"].name}"')
            tables.append(_table(group, folder, report))
        _count_tables(report)

    for group, (stamp, table) in zip(prepared, tables, strict=False):
        glint_bsdf.refresh(group)
        glint_bsdf.set_table(group, *table)
        _remember(group, stamp, *table)
    if groups:
        hints, skipped = scene_hints(scene)
        connect_hints(glint_lights.build(), scene, hints)
        report["hints"] = [hint.object.name for hint in hints]
        report["skipped_lights"] = [list(pair) for pair in skipped]
    if report["osl"] and hasattr(scene, "cycles") and not scene.cycles.shading_system:
        scene.cycles.shading_system = True
    progress(1.0, "Glints are ready")
    return report


def scene_glint_groups(scene) -> list[bpy.types.ShaderNodeTree]:
    """Glint BSDF groups with a map on objects that `scene` renders; each once, by name."""
    groups = {group.name_full: group for group in _uses(scene)}
    return [groups[name] for name in sorted(groups)]


def _uses(scene) -> dict:
    """Objects and material names {group: [(object, name), ...]} of each Glint BSDF group that `scene` renders."""
    uses = {}
    layers = [layer for layer in scene.view_layers if layer.use]
    for layer in layers:
        layer.update()  # for matrices, and for the collections of a scene that was never shown
    # A view layer's material override stands in for every object's own material.
    overrides = [layer.material_override for layer in layers if layer.material_override is not None]
    for obj in _rendered_objects(rendered_objects(layers), set()):
        for material in [slot.material for slot in obj.material_slots] + overrides:
            for group in glint_groups(material):
                uses.setdefault(group, []).append((obj, material.name))
    return uses


def _rendered_objects(objects, seen: set):
    """Those of `objects` that are rendered, and those that collection instances among them show."""
    for obj in objects:
        if obj.hide_render and not is_animated(obj, "hide_render"):
            continue
        yield obj
        shown = obj.instance_collection if obj.instance_type == "COLLECTION" else None
        if shown is not None and shown not in seen:
            seen.add(shown)
            yield from _rendered_objects(shown.all_objects, seen)


def _bakes_unseen(scene, wanted) -> bool:
    """The choice of the caller, else of the scene, which has one while the extension is registered."""
    return getattr(getattr(scene, "glint", None), "bake_unseen", False) if wanted is None else wanted


def _unseen_groups(scene) -> dict:
    """Material names {group: [name, ...]} of the groups that only objects outside every camera's view use."""
    uses = _uses(scene)
    unseen = unseen_objects(scene, {thing for pairs in uses.values() for thing, _ in pairs})
    return {
        group: [name for _, name in pairs]
        for group, pairs in uses.items()
        if all(thing in unseen for thing, _ in pairs)
    }


def _table(group, folder: Path, report: dict):
    """Bake or find the table of a group; returns the image's stamp and the arguments of `glint_bsdf.set_table`."""
    image = group["glint_image"]
    stamp = image_stamp(image)
    path = Path(group["glint_table"]) if group["glint_table"] else None
    same_file = stamp != "" and stamp == group.get("glint_source", "")
    # Same file as last time: do not even read its pixels. Missing file: a warning says so, its table is still here.
    if path is not None and path.is_file() and (same_file and path.parent == folder or _is_missing(image)):
        report["reused"].append(str(path))
        known = (str(path), group["glint_size"], group["glint_slope_low"], group["glint_slope_high"])
        return group["glint_source"], known
    if stamp and not same_file:
        image.reload()  # Blender may still hold the pixels of an older file
    binding = glint_bsdf.group_binding(group)
    report["counts"]["images_read"] += 1
    normals = decoded_normals(image_pixels(image), convention=binding.convention, name=image.name)
    path, written = bake_table(normals, folder, interpolation=binding.interpolation)
    report["baked" if written else "reused"].append(str(path))
    size = [normals.shape[1], normals.shape[0]]
    return stamp, (str(path), size, *([float(value) for value in bound] for bound in slope_bounds(normals)))


def _count_tables(report):
    """Count each table file once, however many groups read it."""
    baked, used = ({Path(path) for path in names} for names in (report["baked"], report["baked"] + report["reused"]))
    report["counts"] |= {
        "tables_baked": len(baked), "tables_in_use": len(used),
        "bytes_baked": sum(path.stat().st_size for path in baked),
        "bytes_in_use": sum(path.stat().st_size for path in used),
    }


def _remember(group, stamp, path, size, slope_low, slope_high):
    """What the next call needs to find the table again without reading the image."""
    group["glint_source"] = stamp
    group["glint_size"] = size
    group["glint_slope_low"] = slope_low
    group["glint_slope_high"] = slope_high


def _is_missing(image) -> bool:
    """Whether neither the file nor the pixels of `image` are to be had."""
    return image.source == "FILE" and image_stamp(image) == "" and 0 in image.size[:]


def _device(scene) -> str:
    return scene.cycles.device if hasattr(scene, "cycles") else "CPU"


def _warnings(scene, groups) -> list[str]:
    warnings = []
    if not osl_available():
        warnings.append("This Blender has no Open Shading Language: glints are rendered by its own nodes, with noise.")
    if scene.render.engine != "CYCLES":
        warnings.append(f"The render engine is {scene.render.engine}: choose Cycles to render glints.")
    if _device(scene) == "GPU":
        warnings.append("On a GPU, OptiX or other, glints have the noise of Blender's own nodes: choose CPU.")
    if scene.render.use_simplify and getattr(scene.cycles, "texture_limit_render", "OFF") != "OFF":
        warnings.append("Simplify limits texture sizes, which garbles the glint tables: set its limit to No Limit.")
    if scene.render.use_simplify and getattr(scene.cycles, "texture_resolution_render", 1.0) < 1.0:
        warnings.append("Simplify scales textures down, which garbles the glint tables: set their resolution to 1.")
    for group in groups:
        image = group["glint_image"]
        if group.library is not None:
            warnings.append(
                f'"{group.name}" is linked from {group.library.filepath} and keeps the noise of Blender\'s own nodes: '
                "make it local with Object > Relations > Make Local > All."
            )
        elif _is_missing(image):
            warnings.append(f'The normal map "{image.name}" is missing: find it with File > External Data.')
    return warnings
