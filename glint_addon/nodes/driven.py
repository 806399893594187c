"""A number with a driver or keys, which is written only where it differs from the present one.

A number is held by a node's socket, or is one of an array that a data-block keeps as a custom property (`Entry`).
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

VALUE = "default_value"  # of sockets, and so of entries
FRAME = "frame"  # Blender's name for the frame, fractions too, in expressions that it evaluates without Python


@dataclass(frozen=True)
class Variable:
    """One input of a driver.

    kind "SINGLE_PROP":  `source` is a data-block, `channel` the path of one of its properties.
    kind "CONTEXT_PROP": `source` is ACTIVE_SCENE or ACTIVE_VIEW_LAYER (those being rendered), `channel` such a path.
    otherwise: the value where there is no such property, None if there must be one.
    """

    name: str
    kind: str
    source: bpy.types.ID | str | None
    channel: str
    otherwise: float | None = None


@dataclass(frozen=True)
class Driven:
    """A number computed from variables by a simple expression (Blender evaluates those without Python)."""

    expression: str
    variables: tuple[Variable, ...]


@dataclass(frozen=True)
class Keyed:
    """A number with keys: `values` at `frames`, in order, linear between them."""

    frames: tuple[int, ...]
    values: tuple[float, ...]


@dataclass
class Entry:
    """Number `index` of the array that data-block `id_data` keeps as custom property `key`; used like a socket."""

    id_data: bpy.types.ID
    key: str
    index: int

    @property
    def default_value(self) -> float:
        """The number as it is now."""
        return self.id_data[self.key][self.index]

    @default_value.setter
    def default_value(self, number: float):
        self.id_data[self.key][self.index] = number
        self.id_data.update_tag()

    def path_from_id(self, _value: str) -> str:
        """Path of the array."""
        return f'["{self.key}"]'

    def driver_add(self, _value: str) -> bpy.types.FCurve:
        """Give the number a driver."""
        return self.id_data.driver_add(self.path_from_id(VALUE), self.index)

    def driver_remove(self, _value: str):
        """Take its driver away."""
        self.id_data.driver_remove(self.path_from_id(VALUE), self.index)


def write_number(place, number: Driven | Keyed | float):
    """Make `place`, a socket or an `Entry`, hold the driven, keyed or constant number, unless it holds it already."""
    if isinstance(number, Driven | Keyed):
        curve = driver_curve(place)
        if curve is None or _number_of(curve) != _as_stored(number):
            clear_driver(place)
            _add_driver(place, number)
        return
    clear_driver(place)
    if place.default_value != np.float32(number):
        place.default_value = float(np.float32(number))


def number_at(place) -> Driven | Keyed | float:
    """The number that `place`, a socket or an `Entry`, holds."""
    curve = driver_curve(place)
    return place.default_value if curve is None else _number_of(curve)


def driver_curve(place) -> bpy.types.FCurve | None:
    """The F-curve that holds the driver of the place's value, or None."""
    animation = place.id_data.animation_data
    if animation is None:
        return None
    return animation.drivers.find(place.path_from_id(VALUE), index=max(getattr(place, "index", 0), 0))


def clear_driver(place):
    """Remove the driver of the place's value, if it has one; the value stays."""
    if driver_curve(place) is not None:
        place.driver_remove(VALUE)


def _add_driver(place, number: Driven | Keyed):
    curve = place.driver_add(VALUE)
    # A driver maps its value through the curve's keys: without keys the value stays as it is, and with the number's
    # keys it depends on the frame alone. So no action is needed, which would belong to the user.
    curve.keyframe_points.clear()
    driver = curve.driver
    driver.type = "SCRIPTED"
    if isinstance(number, Keyed):
        driver.expression = FRAME
        _add_keys(curve, number)
        return
    for variable in number.variables:
        _add_variable(driver, variable)
    driver.expression = number.expression


def _add_keys(curve, number: Keyed):
    curve.extrapolation = "CONSTANT"
    curve.keyframe_points.add(len(number.frames))
    for key, frame, value in zip(curve.keyframe_points, number.frames, number.values, strict=True):
        key.co = frame, value
        key.interpolation = "LINEAR"
    curve.update()


def _add_variable(driver, variable: Variable):
    entry = driver.variables.new()
    entry.name = variable.name
    entry.type = variable.kind
    target = entry.targets[0]
    if variable.otherwise is not None:
        target.use_fallback_value, target.fallback_value = True, variable.otherwise
    if variable.kind == "CONTEXT_PROP":
        target.context_property = variable.source
        target.data_path = variable.channel
        return
    target.id_type = variable.source.id_type
    target.id = variable.source
    target.data_path = variable.channel


def _as_stored(number: Driven | Keyed) -> Driven | Keyed:
    """The number with its keys in 32 bits, as Blender keeps them."""
    if isinstance(number, Driven):
        return number
    return Keyed(number.frames, tuple(float(np.float32(value)) for value in number.values))


def _number_of(curve) -> Driven | Keyed:
    """The number that the driver in `curve` computes, as a `Driven` or `Keyed`."""
    keys = curve.keyframe_points
    if len(keys):
        return Keyed(tuple(int(key.co.x) for key in keys), tuple(key.co.y for key in keys))
    return Driven(curve.driver.expression, tuple(_variable_of(entry) for entry in curve.driver.variables))


def _variable_of(entry) -> Variable:
    target = entry.targets[0]
    otherwise = target.fallback_value if target.use_fallback_value else None
    if entry.type == "CONTEXT_PROP":
        return Variable(entry.name, entry.type, target.context_property, target.data_path, otherwise)
    return Variable(entry.name, entry.type, target.id, target.data_path, otherwise)
