"""Settings of generators, declared once as dataclass fields, of which operators, panels and files are made."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from ..errors import GenerateError

# What a number measures, and the word for its unit in messages.
LENGTH, ANGLE, FACTOR, NUMBER, COLOR = "LENGTH", "ANGLE", "FACTOR", "NUMBER", "COLOR"
UNITS = {LENGTH: " metres", ANGLE: " radians", FACTOR: "", NUMBER: "", COLOR: ""}


class Choice(NamedTuple):
    """One value of a setting that is chosen from a list."""

    value: str
    label: str
    help: str


@dataclasses.dataclass(frozen=True)
class Setting:
    """What a field of a generator says of itself; `help` is a sentence without its final period, as Blender's are.

    low, high: the smallest and largest value allowed, of numbers only. quantity: LENGTH (metres), ANGLE (radians),
    FACTOR (a share or ratio), COLOR (three numbers, linear) or NUMBER. choices: of texts only. only: (name, values) of
    another setting, with which alone this one has an effect; ("", ()): always.
    """

    label: str
    help: str
    low: float = -math.inf
    high: float = math.inf
    quantity: str = NUMBER
    choices: tuple[Choice, ...] = ()
    only: tuple[str, tuple[str, ...]] = ("", ())


_KEY = "setting"


def setting(default: Any, label: str, help: str, **more: Any) -> Any:
    """A dataclass field with a `default`, described by a `Setting` of `label`, `help` and `more`."""
    return dataclasses.field(default=default, metadata={_KEY: Setting(label, help, **more)})


def settings_of(owner: Any) -> dict[str, Setting]:
    """{name: Setting} of all fields of a dataclass or of one of its instances, in their order."""
    return {field.name: field.metadata[_KEY] for field in dataclasses.fields(owner)}


def check_settings(owner: Any) -> None:
    """Raise GenerateError, naming setting, value and range, if one of a dataclass's settings is not allowed."""
    thing = getattr(owner, "label", type(owner).__name__)
    for name, described in settings_of(owner).items():
        value = getattr(owner, name)
        if described.quantity == COLOR:
            for channel in value:
                _check_number(thing, described, channel, is_whole=False)
        elif isinstance(value, tuple):
            _check_tuple(thing, described, value)
        elif described.choices:
            _check_choice(thing, described, value)
        else:
            _check_number(thing, described, value, isinstance(_default(owner, name), int))


def _default(owner: Any, name: str) -> Any:
    return next(field.default for field in dataclasses.fields(owner) if field.name == name)


def _check_tuple(thing: str, described: Setting, values: Iterable[Any]) -> None:
    values = list(values)
    if not described.low <= len(values) <= described.high:
        raise GenerateError(f"{thing} cannot have {len(values)} {described.label}: choose {described.low:g} to "
                            f"{described.high:g} of them.")
    for value in values:
        check_settings(value)


def _check_choice(thing: str, described: Setting, value: Any) -> None:
    known = [choice.value for choice in described.choices]
    if value not in known:
        raise GenerateError(f'{thing} cannot have the {described.label} "{value}": choose {", ".join(known)}.')


def _check_number(thing: str, described: Setting, value: Any, is_whole: bool) -> None:
    is_number = isinstance(value, (int, float)) and math.isfinite(value) and not isinstance(value, bool)
    if is_number and described.low <= value <= described.high and (not is_whole or value == int(value)):
        return
    kind = "a whole number from " if is_whole else ""
    raise GenerateError(f"{thing} cannot have the {described.label} {value}: choose {kind}{described.low:g} to "
                        f"{described.high:g}{UNITS[described.quantity]}.")
