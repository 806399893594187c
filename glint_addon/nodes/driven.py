"""One driven number: what drives it, and how it is written to a socket only when it differs from what is there."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

# With the Euler order ZYX Blender takes two of the three angles from the object's Z axis alone, so that this axis is
# exact even where a parent shears the object or mirrors it (see `lights.drivers`).
ROTATION_ORDER = "ZYX"


@dataclass(frozen=True)
class Variable:
    """One input of a driver.

    kind "TRANSFORMS":   `source` is an object, `channel` a world-space channel (LOC_X [m], ROT_X [rad, ZYX], SCALE_X).
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


def write_number(socket, number: Driven | float):
    """Make `socket` hold the driven or constant `number`; touch nothing if it already does."""
    curve = driver_curve(socket)
    if isinstance(number, Driven):
        if curve is None or _number_of(curve) != number:
            clear_driver(socket)
            _add_driver(socket, number)
        return
    clear_driver(socket)
    if socket.default_value != number:
        socket.default_value = number


def driver_curve(socket) -> bpy.types.FCurve | None:
    """The F-curve that holds the driver of the socket's value, or None."""
    animation = socket.id_data.animation_data
    return animation.drivers.find(socket.path_from_id("default_value")) if animation else None


def clear_driver(socket):
    """Remove the driver of the socket's value, if it has one; the value stays."""
    if driver_curve(socket) is not None:
        socket.driver_remove("default_value")


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
    if variable.kind == "TRANSFORMS":
        target.id = variable.source
        target.transform_type = variable.channel
        target.transform_space = "WORLD_SPACE"
        target.rotation_mode = ROTATION_ORDER
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
    channel = target.transform_type if entry.type == "TRANSFORMS" else target.data_path
    return Variable(entry.name, entry.type, target.id, channel)
