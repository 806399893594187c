"""How densely a material lays a map on a surface: texels per metre, by the links of its nodes and the mesh's UV map."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Euler

from ..materials.find import held_groups
from ..nodes.glint_bsdf import VECTOR

# Part of a surface that is ignored at either end of its densities: slivers, and the poles of a sphere's UV map.
OUTERMOST_AREA = 0.01
# Largest factor by which a surface seen at an angle lengthens a footprint: 1 / cosine of 60 degrees. Steeper views are
# a quarter of the picture of a ball, and the margin of the footprint range covers them up to 75 degrees.
LARGEST_STRETCH = 2.0


def uv_transforms(material: bpy.types.Material, group: bpy.types.ShaderNodeTree) -> list[tuple[str, np.ndarray]] | None:
    """How `material` places the map of `group`: [(name of the UV map, (2, 2) matrix, UVs to map coordinates), ...].

    "" is the UV map that is active for rendering. None where the nodes do not say: other coordinates, animated nodes or
    nodes of other kinds, a group inside another group.
    """
    tree = material.node_tree
    if tree.animation_data is not None or tree.library is not None:
        return None
    found = []
    for node in tree.nodes:
        if node.bl_idname != "ShaderNodeGroup" or node.node_tree is None:
            continue
        if node.node_tree == group:
            socket = node.inputs.get(VECTOR.name)
            if socket is None:
                return None
            # An input without a link reads the active UV map, as of every texture.
            placed = _uv_transform(socket) if socket.is_linked else ("", np.eye(2))
            if placed is None:
                return None
            found.append(placed)
        elif group in held_groups(node.node_tree):
            return None
    return found or None


def _uv_transform(socket: bpy.types.NodeSocket) -> tuple[str, np.ndarray] | None:
    """The UV map and the matrix that end at a Vector input, through Reroute and Mapping nodes; else None."""
    matrix = np.eye(3)
    while len(socket.links) == 1:
        link = socket.links[0]
        node = link.from_node
        if node.mute or link.is_muted:
            return None
        if node.bl_idname == "ShaderNodeUVMap" and not node.from_instancer:
            return node.uv_map, matrix[:2, :2]
        if node.bl_idname == "ShaderNodeTexCoord" and link.from_socket.name == "UV" and not node.from_instancer:
            return "", matrix[:2, :2]
        if node.bl_idname == "NodeReroute":
            socket = node.inputs[0]
            continue
        own = _mapping_matrix(node) if node.bl_idname == "ShaderNodeMapping" else None
        if own is None:
            return None
        matrix = matrix @ own
        socket = node.inputs["Vector"]
    return None


def _mapping_matrix(node: bpy.types.Node) -> np.ndarray | None:
    """The linear part (3, 3) of a Mapping node whose values are fixed, else None."""
    if node.vector_type == "NORMAL" or any(node.inputs[name].is_linked for name in ("Location", "Rotation", "Scale")):
        return None
    rotation = np.array(Euler(node.inputs["Rotation"].default_value).to_matrix())
    scale = np.array(node.inputs["Scale"].default_value)
    if node.vector_type != "TEXTURE":
        return rotation * scale
    # A texture's mapping is the inverse transform; Cycles returns 0 for a division by zero.
    return np.divide(1.0, scale, out=np.zeros(3), where=scale != 0)[:, None] * rotation.T


def texel_densities(
    mesh: bpy.types.Mesh, matrix: np.ndarray, uv_map: str, transform: np.ndarray
) -> tuple[float, float] | None:
    """Smallest and largest texels per metre along the short axis of a round footprint on a mesh, or None.

    For the arguments and None see `texel_axes`. The largest number also bounds surfaces seen at an angle, up to
    LARGEST_STRETCH.
    """
    found = texel_axes(mesh, matrix, uv_map, transform)
    if found is None:
        return None
    smallest, largest, area = found
    seen_at_an_angle = np.minimum(largest, LARGEST_STRETCH * smallest)
    return (
        _quantile(smallest, area, OUTERMOST_AREA),
        _quantile(seen_at_an_angle, area, 1.0 - OUTERMOST_AREA),
    )


def largest_texel_area(mesh: bpy.types.Mesh, matrix: np.ndarray, uv_map: str, transform: np.ndarray) -> float | None:
    """Most texels per square metre of a mesh without its outermost pieces, or None; arguments as for `texel_axes`."""
    found = texel_axes(mesh, matrix, uv_map, transform)
    return None if found is None else _quantile(found[0] * found[1], found[2], 1.0 - OUTERMOST_AREA)


def texel_axes(
    mesh: bpy.types.Mesh, matrix: np.ndarray, uv_map: str, transform: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Texels per metre along the short and the long axis of a round footprint on each triangle (n,), its area [m^2].

    matrix: (3, 3), mesh to world; transform: (2, 2), UVs of the UV map `uv_map` to texels. Degenerate triangles are
    left out. None without that UV map, or where all of it is degenerate.
    """
    layers = [layer for layer in mesh.uv_layers if layer.name == uv_map or not uv_map and layer.active_render]
    if not layers:
        return None
    mesh.calc_loop_triangles()
    loops = _values(mesh.loop_triangles, "loops", np.int32).reshape(-1, 3)
    corners = _values(mesh.loop_triangles, "vertices", np.int32).reshape(-1, 3)
    places = vertices(mesh)[corners] @ np.asarray(matrix, float).T
    texels = _values(layers[0].uv, "vector", np.float32).reshape(-1, 2).astype(float)[loops] @ np.asarray(transform).T

    # Find the singular values of texels by metres from traces and determinants of 2 x 2 matrices.
    sides = places[:, 1:] - places[:, :1]
    changes = texels[:, 1:] - texels[:, :1]
    metric = np.einsum("tic,tjc->tij", sides, sides)
    with np.errstate(divide="ignore", invalid="ignore"):
        area = 0.5 * np.sqrt(np.linalg.det(metric))
        product = np.abs(np.linalg.det(changes)) / (2.0 * area)
        usable = (area > 0.0) & (product > 0.0) & np.isfinite(product)
    if not usable.any():
        return None
    area, product = area[usable], product[usable]
    change = changes[usable]
    trace = np.einsum("tia,tij,tja->t", change, np.linalg.inv(metric[usable]), change)
    largest = np.sqrt(0.5 * (trace + np.sqrt(np.maximum(trace**2 - 4.0 * product**2, 0.0))))
    return product / largest, largest, area


def vertices(mesh: bpy.types.Mesh) -> np.ndarray:
    """Places (n, 3) of a mesh's vertices, in its own space."""
    return _values(mesh.vertices, "co", np.float32).reshape(-1, 3).astype(float)


def face_planes(mesh: bpy.types.Mesh, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Outward normals (n, 3) and centres (n, 3) of at most about `count` faces, spread over the mesh."""
    step = max(len(mesh.polygons) // count, 1)
    normals, centres = (_values(mesh.polygons, name, np.float32).reshape(-1, 3) for name in ("normal", "center"))
    return normals[::step].astype(float), centres[::step].astype(float)


def evaluated_mesh(thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bpy.types.Mesh | None:
    """The mesh of an object with its modifiers, or None if the view layer has none to give."""
    evaluated = thing.evaluated_get(depsgraph)
    if thing.modifiers and not evaluated.is_evaluated:
        return None
    return evaluated.data if len(evaluated.data.polygons) else None


def _values(collection: bpy.types.bpy_prop_collection, name: str, kind: type[np.generic]) -> np.ndarray:
    """A property of two (UVs) or three numbers of all members, in one row."""
    values = np.empty(len(collection) * (2 if name == "vector" else 3), kind)
    collection.foreach_get(name, values)
    return values


def _quantile(values: np.ndarray, weights: np.ndarray, part: float) -> float:
    """The value below which `part` of the weights lie."""
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(below, part * below[-1]).clip(0, len(order) - 1)])
