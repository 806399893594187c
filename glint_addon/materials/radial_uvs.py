"""UVs that run around an axis, for brushed and turned metal: u along circles, v across them, both in metres."""

from __future__ import annotations

import bpy
import numpy as np

from ..errors import SceneError


def add_radial_uvs(mesh: bpy.types.Mesh, *, name="Radial", repeat=0.0) -> bpy.types.MeshUVLoopLayer:
    """Add, or fill, the UV map `name` of a mesh with circles around its own Z axis, and make it active for rendering.

    A unit is a metre of the mesh: v is the distance from the axis on faces that look along it, and the height on
    others; u is the way around at the mean distance of all. repeat: metres of a map's repeat, of which a whole number
    then goes around, so that no seam is seen; 0: as it comes. Raises SceneError if the mesh can have no more UV maps.
    """
    layer = mesh.uv_layers.get(name) or mesh.uv_layers.new(name=name)
    if layer is None:
        raise SceneError(f'Mesh "{mesh.name}" has {len(mesh.uv_layers)} UV maps, and Blender takes no more: remove one '
                         "in Properties > Data > UV Maps.")
    count = len(mesh.loops)
    vertices = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", vertices)
    corners, starts, normals = np.empty(count, int), np.empty(len(mesh.polygons), int), np.empty(3 * len(mesh.polygons))
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("normal", normals)
    polygon = np.repeat(np.arange(len(starts)), np.diff([*starts, count]))
    uvs = radial_uvs(vertices.reshape(-1, 3)[corners], normals.reshape(-1, 3)[polygon], polygon, repeat)
    layer.uv.foreach_set("vector", uvs.astype(np.float32).ravel())
    mesh.uv_layers.active = layer
    layer.active_render = True
    return layer


def radial_uvs(places: np.ndarray, normals: np.ndarray, polygon: np.ndarray, repeat: float) -> np.ndarray:
    """UVs (n, 2) of corners at `places` (n, 3) of faces with `normals` (n, 3).

    polygon: number of each corner's face, in their order; repeat: as above.
    """
    faces = polygon[-1] + 1
    corners = np.bincount(polygon)
    middle = np.stack([np.bincount(polygon, places[:, axis], faces) / corners for axis in (0, 1)])
    direction = np.arctan2(middle[1], middle[0])[polygon]
    distance = np.hypot(places[:, 0], places[:, 1])

    # A corner's angle from that of its face's middle, so that no face spans the circle; on the axis it has none.
    turn = np.arctan2(places[:, 1], places[:, 0]) - direction
    turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
    turn[distance < 1e-6 * distance.max()] = 0.0

    around = 2 * np.pi * distance.mean()
    if repeat > 0:
        around = max(round(around / repeat), 1) * repeat
    looks_along = np.abs(normals[:, 2]) > np.sqrt(0.5)
    return np.stack([(direction + turn) / (2 * np.pi) * around, np.where(looks_along, distance, places[:, 2])], axis=1)
