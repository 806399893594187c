"""Where a scene shows glints: its Glint BSDF groups, and the objects and materials that hold them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from ..animation.curves import is_animated
from ..errors import SceneError
from ..lights.hints import rendered_layers, rendered_objects
from ..materials.find import glint_groups
from ..materials.worn import hidden_materials, worn_materials
from ..nodes.map_binding import image_read, map_of

# Of each Glint BSDF group the objects that show it, each with the material that holds it.
Uses = dict[bpy.types.ShaderNodeTree, list[tuple[bpy.types.Object, bpy.types.Material]]]


def glint_uses(scene: bpy.types.Scene, *, update: bool = True) -> Uses:
    """{group: [(object, material), ...]} of each Glint BSDF group with a map that `scene` renders, with what shows it.

    update: bring the view layers up to date first.
    """
    uses: Uses = {}
    layers = rendered_layers(scene, update=update)
    # A view layer's material override stands in for every object's own material.
    overrides = [layer.material_override for layer in layers if layer.material_override is not None]
    known: dict[bpy.types.Material, list[bpy.types.ShaderNodeTree]] = {}
    for thing in _rendered(rendered_objects(layers), set()):
        for material in worn_materials(thing, layers) + overrides:
            if material not in known:
                known[material] = glint_groups(material)
            for group in known[material]:
                uses.setdefault(group, []).append((thing, material))
    return uses


def regrouped(uses: Uses) -> Uses:
    """`uses` of a scene whose materials hold other groups since, without looking for its objects again."""
    found: Uses = {}
    known: dict[bpy.types.Material, list[bpy.types.ShaderNodeTree]] = {}
    for pair in dict.fromkeys(pair for pairs in uses.values() for pair in pairs):
        material = pair[1]
        if material not in known:
            known[material] = glint_groups(material)
        for group in known[material]:
            found.setdefault(group, []).append(pair)
    return found


def shown_map(group: bpy.types.ShaderNodeTree) -> bpy.types.Image:
    """The normal map of a group that `glint_uses` found, for each of these has one. Raises SceneError if it is gone."""
    return _there(map_of(group), group)


def image_of_pixels(group: bpy.types.ShaderNodeTree) -> bpy.types.Image:
    """The image that such a group reads: its map, or the copy of that which is read as data. Raises as `shown_map`."""
    return _there(image_read(group), group)


def _there(image: bpy.types.Image | None, group: bpy.types.ShaderNodeTree) -> bpy.types.Image:
    if image is None:
        raise SceneError(f'Node group "{group.name}" has no normal map: choose one in the group, and prepare again.')
    return image


def unknown_materials(scene: bpy.types.Scene) -> list[str]:
    """Names of the rendered objects that may show glints which cannot be found: geometry nodes set them, in renders
    alone."""
    layers = rendered_layers(scene, update=False)
    hidden = hidden_materials(_rendered(rendered_objects(layers), set()), layers)
    return sorted(thing.name for thing, materials in hidden.items() if any(map(glint_groups, materials)))


def _rendered(objects: Iterable[bpy.types.Object], seen: set[bpy.types.Collection]) -> Iterator[bpy.types.Object]:
    """Those of `objects` that are rendered, and those that collection instances among them show."""
    for thing in objects:
        if thing.hide_render and not is_animated(thing, "hide_render"):
            continue
        yield thing
        shown = thing.instance_collection if thing.instance_type == "COLLECTION" else None
        if shown is not None and shown not in seen:
            seen.add(shown)
            yield from _rendered(shown.all_objects, seen)
