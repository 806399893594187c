"""The settings of a generated map as Blender's properties on its image, made from what the generators say of them."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..errors import EditedError, GlintError
from ..generate import GENERATORS, Coloring, Population, Recipe, Setting, Stop, settings_of

SUBTYPES = {"LENGTH": "DISTANCE", "ANGLE": "ANGLE", "FACTOR": "FACTOR", "NUMBER": "NONE"}
RESOLUTIONS = (64, 128, 256, 512, 1024, 2048, 4096)  # texels a side
DIGITS = 7  # that a Blender property keeps of a number: 0.00005 comes back as 4.9999999e-05

_listeners: list = []  # functions that are called with the image whose settings a user changed
_quiet: list = []  # not empty while settings are written that nobody is to hear of


def changed(settings, _context=None):
    """Called by Blender when a setting was changed."""
    if not _quiet:
        for listener in _listeners:
            listener(settings.id_data)


def listen(listener):
    """Let `listener(image)` be called after each change of a setting."""
    _listeners.append(listener)


def listen_no_more(listener):
    """The opposite of `listen`."""
    _listeners.remove(listener)


@contextmanager
def unheard():
    """While settings are changed here, no listener hears of it."""
    _quiet.append(True)
    try:
        yield
    finally:
        _quiet.pop()


def property_of(described: Setting, default: Any):
    """A property of Blender for a setting."""
    words = {"name": described.label, "description": described.help, "update": changed}
    if described.choices:
        return EnumProperty(**words, items=[tuple(choice) for choice in described.choices], default=default)
    bounds = {"min": described.low, "max": described.high, "default": default}
    if described.quantity == "COLOR":
        return FloatVectorProperty(**words, **bounds, subtype="COLOR", size=3)
    if isinstance(default, int):
        return IntProperty(**words, **bounds)
    subtype = SUBTYPES[described.quantity]
    return FloatProperty(**words, **bounds, subtype=subtype, precision=2 if subtype == "ANGLE" else 5)


def group_of(owner: Any, name: str) -> type:
    """A property group with the settings of a dataclass; several parts become a collection."""
    annotations = {}
    for key, described in settings_of(owner).items():
        default = getattr(owner(), key)
        if key in PART_GROUPS:
            annotations[key] = CollectionProperty(name=described.label, type=PART_GROUPS[key][1])
        else:
            annotations[key] = property_of(described, default)
    words = getattr(owner, "help", owner.__doc__)
    return type(f"GLINT_PG_{name}", (bpy.types.PropertyGroup,), {"__annotations__": annotations, "__doc__": words})


# Parts of which a setting has several: the dataclass, and its group.
PART_GROUPS: dict[str, tuple[Any, type]] = {}
PART_GROUPS["populations"] = Population, group_of(Population, "population")
PART_GROUPS["stops"] = Stop, group_of(Stop, "stop")
KIND_GROUPS = {kind: group_of(cls, kind.lower()) for kind, cls in GENERATORS.items()}
GLINT_PG_coloring = group_of(Coloring, "coloring")


class GLINT_PG_generated(bpy.types.PropertyGroup):
    """What the map of an image is generated from; each kind keeps its settings while another is chosen"""

    kind: EnumProperty(
        name="Kind", description="What the surface is made of", update=changed,
        items=[(kind, cls.label, cls.help) for kind, cls in GENERATORS.items()],
    )
    resolution: EnumProperty(
        name="Resolution", description="Texels along a side of the map", update=changed, default="2048",
        items=[(str(side), str(side), f"{side} x {side} texels") for side in RESOLUTIONS],
    )
    coloring: PointerProperty(type=GLINT_PG_coloring)
    problem: StringProperty(name="Problem", description="Why the map does not show its settings")
    is_edited: BoolProperty(name="Edited", description="Whether the problem is that a user edited the map")
    __annotations__.update({kind.lower(): PointerProperty(type=group) for kind, group in KIND_GROUPS.items()})


classes = (*(group for _, group in PART_GROUPS.values()), *KIND_GROUPS.values(), GLINT_PG_coloring, GLINT_PG_generated)


def set_problem(state: GLINT_PG_generated, error: GlintError | None):
    """Let the panel say why a map does not show its settings, or with None that it does."""
    state.problem, state.is_edited = str(error or ""), isinstance(error, EditedError)


def kind_settings(state: GLINT_PG_generated):
    """The property group of the kind that is chosen."""
    return getattr(state, state.kind.lower())


def recipe_from(state: GLINT_PG_generated) -> Recipe:
    """The recipe that the properties say; it may have values that are not allowed."""
    return Recipe(
        _made(GENERATORS[state.kind], kind_settings(state)), int(state.resolution), _made(Coloring, state.coloring)
    )


def complete(state: GLINT_PG_generated):
    """Give a kind that is chosen for the first time the parts of which it needs one at least."""
    with unheard():
        for owner, group in ((GENERATORS[state.kind], kind_settings(state)), (Coloring, state.coloring)):
            for name in PART_GROUPS.keys() & settings_of(owner).keys():
                if not getattr(group, name):
                    _fill_parts(getattr(group, name), getattr(owner(), name))


def fill(state: GLINT_PG_generated, recipe: Recipe):
    """Let the properties say what a recipe says; no listener hears of it."""
    with unheard():
        state.kind, state.resolution = recipe.generator.kind, str(recipe.resolution)
        _fill(kind_settings(state), recipe.generator)
        _fill(state.coloring, recipe.coloring)


def _fill(group, owner):
    for name in settings_of(owner):
        value = getattr(owner, name)
        if name in PART_GROUPS:
            _fill_parts(getattr(group, name), value)
        else:
            setattr(group, name, value)


def _fill_parts(parts, values):
    parts.clear()
    for each in values:
        _fill(parts.add(), each)


def _made(owner, group):
    values = {}
    for name, described in settings_of(owner).items():
        value = getattr(group, name)
        if name in PART_GROUPS:
            value = tuple(_made(PART_GROUPS[name][0], each) for each in value)
        elif described.quantity == "COLOR":
            value = tuple(map(_rounded, value))
        elif isinstance(value, float):
            value = _rounded(value)
        values[name] = value
    return owner(**values)


def _rounded(value):
    return float(f"{value:.{DIGITS}g}")
