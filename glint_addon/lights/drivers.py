"""Light hints -> numbers of a scene, driven by the light objects, which the node group "Glint Lights" reads.

Every expression is one that Blender evaluates without Python, so the drivers also work where scripts in files are not
run. All lengths are in metres, angles in radians, space is the world.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from mathutils import Matrix

from ..animation.motion import is_fixed
from ..errors import SceneError
from ..nodes.driven import Driven, Keyed, write_number
from ..nodes.glint_lights import KIND_NONE, KIND_SUN, check_nodes, refresh, set_of
from ..nodes.scene_lights import AXIS, HINT_COUNT, LIGHT, REACH, SHAPE, SHIFT, lights_entry, own_holder
from .driven_matrix import DrivenMatrix, object_property
from .hint import Hint, Numbers, Pose
from .kind import Local
from .kinds import kind_of
from .shutter import Way
from .shutter_nodes import read_ways

NO_LIGHT = (0.0, 0.0, 0.0)
EVEN = 1.01  # scales that differ less hardly change a cone


def connect_hints(
    group: bpy.types.ShaderNodeTree, scene: bpy.types.Scene, hints: list[Hint], ways: dict[Hint, Way] | None = None
) -> None:
    """Write `hints`, in their order, to the set of `scene` that the group reads, and clear the slots left over.

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

    if group.library is None:
        refresh(group)
    check_nodes(group)
    number = set_of(group)
    own_holder(scene, number)
    for slot in range(1, HINT_COUNT + 1):
        chosen = hints[slot - 1] if slot <= len(hints) else None
        for part, numbers in _numbers(scene, chosen, ways or {}).items():
            for axis, value in enumerate(numbers):
                write_number(lights_entry(scene, number, slot, part + axis), value)
    if group.library is None:
        read_ways(group)


def _numbers(scene: bpy.types.Scene, hint: Hint | None, ways: dict[Hint, Way]) -> dict[int, Numbers]:
    """The numbers of a light by its parts; zeros for none."""
    if hint is None:
        return dict.fromkeys((LIGHT, SHAPE, AXIS, SHIFT, REACH), NO_LIGHT)
    cone, way = _cone(scene, hint, ways), ways.get(hint)
    return {
        LIGHT: _place(hint),
        SHAPE: (*_shape(hint), cone),
        AXIS: _matrix(hint).z_axis() if cone else NO_LIGHT,
        SHIFT: way.shift if way else NO_LIGHT,
        REACH: way.reach if way else NO_LIGHT,
    }


def _place(hint: Hint) -> Numbers:
    """Direction towards a sun, position of any other light."""
    if hint.live is not None:
        return hint.live[:3]
    if hint.direction is not None:
        return hint.direction
    if _poses(hint):
        places = [pose.place or NO_LIGHT for pose in _poses(hint)]
        return tuple(_over_poses(hint, numbers) for numbers in zip(*places, strict=True))
    if hint.kind == KIND_SUN:
        return _matrix(hint).z_axis()
    return _matrix(hint).point(hint.ball.centre if hint.ball else NO_LIGHT)


def _shape(hint: Hint) -> Numbers:
    """Kind and size; the kind falls to none while the light is off or gone: less work, the same picture."""
    if hint.live is not None:
        return hint.live[3:]
    if hint.direction is not None:
        return hint.kind, hint.size
    if _poses(hint):
        kinds = [hint.kind if pose.place else KIND_NONE for pose in _poses(hint)]
        return _over_poses(hint, kinds), _over_poses(hint, [pose.size for pose in _poses(hint)])
    return _kind(hint), _size(hint)


def _kind(hint: Hint) -> Driven:
    matrix = _matrix(hint)
    # What is read by way of an object is 0 once that is deleted.
    shines, variables = "l33 > 0", []
    if hint.ball is None:
        shines, variables = "energy > 0", [object_property("energy", matrix.object, "data.energy")]
    hidden = [object_property("hidden", matrix.object, "hide_render")]
    if matrix.instancer is not None:
        shines += " and e33 > 0"
        hidden.append(object_property("emptied", matrix.instancer, "hide_render"))
    shown = "".join(f" and {variable.name} < 1" for variable in hidden)
    return matrix.driven(f"{hint.kind} if {shines}{shown} else {KIND_NONE}", *variables, *hidden)


def _size(hint: Hint) -> Driven:
    """Half-angle of a sun, bounding radius of any other light as Cycles shows it."""
    matrix = _matrix(hint)
    if hint.ball is not None:
        return matrix.driven(f"{hint.ball.radius:.7g}*{matrix.largest_scale()}")
    return kind_of(matrix.object).driven_size(matrix)


def _cone(scene: bpy.types.Scene, hint: Hint, ways: dict[Hint, Way]) -> Driven | float:
    """Half-angle of the cone in which the light shines, around its -Z; 0.0 where it shines all around, or no driver can
    tell: a light looked for in vain costs time, never a wrong picture."""
    light = hint.source
    if light is None or light.type != "LIGHT" or _poses(hint):
        return 0.0
    kind = kind_of(light)
    cone = kind.driven_cone(light)
    if cone is None or hint in ways or _may_turn_in_shutter(scene, hint):
        return 0.0
    instancer = hint.instance.instancer if hint.instance else None
    if isinstance(kind, Local) and kind.scales_cone and instancer is not None and not _is_even(instancer.matrix_world):
        return 0.0
    return cone


def _is_even(matrix: Matrix) -> bool:
    """Whether a world matrix scales all axes alike, and so leaves cones as they are."""
    lengths = [matrix.col[axis].to_3d().length for axis in range(3)]
    return max(lengths) <= EVEN * min(lengths)


def _may_turn_in_shutter(scene: bpy.types.Scene, hint: Hint) -> bool:
    """Whether Cycles may turn the light otherwise than drivers do, which turn it as at the frame: lamps stand as in the
    middle of the shutter."""
    if not scene.render.use_motion_blur or scene.render.motion_blur_position == "CENTER":
        return False
    things = [hint.source, hint.instance and hint.instance.instancer]
    return not all(is_fixed(thing, shape=False) for thing in things if thing is not None)


def _matrix(hint: Hint) -> DrivenMatrix:
    return DrivenMatrix(hint.instance.source, hint.instance.instancer) if hint.instance else DrivenMatrix(hint.object)


def _poses(hint: Hint) -> tuple[Pose, ...]:
    return hint.instance.poses if hint.instance else ()


def _over_poses(hint: Hint, numbers: Sequence[float]) -> Keyed | float:
    """Keys at the frames of the hint's poses, or one number where all are the same."""
    if len(set(numbers)) == 1:
        return numbers[0]
    return Keyed(tuple(pose.frame for pose in _poses(hint)), tuple(numbers))
