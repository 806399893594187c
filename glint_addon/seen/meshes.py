"""Numbers of meshes as arrays: vertices, corners of triangles, UVs, planes of faces."""

from __future__ import annotations

import bpy
import numpy as np

ALL = slice(None)


def triangle_corners(mesh: bpy.types.Mesh, chosen: np.ndarray | slice = ALL) -> np.ndarray:
    """Corners (n, 3, 3) of a mesh's triangles, those `chosen` by number, in its own space."""
    mesh.calc_loop_triangles()
    return vertices(mesh)[_values(mesh.loop_triangles, "vertices", np.int32).reshape(-1, 3)[chosen]]


def corner_uvs(mesh: bpy.types.Mesh, uv_map: str, chosen: np.ndarray | slice = ALL) -> np.ndarray | None:
    """UVs (n, 3, 2) at the corners of a mesh's triangles, those `chosen` by number: of UV map `uv_map`, for "" of the
    one that is active for rendering; None without it."""
    layers = [layer for layer in mesh.uv_layers if layer.name == uv_map or not uv_map and layer.active_render]
    if not layers:
        return None
    mesh.calc_loop_triangles()
    loops = _values(mesh.loop_triangles, "loops", np.int32).reshape(-1, 3)[chosen]
    return _values(layers[0].uv, "vector", np.float32).reshape(-1, 2).astype(float)[loops]


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
