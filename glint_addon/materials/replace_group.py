"""Give a Glint BSDF node another group, which may have other sockets."""

from __future__ import annotations

from ..nodes.surface_kinds import KINDS, surface_of


def replace_group(node, group) -> None:
    """Let `node` use another Glint BSDF group: sockets of the same name keep their value and link, the colour of one
    kind of surface becomes that of the other, and new sockets have their defaults."""
    before, after = (KINDS[surface_of(each)].color for each in (node.node_tree, group))
    if [socket.name for socket in node.inputs] == [item.name for item in _inputs(group)]:
        node.node_tree = group  # Blender keeps what belongs to the sockets of the same place
        return
    renamed = {before.name: after.name} if before is not None and after is not None else {}
    kept = {renamed.get(socket.name, socket.name): _state(socket) for socket in node.inputs}
    tree = node.id_data
    for link in [link for socket in node.inputs for link in socket.links]:
        tree.links.remove(link)
    node.node_tree = group
    for socket, item in zip(node.inputs, _inputs(group), strict=True):
        kind, value, source = kept.get(socket.name, ("", None, None))
        if kind != socket.bl_idname:
            value, source = getattr(item, "default_value", None), None
        if value is not None:
            socket.default_value = value
        if source is not None:
            tree.links.new(source, socket)


def _inputs(group) -> list:
    return [item for item in group.interface.items_tree if item.item_type == "SOCKET" and item.in_out == "INPUT"]


def _state(socket) -> tuple:
    """(type, value or None, socket that is linked to it or None)."""
    value = getattr(socket, "default_value", None)
    value = value[:] if hasattr(value, "__len__") else value
    return socket.bl_idname, value, socket.links[0].from_socket if socket.is_linked else None
