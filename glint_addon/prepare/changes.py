"""What a scene was prepared from, and what has changed since: the one place that knows when to prepare again.

A preparation leaves the facts it rests on with the scene, as text: the lights and their kinds, the maps' pixels and how
they are read, settings. The same facts now, compared with these, are sentences. What drivers follow is no fact: where
lights are, which way they shine, how large they are. Nothing here changes data or is slow, unless a map is painted or
packed: its pixels are read.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import bpy

from ..bake.float_image import is_whole
from ..images import ImageStates, file_digest
from ..nodes.glint_bsdf import VERSION
from ..nodes.scene_lights import held_sets
from ..properties import PREPARED
from .light_facts import changed_lights, foreign_lights, light_facts, lost_lights
from .material_facts import changed_materials, changed_objects, lost_tables, material_facts, object_facts
from .real_size import changed_sizes
from .setting_facts import changed_settings, setting_facts
from .stored_tables import remembered_tables
from .uses import Uses, glint_uses, shown_map

NOT_PREPARED = "This scene was not prepared yet."
UNREADABLE = "What Glint noted of this scene's preparation is damaged."
OTHER_VERSION = "This scene was prepared by another version of Glint."


def remember_preparation(scene: bpy.types.Scene, uses: Uses, states: ImageStates) -> None:
    """Keep what `scene` is prepared from, at the end of its preparation.

    uses: what `glint_uses` finds in it now; states: of the images that were read, as they were then.
    """
    # Copied or moved elsewhere a file is new to the file system, though it holds what it did.
    digests = {image.name_full: file_digest(image) for image in map(shown_map, uses)}
    text = json.dumps(_facts(scene, uses, states) | {"digests": digests})
    scene[PREPARED] = f"{_digest(text)} {text}"


def changes_since_prepared(scene: bpy.types.Scene) -> list[str]:
    """What changed since `scene` was prepared, a sentence each; none where it is prepared or shows no glints.

    Where something changed, glints are as right as ever, but may have the noise of Blender's own nodes: `prepare_scene`
    helps. The view layers' matrices and modifiers must be up to date, as they are in a window.
    """
    uses = glint_uses(scene, update=False)
    if not uses or not hasattr(scene, "cycles"):
        return []
    if scene.library is not None:  # what is said of it must be done in its own file
        return lost_tables(uses)
    if PREPARED not in scene:
        return [OTHER_VERSION if _has_report(scene) else NOT_PREPARED]
    before, now = _remembered(scene), _facts(scene, uses, ImageStates())
    if before is None:
        return [UNREADABLE]
    if before["version"] != VERSION:
        return [OTHER_VERSION]
    return (lost_lights(before["sets"], now["sets"]) + foreign_lights(scene)
            + changed_lights(before["lights"], now["lights"])
            + changed_materials(before["materials"], now["materials"], before["digests"])
            + changed_objects(before["objects"], now["objects"])
            + changed_sizes(scene, uses, before["objects"])
            + changed_settings(before["settings"], now["settings"]) + lost_tables(uses))


def table_states(scene: bpy.types.Scene) -> dict[Path, str]:
    """The files of the scene's tables, and what is wrong with each: "", "gone" or "damaged"."""
    tables = sorted({table for group in glint_uses(scene, update=False) for table in remembered_tables(group)})
    return {table: "" if is_whole(table) else "damaged" if table.is_file() else "gone" for table in tables}


def _remembered(scene: bpy.types.Scene) -> dict[str, Any] | None:
    """The facts that `scene` was prepared from; None if they are not as they were written."""
    stored = scene[PREPARED]
    digest, _, text = stored.partition(" ") if isinstance(stored, str) else ("", "", "")
    return json.loads(text) if text and digest == _digest(text) else None


def _has_report(scene: bpy.types.Scene) -> bool:
    """Whether the panel shows what a preparation found: before version 10 these left nothing else."""
    state = getattr(scene, "glint", None)
    return state is not None and state.prepared and any((state.hints, state.skipped_lights, state.tables))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _facts(scene: bpy.types.Scene, uses: Uses, states: ImageStates) -> dict[str, Any]:
    """What a preparation rests on, in JSON's types."""
    return {
        "version": VERSION,
        "lights": light_facts(scene),
        "sets": held_sets(scene),
        "materials": material_facts(uses, states),
        "objects": object_facts(uses),
        "settings": setting_facts(scene),
    }
