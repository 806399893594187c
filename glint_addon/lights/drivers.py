"""Light hints -> numbers of the node group "Glint Lights", driven by the light objects.

Every expression is one that Blender evaluates without Python, so the drivers also work where scripts in files are not
run. All lengths are in metres, angles in radians, space is the world.
"""

from __future__ import annotations

from ..errors import SceneError
from ..nodes.driven import Driven, Variable, write_number
from ..nodes.glint_lights import HINT_COUNT, KIND_SUN, light_name, shape_name
from .hint import Hint

AXES = ("X", "Y", "Z")
NO_LIGHT = (0.0, 0.0, 0.0)

# Half the diagonal of a rectangle, half the longest axis of an ellipse. Cycles scales both by the lengths of the
# object's world axes (`AreaLight::copy_to_kernel`); under shear the diagonal is longer, by a factor of sqrt(2) at most.
AREA_RADIUS = {
    "SQUARE": "0.5 * width * sqrt(sx * sx + sy * sy)",
    "RECTANGLE": "0.5 * sqrt(width * width * sx * sx + height * height * sy * sy)",
    "DISK": "0.5 * width * max(sx, sy)",
    "ELLIPSE": "0.5 * max(width * sx, height * sy)",
}


def connect_hints(group, scene, hints: list[Hint]) -> None:
    """Drive the group's lights by `hints` in their order and clear the slots left over.

    What is already as wanted is not touched, so a second call changes nothing.
    Raises SceneError if there are too many hints, or one's object is not in `scene`, or the group lacks a node.
    """
    if len(hints) > HINT_COUNT:
        raise SceneError(f"{len(hints)} lights do not fit the {HINT_COUNT} slots: let Glint choose the lights.")
    present = set(scene.objects)
    for hint in hints:
        if hint.object is not None and hint.object not in present:
            raise SceneError(f'Light "{hint.name}" is not in scene "{scene.name}": prepare the scene again.')

    for slot in range(1, HINT_COUNT + 1):
        hint = hints[slot - 1] if slot <= len(hints) else None
        _write_vector(group, light_name(slot), _place(hint) if hint else NO_LIGHT)
        _write_vector(group, shape_name(slot), _shape(hint) if hint else NO_LIGHT)


def disconnect(group) -> None:
    """Clear every light of the group; the sample count stays driven. Raises SceneError if the group lacks a node."""
    for slot in range(1, HINT_COUNT + 1):
        _write_vector(group, light_name(slot), NO_LIGHT)
        _write_vector(group, shape_name(slot), NO_LIGHT)


def _write_vector(group, node_name, numbers):
    node = group.nodes.get(node_name)
    if node is None:
        raise SceneError(f'Node group "{group.name}" has lost its node "{node_name}": delete the group, prepare again.')
    for axis, number in zip(AXES, numbers, strict=True):
        write_number(node.inputs[axis], number)


def _place(hint):
    """Direction towards a sun, position of any other light."""
    if hint.direction is not None:
        return hint.direction
    if hint.kind == KIND_SUN:
        return sun_direction(hint.object)
    return tuple(Driven("x", (_transform("x", hint.object, f"LOC_{axis}"),)) for axis in AXES)


def sun_direction(lamp) -> tuple[Driven, Driven, Driven]:
    """Unit vector towards the sun `lamp`: its world Z axis (its light travels along -Z).

    In the Euler order ZYX the object's matrix is Rx Ry Rz, whose Z column has no Rz. Blender finds the two other angles
    from the normalized Z column alone, so the result is that column for any parents, constraints, shear and mirroring.
    """
    rx, ry = _transform("rx", lamp, "ROT_X"), _transform("ry", lamp, "ROT_Y")
    return (
        Driven("sin(ry)", (ry,)),
        Driven("-sin(rx) * cos(ry)", (rx, ry)),
        Driven("cos(rx) * cos(ry)", (rx, ry)),
    )


def _shape(hint):
    """Kind and size; the kind falls to none while the light is off or gone: less work, the same picture."""
    if hint.object is None:
        return (hint.kind, hint.size, 0.0)
    energy, hidden = _property("energy", hint.object, "data.energy"), _property("hidden", hint.object, "hide_render")
    kind = Driven(f"{hint.kind} if energy > 0 and hidden < 1 else 0", (energy, hidden))
    return (kind, _size(hint.object), 0.0)


def _size(lamp) -> Driven:
    """Half-angle of a sun, bounding radius of any other light as Cycles shows it.

    Cycles ignores the object's scale for suns, points and spots.
    """
    light = lamp.data
    if light.type == "SUN":
        return Driven("angle / 2", (_property("angle", lamp, "data.angle"),))
    if light.type != "AREA":
        return Driven("radius", (_property("radius", lamp, "data.shadow_soft_size"),))
    variables = (
        _property("width", lamp, "data.size"),
        _property("height", lamp, "data.size_y"),
        _transform("sx", lamp, "SCALE_X"),
        _transform("sy", lamp, "SCALE_Y"),
    )
    expression = AREA_RADIUS[light.shape]
    return Driven(expression, tuple(variable for variable in variables if variable.name in expression))


def _transform(name, lamp, channel):
    return Variable(name, "TRANSFORMS", lamp, channel)


def _property(name, lamp, path):
    """A property of the object or its light, by way of the object: it reads 0 once the object is deleted."""
    return Variable(name, "SINGLE_PROP", lamp, path)
