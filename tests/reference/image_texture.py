"""Texture coordinates, sRGB and bilinear interpolation in numpy, as the issue and Cycles define them."""

from __future__ import annotations

import numpy as np


def spherical_uv(points, origin=(0.0, 0.0, 0.0), *, up="Y") -> np.ndarray:
    """(u, v) of points (..., 3) on a sphere around `origin`: n = normalized hit - origin, y up as written.

    up 'Z' turns Blender's z axis to y without mirroring: (x, y, z) -> (x, z, -y).
    """
    n = np.asarray(points, dtype=float) - origin
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    if up == "Z":
        n = np.stack([n[..., 0], n[..., 2], -n[..., 1]], axis=-1)
    return np.stack([np.arctan2(n[..., 0], n[..., 2]) / (2 * np.pi) + 0.5, n[..., 1] * 0.5 + 0.5], axis=-1)


def nearest(pixels, uv) -> np.ndarray:
    """The texel (height, width, c), row 0 at the bottom, under each (u, v), repeated."""
    height, width = pixels.shape[:2]
    column = np.floor(uv[..., 0] * width).astype(int) % width
    row = np.floor(uv[..., 1] * height).astype(int) % height
    return pixels[row, column]


def bilinear(pixels, uv) -> np.ndarray:
    """Bilinear interpolation of (height, width, c) at (u, v), repeated; texel centres at (i + 0.5) / size."""
    height, width = pixels.shape[:2]
    x, y = uv[..., 0] * width - 0.5, uv[..., 1] * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    s, t = (x - column)[..., None], (y - row)[..., None]
    lower = pixels[row % height, column % width] * (1 - s) + pixels[row % height, (column + 1) % width] * s
    upper = pixels[(row + 1) % height, column % width] * (1 - s) + pixels[(row + 1) % height, (column + 1) % width] * s
    return lower * (1 - t) + upper * t


def srgb_decoded(values) -> np.ndarray:
    """Linear light of sRGB-encoded values 0..1 (IEC 61966-2-1)."""
    values = np.asarray(values, dtype=float)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


TAP_STD = 0.5
MAX_ANISOTROPY = 16.0
TAP_REACH = 2.0
TAP_SPACING = 1.5


def level_color(levels, level, uv, *, encoded, unassociate, clamp_v):
    """RGBA (n, 4) of bilinear look-ups in one level of a pyramid at (u, v): linear light, alpha beside colour."""
    pixels = levels[level].astype(float)
    if clamp_v:
        half = 0.5 / len(pixels)
        uv = np.stack([uv[:, 0], np.clip(uv[:, 1], half, 1 - half)], axis=1)
    rgba = bilinear(pixels, uv)
    if level == 0 and encoded:
        alpha = rgba[:, 3:]
        divisor = np.where(unassociate & (alpha != 0), alpha, 1.0)
        rgba = np.concatenate([divisor * srgb_decoded(np.maximum(rgba[:, :3] / divisor, 0)), alpha], axis=1)
    return rgba


def filtered_color(levels, uv, long_uv, long_std, short_std, **settings):
    """RGBA (n, 4) of trilinear taps along the long axes (n, 2) of elliptic Gaussians; long_std, short_std: (n,) texels.

    And the unrounded number (n,) of taps along half of each axis.
    """
    wanted = np.maximum(short_std, long_std / MAX_ANISOTROPY)
    depth = np.clip(np.log2(wanted / TAP_STD), 0, len(levels) - 1)
    tap_std = TAP_STD * 2.0**depth
    spread = np.sqrt(np.maximum(long_std**2 - tap_std**2, 0))
    exact = TAP_REACH * spread / (TAP_SPACING * tap_std) - 0.25
    taps = np.ceil(exact).astype(int)
    total, weights = np.zeros((len(uv), 4)), np.zeros(len(uv))
    for tap in range(-taps.max(), taps.max() + 1):
        place = np.where(taps > 0, TAP_REACH * tap / np.maximum(taps, 1), 0.0)
        weight = np.where(np.abs(tap) <= taps, np.exp(-0.5 * place**2), 0.0)
        at = uv + (place * spread / long_std)[:, None] * long_uv
        every = np.stack([level_color(levels, level, at, **settings) for level in range(len(levels))])
        # A tent over the levels, 1 at its own depth.
        share = np.maximum(1 - np.abs(depth - np.arange(len(levels))[:, None]), 0)
        total += weight[:, None] * np.einsum("ln,lnc->nc", share, every)
        weights += weight
    return total / weights[:, None], exact
