"""What a preparation takes from a scene's lights, in JSON's types, and what changed in them since."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

import bpy

from ..animation.curves import is_animated
from ..images import image_state
from ..lights.emitters import reason_to_skip as reason_to_skip_mesh
from ..lights.emitters import shines
from ..lights.hints import rendered_layers, rendered_objects
from ..lights.instances import rendered_members
from ..lights.kinds import kind_of
from ..lights.lamps import reason_to_skip
from ..lights.reasons import reason_here
from ..nodes.scene_lights import followed_objects

NODE_SETTINGS = {"location", "location_absolute", "width", "height", "select", "show_options", "show_preview", "hide",
                 "label", "name", "color", "use_custom_color", "parent", "dimensions", "is_active_output"}


def light_facts(scene: bpy.types.Scene) -> dict[str, list[str]]:
    """What shines, by what it is called in sentences: [kind, why it needs no hint or "", all else that matters]."""
    layers = rendered_layers(scene, update=False)
    rendered = rendered_objects(layers)
    radiances: dict[bpy.types.Material, float] = {}
    found: dict[str, list[str]] = {}
    for thing in scene.objects:
        if thing.type == "LIGHT":
            reason = reason_here(thing, thing in rendered, True) or reason_to_skip(thing)
            found[f'Light "{thing.name_full}"'] = [kind_of(thing).words, reason, _linking(thing)]
        elif shines(thing, layers, radiances):
            reason = reason_here(thing, thing in rendered, True) or reason_to_skip_mesh(thing)
            found[f'Emissive object "{thing.name_full}"'] = ["an emissive object", reason, _linking(thing)]
        elif thing.instance_type == "COLLECTION" and thing.instance_collection and not thing.hide_render:
            inner = [each for each in rendered_members(thing.instance_collection)
                     if each.type == "LIGHT" or shines(each, layers, radiances)]
            for each in inner:
                kind = kind_of(each).words if each.type == "LIGHT" else "an emissive object"
                found[f'Light "{each.name_full}" in "{thing.name_full}"'] = [kind, "", _linking(each)]
    for world in dict.fromkeys(layer.world_override or scene.world for layer in layers):
        if world is not None:
            found[f'World "{world.name_full}"'] = ["a world", "", _world(world)]
    return found


def changed_lights(before: dict[str, list[str]], now: dict[str, list[str]]) -> list[str]:
    """Sentences on what shines."""
    sentences = [f"{name} was added." for name in now if name not in before]
    sentences += [f"{name} is gone." for name in before if name not in now]
    for name in now.keys() & before.keys():
        (kind, reason, rest), (old_kind, old_reason, old_rest) = now[name], before[name]
        if kind != old_kind:
            sentences.append(f"{name} is {kind} now, not {old_kind}.")
        elif reason != old_reason:
            sentences.append(f"{name} needs no glints now: {reason}." if reason else f"{name} shines on glints now.")
        elif rest != old_rest:
            sentences.append(f"{name} was changed.")
    return sorted(sentences)


def lost_lights(before: list[int], now: list[int]) -> list[str]:
    """A sentence where sets of lights are gone; before, now: their numbers."""
    return ["What glints look for in this scene was deleted."] if set(before) - set(now) else []


def foreign_lights(scene: bpy.types.Scene) -> list[str]:
    """What is looked for in another scene: this one is a copy of that."""
    own, coming = set(), set(scene.objects)
    while coming:  # objects of instanced collections are shown here too, whatever scene keeps them
        own |= coming
        shown = {thing.instance_collection for thing in coming} - {None}
        coming = {thing for collection in shown for thing in collection.all_objects} - own
    followed = sorted(followed_objects(scene) - own, key=lambda thing: thing.name_full)
    return [f'Glints look for "{thing.name}" of scene "{other.name}".' for thing in followed
            for other in thing.users_scene[:1]]


def _linking(thing: bpy.types.Object) -> str:
    """Which objects light linking lets a light shine on."""
    receivers = thing.light_linking.receiver_collection
    return "" if receivers is None else f"{receivers.name_full}|{len(receivers.all_objects)}"


def _world(world: bpy.types.World) -> str:
    """All of a world's nodes that is not animated, and how Cycles samples it."""
    digest = hashlib.sha256(f"{world.cycles.sampling_method}|{world.cycles_visibility.glossy}".encode())
    _add_tree(digest.update, world.node_tree, set())
    return digest.hexdigest()[:16]


def _add_tree(add: Callable[[bytes], None], tree: bpy.types.NodeTree | None, seen: set[bpy.types.NodeTree]) -> None:
    if tree is None or tree in seen:
        return
    seen.add(tree)
    for link in tree.links:
        add(f"{link.from_node.name}|{link.from_socket.identifier}|{link.to_node.name}|"
            f"{link.to_socket.identifier}|{link.is_muted}".encode())
    for node in tree.nodes:
        add(f"{node.bl_idname}|{node.name}|{_node_values(node)}".encode())
        if getattr(node, "image", None) is not None:
            add(image_state(node.image).encode())
        _add_tree(add, getattr(node, "node_tree", None), seen)


def _node_values(node: bpy.types.Node) -> list[tuple[str, Any]]:
    """Settings and values of a node that neither keys nor drivers move."""
    tree = node.id_data
    values = []
    for setting in node.bl_rna.properties:
        is_plain = setting.type in {"BOOLEAN", "INT", "FLOAT", "ENUM", "STRING"} and not setting.is_readonly
        if is_plain and setting.identifier not in NODE_SETTINGS and not is_animated(
                tree, node.path_from_id(setting.identifier)):
            values.append((setting.identifier, _plain(getattr(node, setting.identifier))))
    for socket in (*node.inputs, *node.outputs):
        if hasattr(socket, "default_value") and not socket.is_linked:
            path = socket.path_from_id("default_value")
            if not any(is_animated(tree, path, index) for index in range(4)):
                values.append((socket.identifier, _plain(socket.default_value)))
    return values


def _plain(value: Any) -> float | str | list[Any]:
    """A setting or value as what is the same in every process; numbers to six digits."""
    if isinstance(value, float):
        return round(value, 6)
    if isinstance(value, set):  # several choices at once, in no order
        return sorted(value)
    if isinstance(value, str) or not hasattr(value, "__len__"):
        return str(value)
    return [round(float(each), 6) for each in value]
