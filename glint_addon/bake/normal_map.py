"""Pixels of a normal map -> checked tangent-space normals, as Blender's Normal Map node reads them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..errors import MapError

LARGEST_SIDE = 32768  # texels; Cycles takes larger textures on the CPU, but memory hardly holds them
LARGEST_VALUE = 1e6  # of a pixel, in a float image: fourth powers, scaled, must still fit a float32 in the shader
ROWS = 32  # decoded at a time: they stay in the processor's cache
CONVENTIONS = ("OPENGL", "DIRECTX")


def decoded_normals(pixels: np.ndarray, *, convention: str = "OPENGL", name: str = "normal map") -> np.ndarray:
    """Tangent-space normals n = 2 c - 1 of an encoded map.

    pixels: (height, width, channels >= 3), values 0..1, row 0 at the bottom as in bpy; convention: 'OPENGL' (+Y up)
    or 'DIRECTX' (green is flipped). Returns float32 (height, width, 3), not normalised, because the Normal Map node
    normalises after interpolation.
    Raises MapError for a wrong shape, pixels that are NaN, infinite or beyond LARGEST_VALUE, a normal of length 0, or
    a map none of whose normals faces up.
    Source: Cycles, node_normal_map.osl.
    """
    _check_reading(pixels, convention, name)
    normals = np.empty((*pixels.shape[:2], 3), np.float32)
    parts = (normals[low : low + ROWS] for low in range(0, len(pixels), ROWS))
    _decode(pixels, parts, convention, name)
    return normals


def check_normals(pixels: np.ndarray, *, convention: str = "OPENGL", name: str = "normal map"):
    """Raise MapError for all that `decoded_normals` raises it for, without keeping normals: no more memory than ROWS
    rows of them take."""
    _check_reading(pixels, convention, name)
    part = np.empty((ROWS, pixels.shape[1], 3), np.float32)
    parts = (part[: len(pixels) - low] for low in range(0, len(pixels), ROWS))
    _decode(pixels, parts, convention, name)


def check_convention(convention: str):
    """Raise MapError for a convention that there is not."""
    if convention not in CONVENTIONS:
        raise MapError(f'Normal map convention "{convention}" is unknown: use one of {", ".join(CONVENTIONS)}.')


def _check_reading(pixels: np.ndarray, convention: str, name: str):
    """Raise MapError for what can be told without looking at a pixel."""
    check_convention(convention)
    if pixels.ndim != 3 or pixels.shape[2] < 3 or 0 in pixels.shape:
        raise MapError(f'Normal map "{name}" has no colour pixels (shape {pixels.shape}): choose an RGB image.')
    if max(pixels.shape[:2]) > LARGEST_SIDE:
        raise MapError(f'Normal map "{name}" is larger than {LARGEST_SIDE} texels a side: scale it down.')


def _decode(pixels: np.ndarray, parts: Iterable[np.ndarray], convention: str, name: str):
    """Decode ROWS rows of pixels after the other into `parts`, arrays for the normals of each. Raises MapError."""
    unusable, without_direction, faces_up = 0, 0, False
    for low, part in zip(range(0, len(pixels), ROWS), parts, strict=True):
        colors = np.asarray(pixels[low : low + ROWS, :, :3], dtype=np.float32)
        usable = np.abs(colors) <= LARGEST_VALUE  # false for NaN
        if not usable.all():
            unusable += int((~usable.all(axis=2)).sum())
            continue
        np.subtract(colors, np.float32(0.5), out=part)
        part *= 2.0
        if convention == "DIRECTX":
            part[..., 1] *= -1.0
        faces_up = faces_up or bool((part[..., 2] > 0.0).any())
        without_direction += int(np.count_nonzero(np.einsum("hwc,hwc->hw", part, part) <= 0.0))
    _refuse(unusable, without_direction, faces_up, name)


def _refuse(unusable: int, without_direction: int, faces_up: bool, name: str):
    """Raise MapError for a map with such pixels, so many of each, or none that faces up."""
    if unusable:
        raise MapError(f'Normal map "{name}" has {unusable} pixels that are NaN, infinite or huge: export it again.')
    if without_direction:
        raise MapError(
            f'Normal map "{name}" has {without_direction} pixels of value (0.5, 0.5, 0.5), which have no direction: '
            "fill them with (0.5, 0.5, 1)."
        )
    if not faces_up:
        raise MapError(
            f'Normal map "{name}" has no pixel that faces up and would render black, as a black or grey picture does: '
            "choose a normal map, which is mostly light blue."
        )


def flake_normals(normals: np.ndarray, presence: np.ndarray, *, name: str = "presence") -> np.ndarray:
    """The normals of flakes alone, float32 (height, width, 3): (0, 0, 0) at texels that are no flakes.

    normals: (height, width, 3) of `decoded_normals`, none of which is 0; presence: bool (height, width), true at
    flakes. All tables leave out texels of normal 0. `name` is the presence image's, for messages. Raises MapError if
    the shapes differ or no texel is a flake.
    """
    if presence.shape != normals.shape[:2]:
        (height, width), (rows, columns) = normals.shape[:2], presence.shape
        raise MapError(
            f'Presence image "{name}" has {columns} x {rows} pixels, and its normal map {width} x {height}: '
            "scale one of them to the size of the other."
        )
    if not presence.any():
        raise MapError(
            f'Presence image "{name}" has no flake, because no pixel is brighter than 0.5: choose an image that is '
            "white where flakes are."
        )
    return np.where(presence[..., None], normals, np.float32(0))


def are_flakes(normals: np.ndarray) -> np.ndarray:
    """Which texels of `flake_normals`, or of any part of them, are flakes: bool, of the shape without the last axis."""
    return normals.any(axis=-1)


def slope_bounds(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest slope (n.x / n.z, n.y / n.z) over the map's flakes, as two float32 arrays (2,).

    Slopes of interpolated normals stay inside too, because they are convex combinations. Where n.z is above 1, which
    only float images hold, n.x and n.y themselves count too: strengths below 1 come nearer to these. If any normal
    lies at or below the horizon there is no bound, and the result is (-inf, inf).
    """
    low, high = np.full(2, np.inf, np.float32), np.full(2, -np.inf, np.float32)
    for first in range(0, len(normals), ROWS):
        rows = normals[first : first + ROWS]
        x, y, z = np.moveaxis(rows, -1, 0)
        if not (z > 0.0).all():
            x, y, z = rows[are_flakes(rows)].T
            if not (z > 0.0).all():
                return -np.full(2, np.inf, np.float32), np.full(2, np.inf, np.float32)
            if not len(z):
                continue
        heights = (z, np.minimum(z, 1.0)) if (z > 1.0).any() else (z,)
        for axis, across in enumerate((x, y)):
            for height in heights:
                slope = across / height
                low[axis], high[axis] = min(low[axis], slope.min()), max(high[axis], slope.max())
    return low, high
