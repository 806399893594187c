"""The mip pyramid of an image: every level in one atlas file, as osl/image_texture.h reads it.

Cycles' OSL reads a file bilinearly, without levels and black outside 0..1 (it never wraps), so each level carries a
wrapped border of one texel, so that bilinear fetches anywhere inside a level are right.

Layout (a test compares the constants with the header), texels, row 0 at the bottom, alpha beside colour:

    level 0 with its border at (0, 0); to its right level 1 at the bottom and the smaller ones above each other;
    one more column at the right edge, whose bottom texel has alpha MAGIC and whose other texels are 0: by MAGIC the
    shader notices that Blender's Simplify setting shrank the file, which it does without a word.

Level 0 is the image as Cycles stores it: alpha associated, and for sRGB images still encoded, because Cycles decodes
after interpolating. An artist sees the decoded image, so levels 1, 2, ... are area means of the decoded image, in
linear light. A level's side is half the one below, rounded up.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import MapError, TableError
from .float_image import content_digest, is_whole, write_whole

MAGIC = 5344.0  # exact in half floats, and no mean of alphas is as large
BORDER = 1  # texels around each level; bilinear interpolation looks no further
VERSION = 1  # part of the file's name: raise it when the layout or the filter changes
LARGEST_SIDE = 16384  # texels; a float atlas of that is 6 GB, more than OpenEXR readers are happy with
CHUNK = 1 << 16  # texels decoded at a time: more do not fit the processor's cache: decision 52

# Two-point Gauss-Legendre in each half of a texel: between texel centres the decoded signal v^2.4 is smooth, so two
# points give its mean: decision 53.
_GAUSS = 0.25 / np.sqrt(3.0)
MEAN_OFFSETS = (-0.25 - _GAUSS, -0.25 + _GAUSS, 0.25 - _GAUSS, 0.25 + _GAUSS)


def srgb_decoded(values: np.ndarray) -> np.ndarray:
    """Linear light of sRGB-encoded `values`; negative values are 0 as in Cycles. Source: IEC 61966-2-1."""
    values = np.asarray(values, dtype=np.float32)
    high = ((np.maximum(values, 0.04045) + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(values < 0.04045, np.maximum(values, 0) / np.float32(12.92), high)


def srgb_encoded(values: np.ndarray) -> np.ndarray:
    """sRGB encoding of linear `values`; the inverse of `srgb_decoded`."""
    values = np.asarray(values, dtype=np.float32)
    high = np.float32(1.055) * np.maximum(values, 0.0031308) ** np.float32(1 / 2.4) - np.float32(0.055)
    return np.where(values < 0.0031308, np.maximum(values, 0) * np.float32(12.92), high)


def level_sizes(width: int, height: int) -> list[tuple[int, int]]:
    """(width, height) in texels of each level, down to 1 x 1."""
    sizes = [(width, height)]
    while sizes[-1] != (1, 1):
        w, h = sizes[-1]
        sizes.append(((w + 1) // 2, (h + 1) // 2))
    return sizes


def level_corners(width: int, height: int) -> list[tuple[int, int]]:
    """Texel (x, y) in the atlas of each level's bottom left texel, inside the level's border."""
    sizes = level_sizes(width, height)
    corners = [(BORDER, BORDER)]
    y = BORDER
    for _, h in sizes[1:]:
        corners.append((width + 3 * BORDER, y))
        y += h + 2 * BORDER
    return corners


def atlas_size(width: int, height: int) -> tuple[int, int]:
    """(width, height) of the atlas in texels."""
    sizes = level_sizes(width, height)
    right = max((w + 2 * BORDER for w, _ in sizes[1:]), default=0)
    return width + 2 * BORDER + right + 1, max(height + 2 * BORDER, sum(h + 2 * BORDER for _, h in sizes[1:]))


def texel_means(stored: np.ndarray, associated: bool) -> np.ndarray:
    """Mean over each texel's square of what Cycles shows of an encoded image: interpolated, then decoded (wrapped).

    Linear light, associated if the image is.
    """
    height, width = stored.shape[:2]
    has_alpha = associated and bool((stored[..., 3] != 1).any())
    means = np.empty_like(stored)
    rows = max(CHUNK // width, 1)
    for start in range(0, height, rows):
        row = np.arange(start, min(start + rows, height))
        near = {step: stored[(row + step) % height] for step in (-1, 0, 1)}
        total = np.zeros_like(near[0])
        for dy in MEAN_OFFSETS:
            along_y = near[0] * np.float32(1 - abs(dy)) + near[1 if dy > 0 else -1] * np.float32(abs(dy))
            for dx in MEAN_OFFSETS:
                beside = np.roll(along_y, -1 if dx > 0 else 1, axis=1)
                shown = along_y * np.float32(1 - abs(dx)) + beside * np.float32(abs(dx))
                # Decode the straight colour.
                divisor = np.where(shown[..., 3:] == 0, np.float32(1), shown[..., 3:]) if has_alpha else np.float32(1)
                total[..., :3] += srgb_decoded(shown[..., :3] / divisor) * divisor
                total[..., 3] += shown[..., 3]
        means[row] = total / np.float32(len(MEAN_OFFSETS) ** 2)
    return means


def area_overlaps(size: int) -> tuple[np.ndarray, np.ndarray]:
    """The three texels of a row of `size` under each texel of the next level, and their shares of its area.

    Returns (indices, weights), both (ceil(size / 2), 3); weights sum to 1. A texel spans at most two of the finer ones.
    """
    half = (size + 1) // 2
    left = np.arange(half) * (size / half)
    right = left + size / half
    texel = np.floor(left).astype(int)[:, None] + np.arange(3)
    overlap = np.minimum(right[:, None], texel + 1) - np.maximum(left[:, None], texel)
    return np.minimum(texel, size - 1), (np.maximum(overlap, 0) / (size / half)).astype(np.float32)


def halved(level: np.ndarray) -> np.ndarray:
    """The next level of linear `level` (height, width, 4): each texel the mean over its area; the total mean stays.

    OpenImageIO's box filter where both sides are even. It weighs whole texels only, so for odd sides the means would
    drift; there the overlaps are weighed exactly.
    """
    from .openimageio import oiio

    height, width = level.shape[:2]
    if height % 2 or width % 2:
        rows, row_weights = area_overlaps(height)
        columns, column_weights = area_overlaps(width)
        level = sum(level[rows[:, k]] * row_weights[:, k, None, None] for k in range(3))
        return sum(level[:, columns[:, k]] * column_weights[:, k, None] for k in range(3))
    roi = oiio.ROI(0, width // 2, 0, height // 2, 0, 1, 0, 4)
    result = oiio.ImageBufAlgo.resize(oiio.ImageBuf(np.ascontiguousarray(level)), "box", 1.0, roi)
    if result.has_error:
        raise TableError(f"OpenImageIO cannot halve an image ({result.geterror()}): report this as a bug.")
    return np.asarray(result.get_pixels(oiio.FLOAT)).reshape(height // 2, width // 2, 4)


def levels(stored: np.ndarray, *, encoded: bool, associated: bool) -> list[np.ndarray]:
    """Every level of the image `stored` (height, width, 4) float32; level 0 is `stored` itself, the rest is linear."""
    pyramid = [stored]
    linear = texel_means(stored, associated) if encoded else stored
    while pyramid[-1].shape[:2] != (1, 1):
        linear = halved(linear)
        pyramid.append(linear)
    return pyramid


def atlas(pyramid: list[np.ndarray]) -> np.ndarray:
    """The levels side by side with their wrapped borders, (height, width, 4) float32, row 0 at the bottom."""
    height, width = pyramid[0].shape[:2]
    columns, rows = atlas_size(width, height)
    pixels = np.zeros((rows, columns, 4), np.float32)
    for level, (x, y) in zip(pyramid, level_corners(width, height), strict=True):
        padded = np.pad(level, ((BORDER, BORDER), (BORDER, BORDER), (0, 0)), mode="wrap")
        h, w = padded.shape[:2]
        pixels[y - BORDER : y - BORDER + h, x - BORDER : x - BORDER + w] = padded
    pixels[0, -1, 3] = MAGIC
    return pixels


def pyramid_name(stored: np.ndarray, *, encoded: bool, associated: bool, half: bool) -> str:
    """File name by content: the same image gives the same name on every machine."""
    digest = content_digest(f"glint pyramid {VERSION} {stored.shape} {encoded} {associated} {half}", stored)
    return f"image_{digest}.exr"


def bake_pyramid(
    stored: np.ndarray, folder: Path, *, encoded: bool, associated: bool, half: bool = False, name: str = "image"
) -> tuple[Path, bool]:
    """Write the pyramid of `stored` into `folder`, unless it is there and whole: (path, whether it was written now).

    stored: (height, width, 4) float32 as Cycles holds the image, row 0 at the bottom (see the module's docstring);
    encoded: RGB is sRGB-encoded; associated: RGB is multiplied by alpha; half: 16-bit floats are enough (8-bit images).
    The file appears whole or not at all. Raises MapError for an image of no or too large a size or with values that
    are not finite, TableError if it cannot be written.
    """
    if stored.ndim != 3 or stored.shape[2] != 4 or 0 in stored.shape:
        raise MapError(f'Image "{name}" has no pixels (shape {stored.shape}): reload it or choose another.')
    if max(stored.shape[:2]) > LARGEST_SIDE:
        raise MapError(f'Image "{name}" is larger than {LARGEST_SIDE} texels a side: scale it down.')
    # Cycles shows a texel as 0 if any of its values is not finite.
    stored = np.where(np.isfinite(stored).all(axis=2, keepdims=True), stored, np.float32(0)).astype(np.float32)
    path = Path(folder) / pyramid_name(stored, encoded=encoded, associated=associated, half=half)
    if is_whole(path):
        return path, False
    write_whole(path, atlas(levels(stored, encoded=encoded, associated=associated)), half=half)
    return path, True
