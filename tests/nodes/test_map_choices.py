"""The choices of how a map is read: one list, which all places follow or which a test holds against their own."""

import inspect
import re
from dataclasses import fields, replace
from pathlib import Path

import bpy
import pytest

from glint_addon import create_glint_material
from glint_addon.bake import counts, normal_map
from glint_addon.errors import MapError
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import tiles
from glint_addon.nodes.glint_bsdf import build, group_binding
from glint_addon.nodes.map_binding import READING, MapBinding
from glint_addon.nodes.map_choices import CHOICES, EXTENSION, INTERPOLATION, SURFACE, VARIATION, Value
from glint_addon.nodes.map_tables import SCRIPT_NODE
from glint_addon.nodes.script_node import osl_available
from glint_addon.nodes.surface_kinds import KINDS, surface_of
from glint_addon.operators.map_settings import choice_property
from glint_addon.prepare.material_facts import BINDING_WORDS
from glint_addon.ui.panel import binding_words
from tests.helpers.extension import write_flake_map

SHADER = Path(__file__).parents[2] / "osl" / "glint.osl"
OPERATORS = ("add_material", "change_map")
NEW = Value("NEW", "New", "A value that nobody knows yet")
# Where the bake has a list of its own: it must not import Blender, nor these modules.
BAKED = {"convention": normal_map.CONVENTIONS, "interpolation": counts.FIRST_BLOCK}


def unknown_to_blenders_node(choice) -> list:
    """Values that Blender's own node in the group has not; each kind of surface has a node of its own."""
    if choice is CHOICES["surface"]:
        return [identifier for identifier in choice.identifiers if identifier not in KINDS]
    if choice is CHOICES["variation"]:
        return [identifier for identifier in choice.identifiers[1:] if identifier not in tiles.NODES]
    values = build().nodes[choice.node].bl_rna.properties[choice.name].enum_items.keys()
    return [value.identifier for value in choice.values if value.native not in values]


def unknown_to_the_shader(choice) -> list:
    """Values that osl/glint.osl cannot tell from another; it leaves all extensions but one to Blender's own nodes."""
    if not choice.number or choice is CHOICES["extension"]:
        return []
    numbers = [value.number for value in choice.values]
    return [identifier for k, identifier in enumerate(choice.identifiers) if numbers[k] in numbers[:k]]


def unknown_to_the_bake(choice) -> list:
    """Values that tables cannot be baked for; of a choice without a list of its own they do not depend."""
    return [identifier for identifier in choice.identifiers if identifier not in BAKED.get(choice.name, [identifier])]


def missing_in_the_documentation(choice) -> list:
    """Values that the public function does not name."""
    return [identifier for identifier in choice.identifiers if f"'{identifier}'" not in create_glint_material.__doc__]


PLACES = {
    "Blender's node": unknown_to_blenders_node,
    "osl/glint.osl": unknown_to_the_shader,
    "glint_addon/bake": unknown_to_the_bake,
    "the docstring of create_glint_material": missing_in_the_documentation,
}


def forgotten(choice) -> dict[str, list]:
    """The places that do not know all values of a choice, with those that they lack."""
    found = {place: unknown(choice) for place, unknown in PLACES.items()}
    return {place: values for place, values in found.items() if values}


@pytest.fixture(params=CHOICES)
def extended(request, scene, monkeypatch):
    """A choice with a value more than there are."""
    choice = CHOICES[request.param]
    monkeypatch.setitem(CHOICES, choice.name, replace(choice, values=(*choice.values, NEW)))
    return CHOICES[choice.name]


@pytest.mark.parametrize("name", CHOICES)
def test_every_place_with_a_list_of_its_own_knows_every_value(scene, name):
    assert forgotten(CHOICES[name]) == {}


def test_a_new_value_is_missed_where_it_has_to_be_taught(extended):
    of_the_shader = ("surface", "distribution", "interpolation", "variation")
    taught = {"Blender's node", "the docstring of create_glint_material"}
    taught |= {"osl/glint.osl"} if extended.name in of_the_shader else set()
    taught |= {"glint_addon/bake"} if extended.name in ("convention", "interpolation") else set()
    assert forgotten(extended) == dict.fromkeys(taught, [NEW.identifier])


def test_a_new_value_is_taken_by_checks_operators_and_panel_without_more(extended, monkeypatch):
    monkeypatch.setitem(KINDS, NEW.identifier, KINDS["TINT"])
    binding = MapBinding(**{extended.name: NEW.identifier})
    monkeypatch.setattr("glint_addon.ui.panel.group_binding", lambda group: binding)
    assert NEW.label in binding_words(None)
    assert choice_property(extended).keywords["items"][-1] == (NEW.identifier, NEW.label, NEW.help)
    with pytest.raises(MapError, match=f'^{extended.label} "OTHER" is unknown: use one of .*, NEW.$'):
        MapBinding(**{extended.name: "OTHER"})


@pytest.mark.parametrize("operator", OPERATORS)
@pytest.mark.parametrize("name", CHOICES)
def test_operators_offer_the_values_of_the_list_in_its_order(registered, operator, name):
    setting, choice = getattr(bpy.ops.glint, operator).get_rna_type().properties[name], CHOICES[name]
    items = [(item.identifier, item.name, item.description) for item in setting.enum_items]
    assert (setting.name, setting.description, items) == (choice.label, choice.help, list(choice.items))
    assert setting.default == choice.default


@pytest.mark.parametrize("operator", OPERATORS)
def test_every_way_of_reading_is_a_setting_of_the_operators(registered, operator):
    assert set(READING) <= set(getattr(bpy.ops.glint, operator).get_rna_type().properties.keys())


def test_every_choice_is_a_field_and_an_argument_with_the_same_default():
    arguments = inspect.signature(create_glint_material).parameters
    defaults = {field.name: field.default for field in fields(MapBinding)}
    assert {name: arguments[name].default for name in READING} == {name: defaults[name] for name in READING}
    assert {name: choice.default for name, choice in CHOICES.items()}.items() <= defaults.items()
    assert set(READING) == {*CHOICES, "uv_map"}


def test_changes_are_told_in_the_words_of_the_list():
    words = {name: choice.label for name, choice in CHOICES.items()} | {"uv_map": "UV map"}
    assert (*(words[name] for name in READING), "Presence", "Flake Color", "Frames") == BINDING_WORDS


def test_the_flags_are_inputs_of_the_shader():
    inputs = set(re.findall(r"^ {4}int (\w+) = [01] \[\[", SHADER.read_text(encoding="utf-8"), re.MULTILINE))
    assert {choice.number for choice in CHOICES.values() if choice.number} <= inputs


def test_the_numbers_of_surfaces_are_those_of_the_shader():
    header = (SHADER.parent / "facet.h").read_text(encoding="utf-8")
    numbers = {name: int(number) for name, number in re.findall(r"^#define SURFACE_(\w+) (\d)", header, re.MULTILINE)}
    assert numbers == {value.identifier: value.number for value in SURFACE.values}
    assert list(numbers) == list(KINDS)


def test_the_numbers_of_variations_are_those_of_the_shader():
    header = (SHADER.parent / "tiles.h").read_text(encoding="utf-8")
    numbers = {name: int(number) for name, number in re.findall(r"^#define VARIATION_(\w+) (\d)", header, re.MULTILINE)}
    assert numbers == {value.identifier: value.number for value in VARIATION.values[1:]}
    assert list(numbers) == list(tiles.NODES)


@pytest.mark.parametrize("name", CHOICES)
def test_each_value_goes_into_the_nodes_and_comes_out_again(scene, tmp_path, name):
    choice, flags = CHOICES[name], []
    for identifier in choice.identifiers:
        settings = {name: identifier} | ({"interpolation": "CLOSEST"} if choice is VARIATION else {})
        material = create_glint_material(identifier, write_flake_map(tmp_path / "flakes.png"), **settings)
        (group,) = glint_groups(material)
        assert getattr(group_binding(group), name) == identifier
        if choice is SURFACE:
            assert surface_of(group) == identifier
        elif choice is VARIATION:
            assert (choice.node in group.nodes) == (identifier == "SHUFFLE")
        else:
            assert getattr(group.nodes[choice.node], name) == choice.value(identifier).native
        if osl_available() and choice.number:
            flags.append(group.nodes[SCRIPT_NODE].inputs[choice.number].default_value)
    assert not flags or flags == [value.number for value in choice.values]


def test_what_blenders_node_may_say_besides_is_named_in_capitals():
    assert INTERPOLATION.identifier("Closest") == "CLOSEST" and INTERPOLATION.identifier("Cubic") == "CUBIC"
    with pytest.raises(KeyError, match="CUBIC"):
        INTERPOLATION.value("CUBIC")


def test_the_panel_leaves_out_only_what_is_expected(monkeypatch):
    monkeypatch.setattr("glint_addon.ui.panel.group_binding", lambda group: MapBinding())
    assert binding_words(None) == ["Beckmann", "Linear", "OpenGL"] and EXTENSION.expected == EXTENSION.default
