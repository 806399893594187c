"""Light hints -> numbers of the node group "Glint Lights", driven by the light objects.

Every expression is one that Blender evaluates without Python, so the drivers also work where scripts in files are not
run. All lengths are in metres, angles in radians, space is the world.
"""

from __future__ import annotations

from ..errors import SceneError
from ..nodes.driven import Driven, Keyed, Variable, write_number
from ..nodes.glint_lights import HINT_COUNT, KIND_NONE, KIND_SUN, light_name, shape_name
from .frames import Frame
from .hint import Hint
from .shutter_nodes import write_ways

AXES = ("X", "Y", "Z")
NO_LIGHT = (0.0, 0.0, 0.0)

# Half the diagonal of a rectangle, half the longest axis of an ellipse, from the squared lengths of the axes. Cycles
# scales both by the lengths of the object's world axes (`AreaLight::copy_to_kernel`); under shear the diagonal is
# longer, by a factor of sqrt(2) at most.
AREA_RADIUS = {
    "SQUARE": "0.5*width*sqrt({x}+{y})",
    "RECTANGLE": "0.5*sqrt(width*width*({x})+height*height*({y}))",
    "DISK": "0.5*width*sqrt(max({x},{y}))",
    "ELLIPSE": "0.5*sqrt(max(width*width*({x}),height*height*({y})))",
}


def connect_hints(group, scene, hints: list[Hint], ways: dict | None = None) -> None:
    """Drive the group's lights by `hints` in their order and clear the slots left over.

    ways: {hint: `shutter.Way`} of those that move while the shutter is open.

    What is already as wanted is not touched, so a second call changes nothing.
    Raises SceneError if there are too many hints, or one's object is not in `scene`, or the group lacks a node.
    """
    if len(hints) > HINT_COUNT:
        raise SceneError(f"{len(hints)} lights do not fit the {HINT_COUNT} slots: let Glint choose the lights.")
    present = set(scene.objects) | {None}
    for hint in hints:
        if hint.object not in present or hint.instance is not None and hint.instance.instancer not in present:
            raise SceneError(f'Light "{hint.name}" is not in scene "{scene.name}": prepare the scene again.')

    for slot in range(1, HINT_COUNT + 1):
        hint = hints[slot - 1] if slot <= len(hints) else None
        _write_vector(group, light_name(slot), _place(hint) if hint else NO_LIGHT)
        _write_vector(group, shape_name(slot), _shape(hint) if hint else NO_LIGHT)
    write_ways(group, [(ways or {}).get(hint) for hint in hints])


def disconnect(group) -> None:
    """Clear every light of the group; the sample count stays driven. Raises SceneError if the group lacks a node."""
    for slot in range(1, HINT_COUNT + 1):
        _write_vector(group, light_name(slot), NO_LIGHT)
        _write_vector(group, shape_name(slot), NO_LIGHT)
    write_ways(group, [])


def _write_vector(group, node_name, numbers):
    node = group.nodes.get(node_name)
    if node is None:
        raise SceneError(f'Node group "{group.name}" has lost its node "{node_name}": delete the group, prepare again.')
    for axis, number in zip(AXES, numbers, strict=True):
        write_number(node.inputs[axis], number)


def _place(hint):
    """Direction towards a sun, position of any other light."""
    if hint.live is not None:
        return hint.live[:3]
    if hint.direction is not None:
        return hint.direction
    if _poses(hint):
        places = [pose.place or NO_LIGHT for pose in _poses(hint)]
        return tuple(_over_poses(hint, numbers) for numbers in zip(*places, strict=True))
    if hint.kind == KIND_SUN:
        return _frame(hint).z_axis()
    return _frame(hint).point(hint.ball.centre if hint.ball else NO_LIGHT)


def _shape(hint):
    """Kind and size; the kind falls to none while the light is off or gone: less work, the same picture."""
    if hint.live is not None:
        return (*hint.live[3:], 0.0)
    if hint.direction is not None:
        return (hint.kind, hint.size, 0.0)
    if _poses(hint):
        kinds = [hint.kind if pose.place else KIND_NONE for pose in _poses(hint)]
        return (_over_poses(hint, kinds), _over_poses(hint, [pose.size for pose in _poses(hint)]), 0.0)
    return (_kind(hint), _size(hint), 0.0)


def _kind(hint) -> Driven:
    frame = _frame(hint)
    # What is read by way of an object is 0 once that is deleted.
    shines, variables = "l33 > 0", []
    if hint.ball is None:
        shines, variables = "energy > 0", [_property("energy", frame.object, "data.energy")]
    hidden = [_property("hidden", frame.object, "hide_render")]
    if frame.instancer is not None:
        shines += " and e33 > 0"
        hidden.append(_property("emptied", frame.instancer, "hide_render"))
    shown = "".join(f" and {variable.name} < 1" for variable in hidden)
    return frame.driven(f"{hint.kind} if {shines}{shown} else {KIND_NONE}", *variables, *hidden)


def _size(hint) -> Driven:
    """Half-angle of a sun, bounding radius of any other light as Cycles shows it.

    Cycles ignores the object's scale for suns, points and spots.
    """
    frame = _frame(hint)
    if hint.ball is not None:
        return frame.driven(f"{hint.ball.radius:.7g}*{frame.largest_scale()}")
    lamp = frame.object
    if lamp.data.type == "SUN":
        return Driven("angle / 2", (_property("angle", lamp, "data.angle"),))
    if lamp.data.type != "AREA":
        return Driven("radius", (_property("radius", lamp, "data.shadow_soft_size"),))
    expression = AREA_RADIUS[lamp.data.shape].format(x=frame.squared_length(0), y=frame.squared_length(1))
    sides = (_property("width", lamp, "data.size"), _property("height", lamp, "data.size_y"))
    return frame.driven(expression, *(side for side in sides if side.name in expression))


def _frame(hint) -> Frame:
    return Frame(hint.instance.source, hint.instance.instancer) if hint.instance else Frame(hint.object)


def _poses(hint):
    return hint.instance.poses if hint.instance else ()


def _over_poses(hint, numbers):
    """Keys at the frames of the hint's poses, or one number where all are the same."""
    if len(set(numbers)) == 1:
        return numbers[0]
    return Keyed(tuple(pose.frame for pose in _poses(hint)), tuple(numbers))


def _property(name, thing, path):
    """A property of an object or its light, by way of the object."""
    return Variable(name, "SINGLE_PROP", thing, path)
