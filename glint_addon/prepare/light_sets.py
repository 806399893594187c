"""The sets of lights that materials look for: which material reads which, and what each holds in a scene.

Materials that look for the same lights read one group "Glint Lights"; further sets are "Glint Lights.001" and so on.
The lights' group is inside the Glint BSDF group, so materials with one map and different lights get a Glint BSDF group
each. A set holds lights for each scene, so that a material in several scenes finds those of the one being rendered.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator

import bpy

from ..choice.families import Family, material_families
from ..choice.material_lights import material_choices
from ..choice.ranking import Choice
from ..errors import GlintError
from ..lights.drivers import connect_hints
from ..lights.hint import Hint
from ..lights.hints import rendered_layers, scene_candidates
from ..lights.receivers import copied_places
from ..lights.shutter import Way, shutter_ways
from ..materials.find import glint_groups
from ..materials.worn import worn_materials
from ..nodes import glint_lights
from ..nodes.glint_bsdf import LIGHTS_NODE, group_binding, is_glint_group, lights_of
from ..nodes.map_binding import MapBinding
from ..nodes.map_tables import MapTables
from ..nodes.scene_lights import copy_set, drop_other_sets, has_set
from ..properties import HOLDER
from .report import Report
from .uses import Uses


def connect_lights(scene: bpy.types.Scene, uses: Uses, report: Report) -> dict[bpy.types.Material, Choice]:
    """Choose the lights of each material, and let its nodes read them; a second call changes nothing.

    uses: {Glint BSDF group: [(object, material), ...]} of `scene`, those of other files too if they read sets.
    Adds them to `report`, and returns what was chosen, {material: its `Choice`}. Raises SceneError.
    """
    layers = rendered_layers(scene)
    copied = copied_places(scene, layers)
    found, skipped = scene_candidates(scene, layers, copied)
    families = material_families(uses)
    choices = material_choices(scene, families, found, copied)
    used = {hint for choice in choices for hint in choice.hints}
    ways = shutter_ways(scene, layers, [hint for hint in found if hint in used])
    _connect(scene, families, choices, ways)

    reasons = {name: reason for choice in choices for name, reason in choice.left}
    skipped = sorted(skipped + [(hint.name, reasons[hint.name]) for hint in found if hint not in used])
    chosen = {material: choice for family, choice in zip(families, choices, strict=True)
              for material in family.materials}
    report_lights(report, [hint.name for hint in found if hint in used], skipped, chosen)
    return chosen


def report_lights(
    report: Report, hints: list[str], skipped: list[tuple[str, str]], choices: dict[bpy.types.Material, Choice]
) -> None:
    """Tell `report` the lights that any material looks for, by name, why the others are skipped, and each choice."""
    report.hints = hints
    report.skipped_lights = [list(pair) for pair in skipped]
    for material, choice in choices.items():
        report.hints_by_material[material.name] = [hint.name for hint in choice.hints]
        report.left_by_material[material.name] = [list(pair) for pair in choice.left]


def _connect(scene: bpy.types.Scene, families: list[Family], choices: list[Choice], ways: dict[Hint, Way]) -> None:
    """Let each family's nodes read a set with its lights, which move by their `ways`."""
    numbers = _set_numbers(scene, families, choices)
    lights = {number: glint_lights.build_set(number) for number in sorted(set(numbers))}
    foreign = _foreign_groups(scene, families)

    # Groups that must stay keep their place; all others are assigned anew, by name.
    taken: dict[bpy.types.ShaderNodeTree, bpy.types.ShaderNodeTree] = {}
    for family, number in zip(families, numbers, strict=True):
        if not family.nodes:
            taken.update(dict.fromkeys((group for group in family.groups if group.library is None), lights[number]))
    emptied = set()
    for family, number in zip(families, numbers, strict=True):
        for node in family.nodes:
            instance = _instance(node.node_tree, lights[number], taken, foreign)
            if node.node_tree != instance:
                emptied.add(node.node_tree)
                node.node_tree = instance
    for instance, group in taken.items():
        node = instance.nodes.get(LIGHTS_NODE)
        if node is not None and node.node_tree != group:
            node.node_tree = group

    for family, number, choice in zip(families, numbers, choices, strict=True):
        for each in sorted(family.sets | {number}):
            connect_hints(lights.get(each) or glint_lights.build_set(each), scene, list(choice.hints), ways)
    drop_other_sets(scene, set(numbers).union(*(family.sets for family in families)))

    # Groups of lights lose their users only when the groups that read them are gone.
    bpy.data.batch_remove([group for group in emptied if group.users == 0])
    bpy.data.batch_remove([group for group in glint_lights.groups()
                           if group.users == 0 and group.name != glint_lights.NAME])


def _set_numbers(scene: bpy.types.Scene, families: list[Family], choices: list[Choice]) -> list[int]:
    """The number of the set for each family: the same for the same lights, unless they differ in another scene."""
    others = [each for each in bpy.data.scenes if each != scene and each.library is None]
    numbers: list[int] = []
    lights: dict[int, frozenset[Hint] | None] = {number: None for family in families for number in family.sets}
    for family, choice in zip(families, choices, strict=True):
        if family.sets:
            numbers.append(min(family.sets))
            continue
        elsewhere, wanted = _sets_elsewhere(family, others), frozenset(choice.hints)
        same = [number for number, held in lights.items() if held == wanted and set(elsewhere.values()) <= {number}]
        number = same[0] if same else _free_number(lights, elsewhere, others)
        # Where other scenes read the family's materials too, their lights come along.
        for other, held in elsewhere.items():
            if held != number:
                copy_set(other, held, number)
        lights[number] = wanted
        numbers.append(number)
    return numbers


def _sets_elsewhere(family: Family, others: list[bpy.types.Scene]) -> dict[bpy.types.Scene, int]:
    """{scene: number of the set} of the other scenes in which the family's materials have lights."""
    read = [glint_lights.set_of(lights) for lights in map(lights_of, family.groups) if lights is not None]
    found = {}
    for other in others:
        held = [number for number in read if has_set(other, number)]
        if held and not _materials(other).isdisjoint(family.materials):
            found[other] = held[0]
    return found


def _free_number(taken: Container[int], elsewhere: dict[bpy.types.Scene, int], others: list[bpy.types.Scene]) -> int:
    """A number that no family has: the one that other scenes read already, else one that means nothing to them."""
    kept = [number for number in elsewhere.values() if number not in taken]
    if kept:
        return kept[0]
    number = 1
    while number in taken or elsewhere and any(has_set(other, number) for other in others):
        number += 1
    return number


def _instance(
    group: bpy.types.ShaderNodeTree,
    lights: bpy.types.ShaderNodeTree,
    taken: dict[bpy.types.ShaderNodeTree, bpy.types.ShaderNodeTree],
    foreign: set[bpy.types.ShaderNodeTree],
) -> bpy.types.ShaderNodeTree:
    """The Glint BSDF group that reads the tables of `group` and the lights `lights`: one that is free, or a copy."""
    same = sorted((each for each in bpy.data.node_groups if is_glint_group(each) and each.library is None
                   and _reads(each) == _reads(group)), key=lambda each: each.name)
    ready = [each for each in same if taken.get(each) == lights or each in foreign and lights_of(each) == lights]
    free = [each for each in same if each not in taken and each not in foreign]
    instance = (ready + free or [None])[0] or group.copy()
    taken[instance] = lights
    return instance


def _reads(group: bpy.types.ShaderNodeTree) -> tuple[MapBinding | bpy.types.ShaderNodeTree, MapTables]:
    """How a group reads which map, and its tables: one that was not prepared has others."""
    try:
        binding = group_binding(group)
    except GlintError:  # changed by hand so that it cannot be read: it is like no other
        binding = group
    return binding, MapTables.of(group)


def _foreign_groups(scene: bpy.types.Scene, families: list[Family]) -> set[bpy.types.ShaderNodeTree]:
    """Glint BSDF groups in materials that only other scenes have; these groups keep their sets."""
    own = {material for family in families for material in family.materials}
    others = [each for each in bpy.data.scenes if each != scene]
    return {group for other in others for material in _materials(other) - own for group in glint_groups(material)}


def _materials(scene: bpy.types.Scene) -> set[bpy.types.Material]:
    """All materials that a scene shows, in its collection instances too; it matters for prepared scenes only."""
    layers = [layer for layer in scene.view_layers if layer.use]
    for layer in layers:
        if layer.depsgraph is None and scene.get(HOLDER) is not None:
            layer.update()  # a scene that was never shown since its file was opened
    layers = [layer for layer in layers if layer.depsgraph is not None]
    return {material for thing in _shown(scene.objects, set()) for material in worn_materials(thing, layers)}


def _shown(objects: Iterable[bpy.types.Object], seen: set[bpy.types.Collection]) -> Iterator[bpy.types.Object]:
    for thing in objects:
        yield thing
        collection = thing.instance_collection
        if collection is not None and collection not in seen:
            seen.add(collection)
            yield from _shown(collection.all_objects, seen)
