"""The lights of a scene, as numbers that its glint materials read while it is rendered.

Each scene points to its own data-block, which keeps an array of numbers for each set of lights: drivers that
follow the light objects write them (see `lights.drivers`), and the groups "Glint Lights" read them from whatever scene
is being rendered. The data-block is a node group that no material holds. The numbers must not be properties of the
scene itself: objects whose drivers read a property of the scene would wait for the lights, and the lights for them.
"""

from __future__ import annotations

import bpy

from ..properties import HOLDER, LIGHTS_KEY
from .driven import VALUE, Driven, Entry, Variable, clear_driver, driver_curve, number_at, write_number

HINT_COUNT = 8  # all hints share the closures of a lobe: 8 leave each of them three

# Where the three numbers of a light's parts begin: see the group "Glint Lights", and `lights.shutter_nodes`.
LIGHT, SHAPE, AXIS, SHIFT, REACH = range(0, 15, 3)
PARTS = 15  # numbers of a light


def context_number(number: int, slot: int, part: int) -> Driven:
    """What the scene being rendered holds of light `slot` (1 to HINT_COUNT) in set `number`; 0 where it has none."""
    path = f'["{HOLDER}"]["{_key(number)}"][{_index(slot, part)}]'
    return Driven("v", (Variable("v", "CONTEXT_PROP", "ACTIVE_SCENE", path, otherwise=0.0),))


def lights_entry(scene, number: int, slot: int, part: int) -> Entry:
    """Where `scene` keeps that number; `own_holder` must have been called."""
    return Entry(scene[HOLDER], _key(number), _index(slot, part))


def own_holder(scene, number: int):
    """Give `scene` a place for set `number`. A copy of a scene, which shares that scene's data-block, gets its own."""
    holder = holder_of(scene)
    if holder is None or holder.library is not None or _is_shared(holder, scene):
        name = f".Glint Lights of {scene.name}"
        # All sets: the scene's other materials, or those of the other scene, still read them.
        own = bpy.data.node_groups.new(name, "ShaderNodeTree") if holder is None else holder.copy()
        own.name = name
        scene[HOLDER] = holder = own
    if _numbers(holder, number) is None:
        holder[_key(number)] = [0.0] * (HINT_COUNT * PARTS)
        # Drivers that looked for the array in vain look again only when Blender orders all drivers anew.
        first = Entry(holder, _key(number), 0)
        first.driver_add(VALUE)
        clear_driver(first)


def holder_of(scene) -> bpy.types.NodeTree | None:
    """The data-block with the lights of `scene`, None where it has none, or the property holds something else."""
    holder = scene.get(HOLDER)
    return holder if isinstance(holder, bpy.types.NodeTree) else None


def is_used(number: int, slot: int, part: int) -> bool:
    """Whether light `slot` of set `number` has anything but zeros in that part, in any scene of the file."""
    first = _index(slot, part)
    return any(_has_numbers(scene[HOLDER], number, range(first, first + 3)) for scene in bpy.data.scenes
               if holder_of(scene) is not None)


def has_set(scene, number: int) -> bool:
    """Whether `scene` has lights, or a place for them, in set `number`."""
    holder = holder_of(scene)
    return holder is not None and _numbers(holder, number) is not None


def held_sets(scene) -> list[int]:
    """Numbers of the sets that `scene` has lights, or places for them, in."""
    holder = holder_of(scene)
    keys = holder.keys() if holder is not None else ()
    numbers = (key.removeprefix(LIGHTS_KEY) for key in keys if key.startswith(LIGHTS_KEY))
    return sorted(int(number) for number in numbers if number.isdecimal() and has_set(scene, int(number)))


def copy_set(scene, number: int, to: int):
    """Let set `to` of `scene` hold what set `number` does."""
    own_holder(scene, to)
    for index in range(HINT_COUNT * PARTS):
        place = Entry(scene[HOLDER], _key(number), index)
        write_number(Entry(scene[HOLDER], _key(to), index), number_at(place))


def drop_other_sets(scene, kept: set[int]):
    """Remove the sets of `scene` whose numbers are not in `kept`, but for those of a data-block of another scene."""
    holder = holder_of(scene)
    if holder is None or holder.library is not None or _is_shared(holder, scene):
        return
    for key in [key for key in holder.keys() if key.startswith(LIGHTS_KEY)]:  # noqa: SIM118  (a data-block is no dict)
        if key not in {_key(number) for number in kept}:
            for index in range(HINT_COUNT * PARTS):
                clear_driver(Entry(holder, key, index))
            del holder[key]


def followed_objects(scene) -> set:
    """The objects that the drivers of the scene's lights read."""
    holder = holder_of(scene)
    animation = holder.animation_data if holder is not None else None
    curves = animation.drivers if animation is not None else ()
    targets = (target for curve in curves for variable in curve.driver.variables for target in variable.targets)
    return {target.id for target in targets if target.id is not None}


def _has_numbers(holder, number, indices) -> bool:
    numbers, key = _numbers(holder, number), _key(number)
    if numbers is None:
        return False
    return any(numbers[index] != 0 or driver_curve(Entry(holder, key, index)) is not None for index in indices)


def _numbers(holder, number):
    """The array of set `number`, None where there is none, or something else in its place."""
    numbers = holder.get(_key(number))
    is_array = getattr(numbers, "typecode", "") == "d" and len(numbers) == HINT_COUNT * PARTS
    return numbers if is_array else None


def _is_shared(holder, scene) -> bool:
    return any(other != scene and other.get(HOLDER) == holder for other in bpy.data.scenes)


def _key(number):
    return f"{LIGHTS_KEY}{number}"


def _index(slot, part):
    return (slot - 1) * PARTS + part
