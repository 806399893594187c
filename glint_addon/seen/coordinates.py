"""How densely a material lays a map on a surface: texels per metre, by the links of its nodes and the mesh's UV map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Euler

from ..materials.find import HeldNode, handed_down, held_nodes
from ..nodes import scale
from ..nodes.glint_bsdf import VECTOR
from .meshes import corner_uvs, triangle_corners

# Part of a surface that is ignored at either end of its densities: slivers, and the poles of a sphere's UV map.
OUTERMOST_AREA = 0.01
# Largest factor by which a surface seen at an angle lengthens a footprint: 1 / cosine of 60 degrees. Steeper views are
# a quarter of the picture of a ball, and the margin of the footprint range covers them up to 75 degrees.
LARGEST_STRETCH = 2.0


@dataclass
class _Way:
    """The nodes between a UV map and an input. matrix: (3, 3), of the Mapping nodes and of what a Glint Scale divides
    by; measured: the UV map whose metres a Glint Scale multiplies by, None without such a node; uv_map: None where the
    nodes do not say."""

    matrix: np.ndarray
    measured: str | None = None
    uv_map: str | None = None


def uv_transforms(
    material: bpy.types.Material, group: bpy.types.ShaderNodeTree, metres: Callable[[str], float]
) -> list[tuple[str, np.ndarray]] | None:
    """How `material` places the map of `group`: [(name of the UV map, (2, 2) matrix, UVs to map coordinates), ...].

    metres: function (name of a UV map) of an object, metres of the scene that one unit of it covers there, for
    materials with a Glint Scale. "" is the UV map that is active for rendering. None where the nodes do not say: other
    coordinates, animated nodes or nodes of other kinds.
    """
    found = []
    for held in held_nodes(material):
        if held.group != group:
            continue
        way = _way_to(held)
        if way.uv_map is None or any(tree.animation_data is not None or tree.library is not None
                                     for tree in held.trees):
            return None
        size = 1.0 if way.measured is None else metres(way.measured)
        found.append((way.uv_map, size * way.matrix[:2, :2]))
    return found or None


def _way_to(held: HeldNode) -> _Way:
    """What is between a UV map and the Vector input of a node, also outside the groups around it."""
    socket, outer, way = held.node.inputs.get(VECTOR.name), held.outer, _Way(np.eye(3))
    while socket is not None and way.uv_map is None:
        socket, outer = handed_down(socket, outer)
        if not socket.is_linked and (socket.hide_value or socket == held.node.inputs[VECTOR.name]):
            way.uv_map = ""  # an input without a link reads the active UV map, as of every texture
            break
        socket = _step_back(socket, way)
    return way


def _step_back(socket: bpy.types.NodeSocket, way: _Way) -> bpy.types.NodeSocket | None:
    """Add the node that is linked to an input to `way`; its own input, None at a UV map and at nodes of other kinds."""
    if len(socket.links) != 1:
        return None
    link = socket.links[0]
    node = link.from_node
    if node.mute or link.is_muted:
        return None
    if node.bl_idname == "ShaderNodeUVMap" and not node.from_instancer:
        way.uv_map = node.uv_map
    elif node.bl_idname == "ShaderNodeTexCoord" and link.from_socket.name == "UV" and not node.from_instancer:
        way.uv_map = ""
    elif node.bl_idname == "NodeReroute":
        return node.inputs[0]
    elif node.bl_idname == "ShaderNodeMapping" and (own := _mapping_matrix(node)) is not None:
        way.matrix = way.matrix @ own
        return node.inputs["Vector"]
    elif node.bl_idname == "ShaderNodeGroup" and scale.is_scale_group(node.node_tree) and _add_scale(node, way):
        if node.inputs[scale.VECTOR.name].is_linked:
            return node.inputs[scale.VECTOR.name]
        way.uv_map = scale.uv_map_of(node.node_tree)
    return None


def _add_scale(node: bpy.types.Node, way: _Way) -> bool:
    """Add a Glint Scale node to `way`; whether that can be told."""
    width = node.inputs[scale.SCALE.name]
    if width.is_linked or way.measured is not None:
        return False
    if width.default_value > 0.0:  # else the UV map stays as it is
        way.matrix = way.matrix / width.default_value
        way.measured = scale.uv_map_of(node.node_tree)
    return True


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
    uvs = corner_uvs(mesh, uv_map)
    if uvs is None:
        return None
    places = triangle_corners(mesh) @ np.asarray(matrix, float).T
    texels = uvs @ np.asarray(transform).T

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
    # The larger is no less than the root of both: rounding makes it 0 on slivers.
    largest = np.maximum(largest, np.sqrt(product))
    return product / largest, largest, area


def _quantile(values: np.ndarray, weights: np.ndarray, part: float) -> float:
    """The value of `values` (n,) below which `part` of the weights lie."""
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(below, part * below[-1]).clip(0, len(order) - 1)])
