"""One number that drivers or keys move, and how it is written to a socket only when it differs from what is there."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot


@dataclass(frozen=True)
class Variable:
    """One input of a driver.

    kind "SINGLE_PROP":  `source` is a data-block, `channel` the path of one of its properties.
    kind "CONTEXT_PROP": `source` is ACTIVE_SCENE or ACTIVE_VIEW_LAYER (those being rendered), `channel` such a path.
    """

    name: str
    kind: str
    source: bpy.types.ID | str | None
    channel: str


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


def write_number(socket, number: Driven | Keyed | float):
    """Make `socket` hold the driven, keyed or constant `number`; touch nothing if it already does."""
    if isinstance(number, Driven):
        curve = driver_curve(socket)
        if curve is None or _number_of(curve) != number:
            clear_driver(socket)
            _add_driver(socket, number)
        return
    clear_driver(socket)
    if isinstance(number, Keyed):
        _write_keys(socket, number)
        return
    _clear_keys(socket)
    if socket.default_value != np.float32(number):
        socket.default_value = number


def driver_curve(socket) -> bpy.types.FCurve | None:
    """The F-curve that holds the driver of the socket's value, or None."""
    animation = socket.id_data.animation_data
    return animation.drivers.find(socket.path_from_id("default_value")) if animation else None


def clear_driver(socket):
    """Remove the driver of the socket's value, if it has one; the value stays."""
    if driver_curve(socket) is not None:
        socket.driver_remove("default_value")


def _write_keys(socket, number: Keyed):
    keys = np.stack([number.frames, number.values], axis=1).astype(np.float32)
    curve = _key_curve(socket)
    if curve is not None and np.array_equal([key.co[:] for key in curve.keyframe_points], keys):
        return
    _clear_keys(socket)
    for frame, value in keys.tolist():
        socket.default_value = value
        socket.keyframe_insert("default_value", frame=frame)
    for key in _key_curve(socket).keyframe_points:
        key.interpolation = "LINEAR"


def _clear_keys(socket):
    curve = _key_curve(socket)
    if curve is not None:
        _bag(socket).fcurves.remove(curve)


def _key_curve(socket) -> bpy.types.FCurve | None:
    bag = _bag(socket)
    return bag.fcurves.find(socket.path_from_id("default_value")) if bag else None


def _bag(socket):
    """The animation curves of the socket's node tree, or None."""
    animation = socket.id_data.animation_data
    if animation is None or animation.action is None or animation.action_slot is None:
        return None
    return action_get_channelbag_for_slot(animation.action, animation.action_slot)


def _add_driver(socket, number: Driven):
    curve = socket.driver_add("default_value")
    # A new driver maps its value through a curve of two keys; without keys the value goes through as it is.
    curve.keyframe_points.clear()
    driver = curve.driver
    driver.type = "SCRIPTED"
    for variable in number.variables:
        _add_variable(driver, variable)
    driver.expression = number.expression


def _add_variable(driver, variable: Variable):
    entry = driver.variables.new()
    entry.name = variable.name
    entry.type = variable.kind
    target = entry.targets[0]
    if variable.kind == "CONTEXT_PROP":
        target.context_property = variable.source
        target.data_path = variable.channel
        return
    target.id_type = variable.source.id_type
    target.id = variable.source
    target.data_path = variable.channel


def _number_of(curve) -> Driven:
    """What the driver in `curve` computes, in the terms of this module."""
    return Driven(curve.driver.expression, tuple(_variable_of(entry) for entry in curve.driver.variables))


def _variable_of(entry) -> Variable:
    target = entry.targets[0]
    if entry.type == "CONTEXT_PROP":
        return Variable(entry.name, entry.type, target.context_property, target.data_path)
    return Variable(entry.name, entry.type, target.id, target.data_path)
