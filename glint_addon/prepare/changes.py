"""What a scene was prepared from, and what has changed since: the one place that knows when to prepare again.

A preparation leaves the facts it rests on with the scene, as text: the lights and their kinds, the maps' pixels and how
they are read, settings. The same facts now, compared with these, are sentences. What drivers follow is no fact: lights
that move, turn or grow. Nothing here changes data or is slow, unless a map is painted or packed: its pixels are read.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import bpy

from ..animation.curves import is_animated
from ..bake.float_image import is_whole
from ..errors import GlintError
from ..images import file_digest, image_state
from ..lights.emitters import reason_here as reason_here_mesh
from ..lights.emitters import reason_to_skip as reason_to_skip_mesh
from ..lights.emitters import shines
from ..lights.hints import rendered_objects
from ..lights.instances import rendered_members
from ..lights.lamps import reason_here, reason_to_skip
from ..nodes.glint_bsdf import VERSION, group_binding, map_of
from ..nodes.scene_lights import followed_objects, held_sets
from ..nodes.script_node import osl_available
from ..properties import PREPARED
from .map_tables import remembered_tables
from .uses import glint_uses, render_layers

NOT_PREPARED = "This scene was not prepared yet."
UNREADABLE = "What Glint noted of this scene's preparation is damaged."
OTHER_VERSION = "This scene was prepared by another version of Glint."
# Footprints have a margin for so much more or less resolution (`footprints.MARGIN`).
LARGEST_ZOOM = 2.0
KINDS = {"SUN": "a sun", "POINT": "a point light", "SPOT": "a spot", "AREA": "an area light"}
BINDING_WORDS = ("Interpolation", "Convention", "Distribution", "UV map", "Extension")
NODE_SETTINGS = {"location", "location_absolute", "width", "height", "select", "show_options", "show_preview", "hide",
                 "label", "name", "color", "use_custom_color", "parent", "dimensions", "is_active_output"}


def remember_preparation(scene, states=None):
    """Keep what `scene` is prepared from, at the end of its preparation.

    states: {image: its `image_state`} of those that are known, because painted ones are slow to tell.
    """
    uses = glint_uses(scene, update=False)
    # Copied or moved elsewhere a file is new to the file system, though it holds what it did.
    digests = {map_of(group).name_full: file_digest(map_of(group)) for group in uses}
    text = json.dumps(_facts(scene, uses, states) | {"digests": digests})
    scene[PREPARED] = f"{_digest(text)} {text}"


def changes_since_prepared(scene) -> list[str]:
    """What changed since `scene` was prepared, a sentence each; none where it is prepared or shows no glints.

    Where something changed, glints are as right as ever, but may have the noise of Blender's own nodes: `prepare_scene`
    helps. The view layers' matrices and modifiers must be up to date, as they are in a window.
    """
    uses = glint_uses(scene, update=False)
    if not uses or not hasattr(scene, "cycles"):
        return []
    if scene.library is not None:  # what is said of it must be done in its own file
        return _lost_tables(uses)
    if PREPARED not in scene:
        return [OTHER_VERSION if _has_report(scene) else NOT_PREPARED]
    before, now = _remembered(scene), _facts(scene, uses)
    if before is None:
        return [UNREADABLE]
    if before["version"] != VERSION:
        return [OTHER_VERSION]
    return (_lost_lights(before["sets"], now["sets"]) + _foreign_lights(scene)
            + _changed_lights(before["lights"], now["lights"])
            + _changed_materials(before["materials"], now["materials"], before["digests"])
            + _changed_objects(before["objects"], now["objects"])
            + _changed_settings(before["settings"], now["settings"]) + _lost_tables(uses))


def _remembered(scene) -> dict | None:
    """The facts that `scene` was prepared from; None if they are not as they were written."""
    stored = scene[PREPARED]
    digest, _, text = stored.partition(" ") if isinstance(stored, str) else ("", "", "")
    return json.loads(text) if text and digest == _digest(text) else None


def _has_report(scene) -> bool:
    """Whether the panel shows what a preparation found: before version 10 these left nothing else."""
    state = getattr(scene, "glint", None)
    return state is not None and state.prepared and any((state.hints, state.skipped_lights, state.tables))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _facts(scene, uses, states=None) -> dict:
    """What a preparation rests on, in JSON's types; states as for `remember_preparation`."""
    objects = {}
    for pairs in uses.values():
        for thing, material in pairs:
            objects.setdefault(thing.name_full, set()).add(material.name_full)
    return {
        "version": VERSION,
        "lights": _lights(scene),
        "sets": held_sets(scene),
        "materials": _materials(uses, dict(states or {})),
        "objects": {name: sorted(materials) for name, materials in objects.items()},
        "settings": _settings(scene),
    }


# --- lights ---


def _lights(scene) -> dict[str, list[str]]:
    """What shines, by what it is called in sentences: [kind, why it needs no hint or "", all else that matters]."""
    layers = render_layers(scene)
    rendered, radiances, found = rendered_objects(layers), {}, {}
    for thing in scene.objects:
        if thing.type == "LIGHT":
            reason = reason_here(thing, thing in rendered, True) or reason_to_skip(thing)
            found[f'Light "{thing.name_full}"'] = [KINDS[thing.data.type], reason, _linking(thing)]
        elif shines(thing, layers, radiances):
            reason = reason_here_mesh(thing, thing in rendered, True) or reason_to_skip_mesh(thing)
            found[f'Emissive object "{thing.name_full}"'] = ["an emissive object", reason, _linking(thing)]
        elif thing.instance_type == "COLLECTION" and thing.instance_collection and not thing.hide_render:
            inner = [each for each in rendered_members(thing.instance_collection)
                     if each.type == "LIGHT" or shines(each, layers, radiances)]
            for each in inner:
                kind = KINDS[each.data.type] if each.type == "LIGHT" else "an emissive object"
                found[f'Light "{each.name_full}" in "{thing.name_full}"'] = [kind, "", _linking(each)]
    for world in dict.fromkeys(layer.world_override or scene.world for layer in layers):
        if world is not None:
            found[f'World "{world.name_full}"'] = ["a world", "", _world(world)]
    return found


def _linking(thing) -> str:
    """Which objects light linking lets a light shine on."""
    receivers = thing.light_linking.receiver_collection
    return "" if receivers is None else f"{receivers.name_full}|{len(receivers.all_objects)}"


def _world(world) -> str:
    """All of a world's nodes that is not animated, and how Cycles samples it."""
    digest = hashlib.sha256(f"{world.cycles.sampling_method}|{world.cycles_visibility.glossy}".encode())
    _add_tree(digest, world, world.node_tree, set())
    return digest.hexdigest()[:16]


def _add_tree(digest, owner, tree, seen: set):
    if tree is None or tree in seen:
        return
    seen.add(tree)
    for link in tree.links:
        digest.update(f"{link.from_node.name}|{link.from_socket.identifier}|{link.to_node.name}|"
                      f"{link.to_socket.identifier}|{link.is_muted}".encode())
    for node in tree.nodes:
        digest.update(f"{node.bl_idname}|{node.name}|{_node_values(node)}".encode())
        if getattr(node, "image", None) is not None:
            digest.update(image_state(node.image).encode())
        _add_tree(digest, owner, getattr(node, "node_tree", None), seen)


def _node_values(node) -> list:
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


def _plain(value):
    """A setting or value as what is the same in every process; numbers to six digits."""
    if isinstance(value, float):
        return round(value, 6)
    if isinstance(value, set):  # several choices at once, in no order
        return sorted(value)
    if isinstance(value, str) or not hasattr(value, "__len__"):
        return str(value)
    return [round(float(each), 6) for each in value]


def _changed_lights(before, now) -> list[str]:
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


def _lost_lights(before, now) -> list[str]:
    return ["What glints look for in this scene was deleted."] if set(before) - set(now) else []


def _foreign_lights(scene) -> list[str]:
    """What is looked for in another scene: this one is a copy of that."""
    own, coming = set(), set(scene.objects)
    while coming:  # objects of instanced collections are shown here too, whatever scene keeps them
        own |= coming
        shown = {thing.instance_collection for thing in coming} - {None}
        coming = {thing for collection in shown for thing in collection.all_objects} - own
    followed = sorted(followed_objects(scene) - own, key=lambda thing: thing.name_full)
    return [f'Glints look for "{thing.name}" of scene "{other.name}".' for thing in followed
            for other in thing.users_scene[:1]]


# --- materials ---


def _materials(uses, states) -> dict[str, list]:
    """Of each material its groups: [name of the map, its state, how it is read..., roughness and strength]; where it
    cannot be read, the first word of five says why, and the others are empty."""
    found = {}
    for group, pairs in uses.items():
        for material in dict.fromkeys(material for _, material in pairs):
            found.setdefault(material.name_full, []).append(_group(group, states) + [_values(material, group)])
    return {name: sorted(groups) for name, groups in found.items()}


def _group(group, states) -> list[str]:
    image = map_of(group)
    if image not in states:
        states[image] = image_state(image)
    try:
        binding = group_binding(group)
    except GlintError as error:
        return [image.name_full, states[image], str(error), "", "", "", ""]
    return [image.name_full, states[image], binding.interpolation, binding.convention, binding.distribution,
            binding.uv_map, binding.extension]


def _changed_pixels(name, state) -> str:
    return f'The pixels of the map "{name}" changed.' if state else f'The file of the map "{name}" is gone.'


def _values(material, group) -> str:
    """Values that say which lights facets can mirror, to two digits, of the nodes that the material itself holds."""
    nodes = [node for node in material.node_tree.nodes if getattr(node, "node_tree", None) == group]
    if material.node_tree.animation_data is not None:
        return ""
    sockets = [node.inputs[name] for node in nodes for name in ("Roughness", "Strength") if name in node.inputs]
    return " ".join("" if socket.is_linked else f"{socket.default_value:.2g}" for socket in sockets)


def _changed_materials(before, now, digests) -> list[str]:
    sentences = [f'Material "{name}" shows glints now.' for name in now if name not in before]
    for name in sorted(now.keys() & before.keys()):
        if len(now[name]) != len(before[name]):
            sentences.append(f'Material "{name}" has {len(now[name])} Glint BSDFs now, not {len(before[name])}.')
            continue
        for one, other in zip(now[name], before[name], strict=True):
            sentences += _changed_group(name, one, other, digests)
    return sorted(dict.fromkeys(sentences))


def _changed_group(name, now, before, digests) -> list[str]:
    image, state, *reading, values = now
    old_image, old_state, *old_reading, old_values = before
    if image != old_image:
        return [f'Material "{name}" reads the map "{image}" now, not "{old_image}".']
    is_same = state == old_state or digests[image] != "" and _digest_now(image) == digests[image]
    sentences = [] if is_same else [_changed_pixels(image, state)]
    if reading != old_reading and not all(any(words[1:]) for words in (reading, old_reading)):
        return [*sentences, f'The map of "{name}" can be read again.' if any(reading[1:]) else reading[0]]
    for word, new, old in zip(BINDING_WORDS, reading, old_reading, strict=True):
        if new != old:
            sentences.append(f'{word} of the map of "{name}" is {new or "the active one"} now, not '
                             f'{old or "the active one"}.')
    if values != old_values:
        sentences.append(f'Roughness or Strength of "{name}" changed.')
    return sentences


def _digest_now(image: str) -> str:
    return next((file_digest(each) for each in bpy.data.images if each.name_full == image), "")


def _changed_objects(before, now) -> list[str]:
    """Objects whose footprints and lights nobody has judged; what no longer shows glints does no harm."""
    return sorted(f'Object "{name}" shows glints now.' for name in now
                  if name not in before or set(now[name]) - set(before[name]))


def _lost_tables(uses) -> list[str]:
    """Tables that are not there, or not as they were written: of linked groups too, which cannot be prepared here."""
    if not osl_available():
        return []
    sentences = []
    for group in sorted(uses, key=lambda group: group.name_full):
        tables = remembered_tables(group)
        name = map_of(group).name
        if not all(table.is_file() for table in tables):
            sentences.append(f'Tables of the map "{name}" are gone from {_folder(tables)}.')
        elif not all(map(is_whole, tables)):
            sentences.append(f'Tables of the map "{name}" are damaged.')
    return list(dict.fromkeys(sentences))


def table_states(scene) -> dict[Path, str]:
    """The files of the scene's tables, and what is wrong with each: "", "gone" or "damaged"."""
    tables = sorted({table for group in glint_uses(scene, update=False) for table in remembered_tables(group)})
    return {table: "" if is_whole(table) else "damaged" if table.is_file() else "gone" for table in tables}


def _folder(tables) -> str:
    return next(str(table.parent) for table in tables if not table.is_file())


# --- settings ---


def _settings(scene) -> dict:
    """What a preparation takes from the scene's settings, by the words for it."""
    render, cycles, layers = scene.render, scene.cycles, render_layers(scene)
    limits = "no limit"
    if render.use_simplify:
        limits = f"{cycles.texture_limit_render} at {cycles.texture_resolution_render:g}"
        limits = "no limit" if limits == "OFF at 1" else limits
    overrides = sorted({layer.material_override.name_full for layer in layers if layer.material_override})
    cameras = sorted(thing.name_full for thing in scene.objects if thing.type == "CAMERA")
    blur = f"{render.motion_blur_shutter:g} {render.motion_blur_position}" if render.use_motion_blur else "off"
    return {
        "Render Engine": render.engine,
        "Device": cycles.device,
        "Open Shading Language": "on" if cycles.shading_system else "off",
        "The texture limit of Simplify": limits,
        "View layers": ", ".join(layer.name for layer in layers),
        "The material override": ", ".join(overrides) or "none",
        "Cameras": ", ".join(cameras) or "none",
        "The frame range": f"{scene.frame_start} to {scene.frame_end}",
        "Motion blur": blur,
        "Pixels of the picture": _pixels(render),
    }


def _pixels(render) -> int:
    return render.resolution_x * render.resolution_y * render.resolution_percentage**2 // 10000


def _changed_settings(before, now) -> list[str]:
    sentences = []
    for name, new in now.items():
        old = before.get(name)
        if isinstance(new, int) and isinstance(old, int):
            if max(new, old) <= LARGEST_ZOOM**2 * max(min(new, old), 1):
                continue
        elif new == old:
            continue
        sentences.append(f"{name}: {new} now, {old} before.")
    return sentences
