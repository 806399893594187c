"""Tangent frames of triangles: the TBN matrix from edges and UV differences, in numpy; osl/tangent_frame.h is its twin.

Solves deltaPos1 = du1 T + dv1 B, deltaPos2 = du2 T + dv2 B: T and B are the changes of position per unit of u and v.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from glint_addon.errors import MapError

# UVs count as degenerate where their area is this small a part of the product of their differences' lengths: below it
# float32 UVs (relative rounding 6e-8) no longer say on which side of each other the differences lie.
LEAST_SINE = 1e-6


@dataclass(frozen=True)
class TangentFrame:
    """Frames of any number of triangles, in the space of the positions given.

    tangent, bitangent: (..., 3), position per unit of u and v, not of unit length; normal: (..., 3), unit, by the
    winding; sign: (...), -1 where the UVs are mirrored, else 1; degenerate: (...), whether the UVs have no area. There
    tangent and bitangent are a right-handed unit pair beside the normal (see `basis_around`) and the sign is 1.
    A triangle without area has the normal (0, 0, 1).
    """

    tangent: np.ndarray
    bitangent: np.ndarray
    normal: np.ndarray
    sign: np.ndarray
    degenerate: np.ndarray


def triangle_frame(positions: ArrayLike, uvs: ArrayLike) -> TangentFrame:
    """Frames of triangles; positions: (..., 3, 3) as [corner, axis]; uvs: (..., 3, 2).

    Raises MapError for other shapes or values that are not finite.
    """
    positions, uvs = np.asarray(positions, dtype=np.float64), np.asarray(uvs, dtype=np.float64)
    if positions.shape[-2:] != (3, 3) or uvs.shape[-2:] != (3, 2) or positions.shape[:-2] != uvs.shape[:-2]:
        raise MapError(f"Triangles {positions.shape} and UVs {uvs.shape} differ: give (..., 3, 3) and (..., 3, 2).")
    if not (np.isfinite(positions).all() and np.isfinite(uvs).all()):
        raise MapError("Triangles or UVs are NaN or infinite: repair the mesh.")
    edges = positions[..., 1:, :] - positions[..., :1, :]
    differences = uvs[..., 1:, :] - uvs[..., :1, :]
    cross = np.cross(edges[..., 0, :], edges[..., 1, :])
    length = np.linalg.norm(cross, axis=-1, keepdims=True)
    has_area = length > 0
    normal = np.where(has_area, cross / np.where(has_area, length, 1), [0.0, 0.0, 1.0])
    frame = tangent_frame(edges[..., 0, :], edges[..., 1, :], differences[..., 0, :], differences[..., 1, :], normal)
    if has_area.all():
        return frame
    return _replaced(frame, ~has_area[..., 0])


def tangent_frame(
    delta_position1: np.ndarray,
    delta_position2: np.ndarray,
    delta_uv1: np.ndarray,
    delta_uv2: np.ndarray,
    normal: np.ndarray,
) -> TangentFrame:
    """Frames from two differences of position (..., 3) and UV (..., 2) on surfaces with the unit `normal` (..., 3)."""
    (du1, dv1), (du2, dv2) = np.moveaxis(delta_uv1, -1, 0), np.moveaxis(delta_uv2, -1, 0)
    determinant = du1 * dv2 - du2 * dv1
    lengths = np.hypot(du1, dv1) * np.hypot(du2, dv2)
    degenerate = ~(np.abs(determinant) > LEAST_SINE * lengths)
    inverse = 1.0 / np.where(degenerate, 1.0, determinant)[..., None]
    tangent = inverse * (dv2[..., None] * delta_position1 - dv1[..., None] * delta_position2)
    bitangent = inverse * (du1[..., None] * delta_position2 - du2[..., None] * delta_position1)
    winding = np.einsum("...i,...i", np.cross(delta_position1, delta_position2), normal)
    sign = np.where(determinant * winding < 0, -1.0, 1.0)
    frame = TangentFrame(tangent, bitangent, np.asarray(normal, dtype=np.float64), sign, degenerate)
    return _replaced(frame, degenerate)


def _replaced(frame: TangentFrame, where: np.ndarray) -> TangentFrame:
    """`frame` with the defined answer for degenerate UVs in the places `where`."""
    first, second = basis_around(frame.normal)
    return TangentFrame(
        np.where(where[..., None], first, frame.tangent),
        np.where(where[..., None], second, frame.bitangent),
        frame.normal,
        np.where(where, 1.0, frame.sign),
        frame.degenerate | where,
    )


def basis_around(normal: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (..., 3) that make a right-handed frame with the unit `normal`, continuous except at -z.

    Source: Duff et al., "Building an Orthonormal Basis, Revisited", Journal of Computer Graphics Techniques 6(1), 2017.
    """
    x, y, z = np.moveaxis(np.asarray(normal, dtype=np.float64), -1, 0)
    s = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (s + z)
    b = x * y * a
    return np.stack([1.0 + s * x * x * a, s * b, -s * x], axis=-1), np.stack([b, s + y * y * a, -y], axis=-1)


def tangent_to_world(frame: TangentFrame, normals: ArrayLike, *, orthonormal: bool = True) -> np.ndarray:
    """Unit normals in the frame's space of tangent-space `normals` (..., 3).

    orthonormal: with the unit tangent and a bitangent square to it, as Blender's Normal Map node (MikkTSpace) on flat
    faces; else with the solved T and B scaled to unit length, which follow sheared UVs.
    """
    tangent = _unit(frame.tangent)
    square = frame.sign[..., None] * np.cross(frame.normal, tangent)
    bitangent = square if orthonormal else _unit(frame.bitangent)
    normals = np.asarray(normals, dtype=np.float64)
    return _unit(normals[..., :1] * tangent + normals[..., 1:2] * bitangent + normals[..., 2:] * frame.normal)


def object_to_world(normals: ArrayLike, matrix: ArrayLike) -> np.ndarray:
    """Unit world-space normals of object-space `normals` (..., 3), by the inverse transpose of `matrix` (3x3, 4x4)."""
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    return _unit(np.asarray(normals, dtype=np.float64) @ np.linalg.inv(linear))


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)
