"""The table of generators, named sets of settings, and settings as plain data for files."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from ..errors import GenerateError
from .brushed import Brushed
from .bumps import ORANGE_PEEL, Bumps
from .coloring import Stop
from .dents import Dents
from .flakes import Flakes, Population
from .grains import SAND, SNOW, SUGAR, Grains
from .microstructure import Generator
from .scratches import SWIRLS, Scratches
from .sequins import Sequins
from .settings import check_settings

# In the order in which menus show them.
GENERATORS: dict[str, type[Generator]] = {
    each.kind: each for each in (Flakes, Scratches, Brushed, Bumps, Grains, Sequins, Dents)
}
# Sets of settings with a name of their own.
PRESETS: dict[str, Generator] = {
    "Snow": SNOW,
    "Sand": SAND,
    "Sugar": SUGAR,
    "Orange Peel": ORANGE_PEEL,
    "Polishing Swirls": Scratches(
        shape=SWIRLS, density=120.0, length=0.012, width=0.000015, depth=0.000001, direction_spread=5.0, radius=0.008,
        bundle=4,
    ),
}
# Elements of the settings that are several dataclasses, by name.
PARTS = {"populations": Population, "stops": Stop}


def as_data(generator: Generator) -> dict[str, Any]:
    """A generator as numbers, texts, lists and dicts, as JSON has them: {"kind": its kind, setting: value}."""
    return {"kind": generator.kind, **plain(generator)}


def of_data(data: Mapping[str, Any]) -> Generator:
    """The generator that `as_data` gave; settings that are not there have their default.

    Raises GenerateError for an unknown kind or setting, and for values that are not allowed.
    """
    values = dict(data)
    kind = values.pop("kind", None)
    if kind not in GENERATORS:
        raise GenerateError(f'There is no generator "{kind}": choose {", ".join(GENERATORS)}.')
    generator = made(GENERATORS[kind], values)
    check_settings(generator)
    return generator


def plain(owner: Any) -> dict[str, Any]:
    """The settings of a dataclass of this room as numbers, texts, lists and dicts."""
    values = {field.name: getattr(owner, field.name) for field in dataclasses.fields(owner)}
    return {name: [plain(each) for each in value] if name in PARTS else value for name, value in values.items()}


def made(cls: Any, values: Mapping[str, Any]) -> Any:
    """The dataclass `cls` of settings that `plain` gave; what is left out has its default. Raises GenerateError."""
    known = {field.name for field in dataclasses.fields(cls)}
    for name in values:
        if name not in known:
            raise GenerateError(f'{getattr(cls, "label", cls.__name__)} has no setting "{name}": choose '
                                f"{', '.join(sorted(known))}.")
    # JSON has lists only.
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    parts = {name: tuple(made(PARTS[name], each) for each in values[name]) for name in PARTS if name in values}
    return cls(**{**values, **parts})
