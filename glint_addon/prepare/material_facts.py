"""What a preparation takes from glint materials, their maps and objects, in JSON's types, and what changed since."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path

import bpy

from ..bake.float_image import is_whole
from ..errors import GlintError
from ..images import ImageStates, file_digest
from ..materials.find import held_nodes
from ..nodes.glint_bsdf import ROUGHNESS, STRENGTH, group_binding
from ..nodes.script_node import osl_available
from .flake_images import flakes_state
from .stored_tables import remembered_tables
from .uses import Uses, shown_map

VALUES = (ROUGHNESS.name, STRENGTH.name)  # sockets that say which lights facets can mirror
BINDING_WORDS = ("Interpolation", "Convention", "Distribution", "UV map", "Extension", "Surface", "Variation",
                 "Presence", "Flake Color", "Frames")


def material_facts(uses: Uses, states: ImageStates) -> dict[str, list[list[str]]]:
    """Of each material its groups: [name of the map, its state, how it is read..., state of the images of its flakes,
    roughness and strength]; where it cannot be read, the first of these words says why, and the others are empty."""
    found: dict[str, list[list[str]]] = {}
    for group, pairs in uses.items():
        for material in dict.fromkeys(material for _, material in pairs):
            found.setdefault(material.name_full, []).append(_group(group, states) + [_values(material, group)])
    return {name: sorted(groups) for name, groups in found.items()}


def object_facts(uses: Uses) -> dict[str, list[str]]:
    """Of each object that shows glints the names of its materials that do."""
    objects: dict[str, set[str]] = {}
    for pairs in uses.values():
        for thing, material in pairs:
            objects.setdefault(thing.name_full, set()).add(material.name_full)
    return {name: sorted(materials) for name, materials in objects.items()}


def changed_materials(
    before: dict[str, list[list[str]]], now: dict[str, list[list[str]]], digests: dict[str, str]
) -> list[str]:
    """Sentences on materials. digests: {map: `file_digest`} of the maps before, by which a copy of a file is known."""
    sentences = [f'Material "{name}" shows glints now.' for name in now if name not in before]
    for name in sorted(now.keys() & before.keys()):
        if len(now[name]) != len(before[name]):
            sentences.append(f'Material "{name}" has {len(now[name])} Glint BSDFs now, not {len(before[name])}.')
            continue
        for one, other in zip(now[name], before[name], strict=True):
            sentences += _changed_group(name, one, other, digests)
    return sorted(dict.fromkeys(sentences))


def changed_objects(before: dict[str, list[str]], now: dict[str, list[str]]) -> list[str]:
    """Objects whose footprints and lights nobody has judged; objects that no longer show glints change nothing."""
    return sorted(f'Object "{name}" shows glints now.' for name in now
                  if name not in before or set(now[name]) - set(before[name]))


def lost_tables(uses: Uses) -> list[str]:
    """Tables that are not there, or not as they were written: of linked groups too, which cannot be prepared here."""
    if not osl_available():
        return []
    sentences = []
    for group in sorted(uses, key=lambda group: group.name_full):
        tables = remembered_tables(group)
        name = shown_map(group).name
        if not all(table.is_file() for table in tables):
            sentences.append(f'Tables of the map "{name}" are gone from {_folder(tables)}.')
        elif not all(map(is_whole, tables)):
            sentences.append(f'Tables of the map "{name}" are damaged.')
    return list(dict.fromkeys(sentences))


def _group(group: bpy.types.ShaderNodeTree, states: ImageStates) -> list[str]:
    image = shown_map(group)
    try:
        binding = group_binding(group)
    except GlintError as error:
        return [image.name_full, states[image], str(error), *[""] * len(BINDING_WORDS)]
    frames = " ".join(map(str, astuple(binding.frames))) if binding.frames else "all"
    return [image.name_full, states[image], binding.interpolation, binding.convention, binding.distribution,
            binding.uv_map, binding.extension, binding.surface, binding.variation, _name(binding.presence),
            _name(binding.flake_color), frames, flakes_state(group, states)]


def _name(image: bpy.types.Image | None) -> str:
    return image.name_full if image is not None else "none"


def _changed_pixels(name: str, state: str) -> str:
    return f'The pixels of the map "{name}" changed.' if state else f'The file of the map "{name}" is gone.'


def _values(material: bpy.types.Material, group: bpy.types.ShaderNodeTree) -> str:
    """Values that say which lights facets can mirror, to two digits, of the nodes with the group."""
    nodes = [held for held in held_nodes(material) if held.group == group]
    if any(tree.animation_data is not None for held in nodes for tree in held.trees):
        return ""
    values = [held.value(name) for held in nodes for name in VALUES if name in held.node.inputs]
    return " ".join("" if value is None else f"{value:.2g}" for value in values)


def _changed_group(name: str, now: list[str], before: list[str], digests: dict[str, str]) -> list[str]:
    image, state, *reading, flakes, values = now
    old_image, old_state, *old_reading, old_flakes, old_values = before
    if image != old_image:
        return [f'Material "{name}" reads the map "{image}" now, not "{old_image}".']
    is_same = state == old_state or digests[image] != "" and _digest_now(image) == digests[image]
    sentences = [] if is_same else [_changed_pixels(image, state)]
    if reading != old_reading and not all(any(words[1:]) for words in (reading, old_reading)):
        return [*sentences, f'The map of "{name}" can be read again.' if any(reading[1:]) else reading[0]]
    for word, new, old in zip(BINDING_WORDS, reading, old_reading, strict=True):
        if new != old:
            sentences.append(f'{word} of the map of "{name}" is {new or "the active one"} now, not '
                             f'{old or "the active one"}.')
    if flakes != old_flakes and reading == old_reading:
        sentences.append(f'The images of the flakes of "{name}" changed.')
    if values != old_values:
        sentences.append(f'Roughness or Strength of "{name}" changed.')
    return sentences


def _digest_now(image: str) -> str:
    return next((file_digest(each) for each in bpy.data.images if each.name_full == image), "")


def _folder(tables: list[Path]) -> str:
    return next(str(table.parent) for table in tables if not table.is_file())
