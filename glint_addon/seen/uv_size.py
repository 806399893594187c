"""How large a UV map lies on an object: metres of the scene that one unit of UV covers, and how much that varies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ..nodes.scale import metres_property
from .coordinates import OUTERMOST_AREA
from .meshes import ALL, corner_uvs, triangle_corners

# Part of a surface that is ignored at either end where it is asked how much sizes vary: seams, poles, hidden faces.
VARYING_AREA = 0.1
# Triangles of a mesh that are looked at: where sizes differ by half their mean, the mean is off by 0.2 %.
JUDGED_TRIANGLES = 100_000


@dataclass(frozen=True)
class UvSize:
    """Mean metres that one unit of UV covers on an object, and how many times larger that is in some places of it than
    in others; inf where a tenth of the object or more has no area in the UV map."""

    metres: float
    variation: float


def uv_size(mesh: bpy.types.Mesh, matrix: np.ndarray, uv_map: str) -> UvSize | None:
    """The size of UV map `uv_map`, "" for the one active for rendering, on a mesh; None without that UV map or any
    area. matrix: (3, 3), mesh to world. Of large meshes JUDGED_TRIANGLES drawn at random stand for all."""
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    # The same ones at each look, so that nothing seems to have changed.
    chosen = np.random.default_rng(0).integers(0, count, JUDGED_TRIANGLES) if count > JUDGED_TRIANGLES else ALL
    uvs = corner_uvs(mesh, uv_map, chosen)
    if uvs is None:
        return None
    return size_of_triangles(triangle_corners(mesh, chosen) @ np.asarray(matrix, float).T, uvs)


def size_of_triangles(places: np.ndarray, uvs: np.ndarray) -> UvSize | None:
    """The size of UVs (n, 3, 2) on triangles with corners (n, 3, 3) in metres: sqrt(area / area in UV), mean by area.

    The outermost hundredth of the surface at either end counts as what comes next: one face that is nearly collapsed
    in the UV map would have any size. Triangles without area, or not finite, are left out; where nothing is left, None.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        (ax, ay, az), (bx, by, bz) = (places[:, corner].T - places[:, 0].T for corner in (1, 2))
        (au, av), (bu, bv) = (uvs[:, corner].T - uvs[:, 0].T for corner in (1, 2))
        area = 0.5 * np.sqrt((ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2)
        area_in_uv = 0.5 * np.abs(au * bv - av * bu)
        metres = np.sqrt(area / area_in_uv)
    has_area = (area > 0.0) & np.isfinite(area) & np.isfinite(area_in_uv)
    usable = has_area & np.isfinite(metres)
    if not usable.any():
        return None
    metres, area = np.where(usable, metres, np.inf)[has_area], area[has_area]
    order = np.argsort(metres)
    metres, area = metres[order], area[order]
    low, high = _quantiles(metres, area, VARYING_AREA)
    mapped = np.isfinite(metres)
    metres, area = metres[mapped], area[mapped]
    mean = np.average(metres.clip(*_quantiles(metres, area, OUTERMOST_AREA)), weights=area)
    return UvSize(float(mean), high / low if np.isfinite(low) else np.inf)


def _quantiles(values: np.ndarray, weights: np.ndarray, part: float) -> tuple[float, float]:
    """The values (n,), in order, below which and above which `part` of the weights lie."""
    below = np.cumsum(weights)
    low, high = np.searchsorted(below, np.array([part, 1.0 - part]) * below[-1]).clip(0, len(values) - 1)
    return float(values[low]), float(values[high])


def mean_scale(matrix: np.ndarray) -> float:
    """Mean factor of a matrix (3, 3), as `nodes.scale` computes it: root mean square of its columns' lengths."""
    return float(np.linalg.norm(matrix) / np.sqrt(3.0))


def metres_rendered(thing: bpy.types.Object, mesh: bpy.types.Mesh, matrix: np.ndarray) -> Callable[[str], float]:
    """What a Glint Scale will show of an object that is prepared: function (name of a UV map) -> metres of one unit.

    matrix: (3, 3), mesh to world. What is linked from another file keeps the size that it has there.
    """

    def metres(uv_map: str) -> float:
        size = uv_size(mesh, matrix, uv_map) if thing.is_editable else None
        if size is not None:
            return size.metres
        own = stored_metres(thing, uv_map) if not thing.is_editable else None
        return (own or 1.0) * mean_scale(matrix)  # as the nodes have it where an object was not measured

    return metres


def stored_metres(thing: bpy.types.Object, uv_map: str) -> float | None:
    """The metres of a unit of a UV map that an object keeps for Glint Scale, where its scale is 1; None if it does not.
    """
    value = thing.get(metres_property(uv_map))
    return float(value) if isinstance(value, int | float) and value > 0.0 else None


def measured(thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph, uv_map: str) -> tuple[UvSize | None, float]:
    """The size of a UV map on an object as it is in the scene now, with its modifiers, None where there is none; and
    the object's mean scale.

    Modifiers of objects that the view layer does not evaluate are left out.
    """
    matrix = np.array(thing.evaluated_get(depsgraph).matrix_world)[:3, :3]
    with _shape(thing, depsgraph) as mesh:
        return None if mesh is None else uv_size(mesh, matrix, uv_map), mean_scale(matrix)


@contextmanager
def _shape(thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Iterator[bpy.types.Mesh | None]:
    """The mesh of an object, also of curves and text, within this block; None of what has no faces."""
    evaluated = thing.evaluated_get(depsgraph)
    if thing.type not in ("MESH", "CURVE", "SURFACE", "FONT", "META"):
        yield None
    elif thing.type == "MESH":
        yield evaluated.data
    else:
        try:
            yield evaluated.to_mesh()
        finally:
            evaluated.to_mesh_clear()
