"""The node groups that materials read their lights from.

Materials that look for the same lights read one group "Glint Lights"; further sets are "Glint Lights.001" and so on.
The lights' group is inside the Glint BSDF group, so materials with one map and different lights get a Glint BSDF group
each.
"""

from __future__ import annotations

import bpy

from .lights.drivers import connect_hints
from .lights.hints import rendered_layers, scene_candidates
from .lights.receivers import copied_places
from .lights.shutter import shutter_ways
from .material import glint_groups
from .material_lights import material_choices, material_families
from .nodes import glint_lights
from .nodes.glint_bsdf import LIGHTS_NODE, group_binding, is_glint_group

CLAIM = "glint_scene"  # property of a lights' group: name of the scene whose lights it holds


def connect_lights(scene, uses) -> dict:
    """Choose the lights of each material, and let its nodes read them; a second call changes nothing.

    uses: {local Glint BSDF group: [(object, material), ...]} of `scene`. Returns the parts of the report: "hints",
    "skipped_lights", "hints_by_material" {material: [light, ...]}, "left_by_material" {material: [[light, reason],
    ...]}, "warnings" about materials of several scenes, and "visits" {material: elements a sample visits at most}.
    Raises SceneError.
    """
    layers = rendered_layers(scene)
    copied = copied_places(scene, layers)
    found, skipped = scene_candidates(scene, layers, copied)
    families = material_families(uses)
    choices = material_choices(scene, families, found, copied)
    warnings = _warnings(scene, families)
    used = {hint for choice in choices for hint in choice.hints}
    ways = shutter_ways(scene, layers, [hint for hint in found if hint in used])
    _connect(scene, families, choices, ways)

    reasons = {name: reason for choice in choices for name, reason in choice.left}
    skipped = sorted(skipped + [(hint.name, reasons[hint.name]) for hint in found if hint not in used])
    pairs = [(material.name, choice) for family, choice in zip(families, choices, strict=True)
             for material in family.materials]
    return {
        "hints": [hint.name for hint in found if hint in used],
        "skipped_lights": [list(pair) for pair in skipped],
        "hints_by_material": {name: [hint.name for hint in choice.hints] for name, choice in pairs},
        "left_by_material": {name: [list(pair) for pair in choice.left] for name, choice in pairs},
        "warnings": warnings,
        "visits": {material: choice.visits for family, choice in zip(families, choices, strict=True)
                   for material in family.materials},
    }


def _connect(scene, families, choices, ways):
    """Let each family's nodes read a group with its lights, which move by their `ways`."""
    foreign = _foreign_groups(scene, families)
    sets = _light_groups(scene, [choice.hints for choice in choices], ways, foreign)
    lights = [sets[choice.hints] for choice in choices]

    # Groups that must stay keep their place; all others are dealt out anew, by name.
    taken = {}
    for family, group in zip(families, lights, strict=True):
        if not family.nodes:
            taken.update(dict.fromkeys(family.groups, group))
    emptied = set()
    for family, group in zip(families, lights, strict=True):
        for node in family.nodes:
            instance = _instance(node.node_tree, group, taken, foreign)
            if node.node_tree != instance:
                emptied.add(node.node_tree)
                node.node_tree = instance
    for instance, group in taken.items():
        node = instance.nodes.get(LIGHTS_NODE)
        if node is not None and node.node_tree != group:
            node.node_tree = group

    # Groups of lights lose their users only when the groups that read them are gone.
    bpy.data.batch_remove([group for group in emptied if group.users == 0])
    bpy.data.batch_remove([group for group in glint_lights.groups()
                           if group.users == 0 and group.name != glint_lights.NAME])


def _instance(group, lights, taken, foreign):
    """The Glint BSDF group that reads the tables of `group` and the lights `lights`: one that is free, or a copy."""
    same = sorted((each for each in bpy.data.node_groups if is_glint_group(each) and each.library is None
                   and each not in foreign and _reads(each) == _reads(group)), key=lambda each: each.name)
    ready = [each for each in same if taken.get(each) == lights]
    free = [each for each in same if each not in taken]
    instance = (ready + free or [None])[0] or group.copy()
    taken[instance] = lights
    return instance


def _reads(group):
    """How a group reads which map, and the paths of its tables: one that was not prepared has others."""
    return group_binding(group), {name: value for name, value in group.items() if isinstance(value, str)}


def _light_groups(scene, sets, ways, foreign) -> dict:
    """A lights' group for each of the sets of hints, with these in it."""
    read = {_lights_of(group) for group in foreign}
    glint_lights.build()
    free = [group for group in glint_lights.groups() if group not in read]
    found = {}
    for hints in sets:
        if hints not in found:
            found[hints] = free.pop(0) if free else glint_lights.build_another()
            connect_hints(found[hints], scene, list(hints), ways)
            if found[hints].get(CLAIM) != scene.name:
                found[hints][CLAIM] = scene.name
    return found


def _foreign_groups(scene, families) -> set:
    """Glint BSDF groups that were prepared for another scene, in materials that only other scenes have."""
    own = {material for family in families for material in family.materials}
    foreign = set()
    for other in (each for each in bpy.data.scenes if each != scene):
        for group in {group for material in _materials(other) - own for group in glint_groups(material)}:
            lights = _lights_of(group)
            if lights is not None and lights.get(CLAIM) == other.name:
                foreign.add(group)
    return foreign


def _warnings(scene, families) -> list[str]:
    """Materials of this scene that were prepared for another: they look for the lights of one scene only."""
    own = [material for family in families for material in family.materials]
    found = []
    for other in bpy.data.scenes:
        theirs = _materials(other) if other != scene else set()
        found += [
            f'"{material.name}" is in scene "{other.name}" too, and looks for the lights of "{scene.name}" now: '
            f'prepare "{other.name}" again before rendering that.'
            for material in own if material in theirs and other.name in _claims(material)
        ]
    return found


def _materials(scene) -> set:
    return {slot.material for thing in scene.objects for slot in thing.material_slots} - {None}


def _claims(material) -> set:
    """Names of the scenes whose lights a material reads."""
    groups = (_lights_of(group) for group in glint_groups(material))
    return {group.get(CLAIM) for group in groups if group is not None}


def _lights_of(group):
    """The lights' group that a Glint BSDF group reads, or None."""
    node = group.nodes.get(LIGHTS_NODE)
    return node.node_tree if node is not None else None
