"""Presets: materials that need no map, each described by one file of glint_addon/presets.

A file is JSON:

* "name", "category" and "description": for menus;
* "map": a recipe of glint_addon/generate, see `Recipe.text`: generator, resolution, and colours of flakes;
* "glint": arguments of `create_glint_material` that describe the facets;
* "base": {input of a Principled BSDF: value} of what lies between flakes, or beneath all facets where the map has no
  presence; see `preset_base` for the two inputs that may follow the map;
* "paint": {input of Glint Car Paint: value}, if the material is such a group; it then has the base coat;
* "uvs": "RADIAL" if the map wants UVs that run around an axis, see `add_radial_uvs`.

One repeat of the map is as wide as its generator's Extent says, on every object.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from .. import paths
from ..errors import GenerateError, GlintError, MapError
from ..generate import Recipe, recipe_of_text


@dataclass(frozen=True)
class Preset:
    """A ready material; see this module for the fields."""

    name: str
    category: str
    description: str
    recipe: Recipe
    glint: dict[str, Any] = field(default_factory=dict)
    base: dict[str, Any] = field(default_factory=dict)
    paint: dict[str, Any] | None = None
    uvs: str = ""

    @property
    def scale(self) -> float:
        """Metres that one repeat of the map measures."""
        return self.recipe.generator.extent


@cache
def presets() -> dict[str, Preset]:
    """All presets by name, sorted by category and name. Raises GlintError for a file that is none."""
    found = [_read(file) for file in sorted(paths.preset_folder().glob("*.json"))]
    return {preset.name: preset for preset in sorted(found, key=lambda preset: (preset.category, preset.name))}


def preset_named(name: str) -> Preset:
    """The preset of that name. Raises MapError if there is none."""
    if name not in presets():
        raise MapError(f'There is no preset "{name}": use one of {", ".join(presets())}.')
    return presets()[name]


def _read(file) -> Preset:
    try:
        parts = json.loads(file.read_text(encoding="utf-8"))
        recipe = recipe_of_text(json.dumps(parts.pop("map")))
        return Preset(recipe=recipe, **parts)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, GenerateError) as error:
        raise GlintError(f"Preset {file.name} cannot be read ({error}): reinstall Glint.") from error
