"""How large one unit of UV is on the objects that show a Glint Scale: measured, kept on them, and what is wrong there.

What linked objects keep belongs to their file, so nothing is written there.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass
from math import isinf

import bpy

from ..lights.hints import rendered_layers
from ..materials.find import held_groups
from ..nodes.scale import follow_uv_map, is_scale_group, metres_property, uv_map_of
from ..seen.uv_size import UvSize, measured, stored_metres
from .uses import Uses

# Sizes vary so much on an object, from one tenth of it to another, that a warning says so.
LARGEST_VARIATION = 2.0
# Relative difference from which on a size counts as another one: nobody sees less, and evaluating a mesh may round.
NOTICED = 0.02
ELSEWHERE = "prepare it in that file, or make it local with Object > Relations > Make Local > All."


@dataclass(frozen=True)
class Place:
    """A UV map that a Glint Scale reads on an object: its size, if it has any, and the object's mean scale."""

    thing: bpy.types.Object
    uv_map: str
    size: UvSize | None
    scale: float

    @property
    def metres(self) -> float:
        """Metres of a unit where the object's scale is 1, as the object keeps them; 0 if that cannot be told."""
        return self.size.metres / self.scale if self.size is not None and self.scale > 0.0 else 0.0

    @property
    def stored(self) -> float | None:
        """The metres that the object keeps, None for none."""
        return stored_metres(self.thing, self.uv_map)

    @property
    def forgets(self) -> bool:
        """Whether the object overrides one of another file that keeps no size: a saved file does not hold it then."""
        override = self.thing.override_library
        return override is not None and stored_metres(override.reference, self.uv_map) is None


def write_sizes(scene: bpy.types.Scene, uses: Uses) -> None:
    """Let every object of `uses` keep the size of its UV maps, where a Glint Scale reads it. Layers must be current."""
    for group in scale_groups(material for pairs in uses.values() for _, material in pairs):
        if group.library is None:
            follow_uv_map(group)
    for place in _places(scene, uses):
        if place.thing.is_editable:
            _write(place)


def write_object_sizes(thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph, material: bpy.types.Material) -> None:
    """Let an object keep the size of the UV maps that the Glint Scales of its new material read."""
    for group in scale_groups([material]):
        _write(Place(thing, uv_map_of(group), *measured(thing, depsgraph, uv_map_of(group))))


def size_warnings(scene: bpy.types.Scene, uses: Uses) -> list[str]:
    """Sentences on objects where a Glint Scale cannot give the map one size. Layers must be current."""
    return sorted(sentence for place in _places(scene, uses) if (sentence := _warning(place)))


def changed_sizes(scene: bpy.types.Scene, uses: Uses, before: Container[str]) -> list[str]:
    """Sentences on objects whose UV maps have another size than the objects keep, of those named in `before`: of others
    it is said that they are new."""
    return sorted(_change(place) for place in _places(scene, uses) if place.thing.is_editable
                  and place.thing.name_full in before and _differ(place.stored or 0.0, place.metres))


def scale_groups(materials: Iterable[bpy.types.Material]) -> set[bpy.types.ShaderNodeTree]:
    """The groups "Glint Scale" that materials hold, at any depth."""
    return {group for material in dict.fromkeys(materials) for group in held_groups(material.node_tree)
            if is_scale_group(group)}


def _places(scene: bpy.types.Scene, uses: Uses) -> Iterator[Place]:
    """Each UV map that a Glint Scale reads on an object of `uses`, once."""
    materials: dict[bpy.types.Object, dict[bpy.types.Material, None]] = {}
    for thing, material in (pair for pairs in uses.values() for pair in pairs):
        materials.setdefault(thing, {})[material] = None
    layers = rendered_layers(scene, update=False)
    known: dict[bpy.types.Material, list[str]] = {}
    for thing, worn in materials.items():
        for material in worn:
            if material not in known:
                known[material] = sorted(map(uv_map_of, scale_groups([material])))
        depsgraph = _depsgraph(thing, layers)
        for uv_map in sorted({name for material in worn for name in known[material]}):
            yield Place(thing, uv_map, *measured(thing, depsgraph, uv_map))


def _depsgraph(thing: bpy.types.Object, layers: list[bpy.types.ViewLayer]) -> bpy.types.Depsgraph:
    """That of the first view layer that evaluates an object, else of the first."""
    graphs = [layer.depsgraph for layer in layers]
    return next((graph for graph in graphs if thing.evaluated_get(graph).is_evaluated), graphs[0])


def _write(place: Place) -> None:
    """Keep a size on its object; where it is unknown nothing is kept, and a unit counts as a metre."""
    thing, name = place.thing, metres_property(place.uv_map)
    if place.metres == 0.0:
        thing.pop(name, None)
    elif thing.get(name) != place.metres:
        thing[name] = place.metres
        # Library overrides of the object may have a size of their own.
        thing.property_overridable_library_set(f'["{name}"]', True)
        thing.update_tag()


def _change(place: Place) -> str:
    name = f'"{place.thing.name_full}"'
    if place.stored is None:
        return f"The UVs of {name} were not measured for its Scale."
    now = f"{place.size.metres:.3g} m" if place.size is not None else "nothing"
    before = f"{place.stored * place.scale:.3g} m"
    return f"The UVs or the shape of {name} changed: one unit of UV covers {now} now, {before} before."


def _warning(place: Place) -> str:
    name, uv_map = f'"{place.thing.name}"', f'UV map "{place.uv_map}"' if place.uv_map else "UV map"
    if place.metres == 0.0:
        return (f"Scale cannot measure {name}, which has no face with an area in its {uv_map}: glints repeat there as "
                "if one unit of UV were one metre; unwrap it (UV > Unwrap) and prepare again.")
    if place.forgets:
        return (f"{name} overrides an object of {place.thing.override_library.reference.library.filepath}, where its "
                f"UVs were not measured: once this file is opened again, Scale does not know their size; {ELSEWHERE}")
    times = place.metres / (place.stored or 1.0)
    if not place.thing.is_editable and _differ(times, 1.0):
        return (f"{name} is linked from {place.thing.library.filepath}, where its UVs were not measured as they are: "
                f"its glints are {times:.2g} times as large as Scale says; {ELSEWHERE}")
    if place.size is None or place.size.variation <= LARGEST_VARIATION:
        return ""
    if isinf(place.size.variation):
        return (f"A tenth of {name} or more has no area in its {uv_map}, so glints are smeared there: unwrap these "
                "faces (UV > Unwrap) and prepare again.")
    return (f"UVs of {name} vary in its {uv_map}: glints are {place.size.variation:.1f} times larger in some places "
            "than in others; unwrap it evenly (UV > Average Islands Scale) and prepare again.")


def _differ(one: float, other: float) -> bool:
    return abs(one - other) > NOTICED * max(abs(one), abs(other))
