"""The flakes table: which part of a map's area is flakes, and the colours of these, at every scale.

Between flakes a surface shows its base. A sample takes the part of flakes from the block of texels around its hit point
that is about as wide as its footprint, so that the base shows evenly; its mean over hit points is the map's presence.
Colours of single flakes are read texel by texel. Far views merge flakes of like slope: their colour is the mean around
the hit times a ratio, which says how the colour depends on the slope in that region of the map.

* Levels: level l has blocks of 2^l x 2^l texels, the last of a row or column cut off at the map's edge, and the last
  level one block.
* Regions: equal parts of the map, `regions` along each side: maps differ from place to place.
* Bins: BINS x BINS over the box of slopes that are counted (see `slope_box`), without Strength.

Layout (read by osl/flakes.h; a test compares the constants): an RGBA OpenEXR file of 16-bit floats, both sides powers
of two, because Cycles fetches exactly only at (i + 0.5) / 2^n. Texel t of the list lies at column t % width, row
t / width, row 0 at the top. Colours are linear, from 0 to LARGEST. The list, each array row by row:

* with colours, for each region row by row, each bin of slope v, each bin of slope u: RGB is the mean colour of the
  region's flakes in the bin, relative to the region's mean; where there are none, that of a larger bin;
* with colours, level 0: RGB of each texel's flake, A = 1; where no flake is, a colour that nobody sees, and A = 0;
* levels 1 and on: RGB is the mean colour of the block's flakes, or where it has none that of the smallest larger block
  that has some; A is the part of the block's area that is flakes. Without colours RGB is 1;
* the last texel: (MAGIC, 1 with colours, 0, 0).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..errors import MapError
from .float_image import content_digest, is_whole, list_shape, table_file_name, write_whole
from .normal_map import are_flakes
from .progress import Steps
from .slope_counts import slope_box

MAGIC = 1949.0  # other kinds of table have other numbers; a 16-bit float holds it
VERSION = 2  # part of the content address: raise it when the layout changes
BINS = 64  # along each slope: decision 74
REGION = 128  # least side in texels of a region, which has flakes of most slopes: decision 74
MOST_REGIONS = 8  # along each side of the map
LARGEST = 65504.0  # that a 16-bit float holds
BAKED = 0.8  # part of the work done when the table is in memory


def regions(size: int) -> int:
    """Regions along a side of `size` texels."""
    return min(max(size // REGION, 1), MOST_REGIONS)


def level_count(width: int, height: int) -> int:
    """Levels above level 0 of a map; the last has one block."""
    return max((max(width, height) - 1).bit_length(), 1)


def blocks(size: int, level: int) -> int:
    """Blocks of a level along a side of `size` texels."""
    return (size + (1 << level) - 1) >> level


def table_texels(width: int, height: int, has_colors: bool) -> int:
    """Texels of the list of a map of `width` x `height` texels."""
    levels = range(0 if has_colors else 1, level_count(width, height) + 1)
    grids = regions(width) * regions(height) * BINS * BINS if has_colors else 0
    return grids + sum(blocks(width, level) * blocks(height, level) for level in levels) + 1


def usable_colors(colors: np.ndarray) -> np.ndarray:
    """Colours as the Glossy BSDF takes them, and a 16-bit float holds them: float32 (height, width, 3), 0..LARGEST.

    Cycles shows a texel as black if any of its values is not finite.
    """
    colors = np.where(np.isfinite(colors).all(axis=-1, keepdims=True), colors, np.float32(0))
    return np.clip(colors, 0, LARGEST).astype(np.float32)


def halved_sums(sums: np.ndarray) -> np.ndarray:
    """Sums over 2 x 2 of the blocks (rows, columns, channels); the last ones of odd sides stand alone."""
    rows, columns = sums.shape[:2]
    sums = np.pad(sums, ((0, rows % 2), (0, columns % 2), (0, 0)))
    return sums[::2, ::2] + sums[1::2, ::2] + sums[::2, 1::2] + sums[1::2, 1::2]


def level_sums(sums: np.ndarray) -> list[np.ndarray]:
    """Sums (rows, columns, channels) over the blocks of each level from 0 on, up to one block, but level 1 at least."""
    levels = [sums, halved_sums(sums)]
    while levels[-1].shape[:2] != (1, 1):
        levels.append(halved_sums(levels[-1]))
    return levels


def filled_means(levels: list[np.ndarray]) -> list[np.ndarray]:
    """Mean colour (rows, columns, 3) of the flakes in each block of each level.

    levels: of `level_sums`, the sum of the flakes' colours and their number. A block without flakes has the colour of
    the smallest larger block that has some.
    """
    means: list[np.ndarray] = []
    for sums in reversed(levels):
        rows, columns = sums.shape[:2]
        number = sums[..., 3:]
        mean = sums[..., :3] / np.maximum(number, 1)
        if means:
            larger = means[-1].repeat(2, axis=0)[:rows].repeat(2, axis=1)[:, :columns]
            mean = np.where(number > 0, mean, larger)
        means.append(mean)
    return means[::-1]


def block_areas(width: int, height: int, level: int) -> np.ndarray:
    """Texels in each block of a level: (rows, columns)."""
    sides = [np.minimum(size - (np.arange(blocks(size, level)) << level), 1 << level) for size in (height, width)]
    return sides[0][:, None] * sides[1]


def pyramid(normals: np.ndarray, colors: np.ndarray | None) -> list[np.ndarray]:
    """Every level from 0 on, float16 (rows, columns, 4): mean colour of the flakes in each block, and their part."""
    height, width = normals.shape[:2]
    presence = are_flakes(normals).astype(np.float32)[..., None]
    shown = presence.repeat(3, axis=2) if colors is None else colors * presence
    levels = level_sums(np.concatenate([shown, presence], axis=2))
    return [
        np.concatenate([mean, sums[..., 3:] / block_areas(width, height, level)[..., None]], axis=2).astype(np.float16)
        for level, (sums, mean) in enumerate(zip(levels, filled_means(levels), strict=True))
    ]


def slope_ratios(normals: np.ndarray, colors: np.ndarray) -> np.ndarray:
    """Mean colour of the flakes of each region in each bin of slope, relative to the mean of all its flakes.

    Returns float32 (regions along v, regions along u, BINS along slope v, BINS along slope u, 3). A bin without flakes
    has the ratio of the smallest larger bin that has some, of 2 x 2, 4 x 4, ... bins; 1 where the region has none.
    """
    height, width = normals.shape[:2]
    box = slope_box(normals)
    edges_v, edges_u = (-(-np.arange(regions(size) + 1) * size // regions(size)) for size in (height, width))
    ratios = np.ones((len(edges_v) - 1, len(edges_u) - 1, BINS, BINS, 3), np.float32)
    for v, u in np.ndindex(ratios.shape[:2]):
        part = np.s_[edges_v[v] : edges_v[v + 1], edges_u[u] : edges_u[u + 1]]
        present = are_flakes(normals[part])
        if present.any():
            ratios[v, u] = _region_ratios(normals[part][present], colors[part][present], box)
    return ratios


def _region_ratios(normals: np.ndarray, colors: np.ndarray, box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """`slope_ratios` of one region, (BINS, BINS, 3); normals, colors: (flakes, 3) of its flakes, at least one."""
    x, y, z = normals.T
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        places = (np.stack([x / z, y / z], axis=1) - box[0]) / (box[1] - box[0]) * BINS
    is_binned = (z > 0) & ((places >= 0) & (places < BINS)).all(axis=1)
    columns, rows = places[is_binned].astype(int).T
    shown = np.column_stack([colors[is_binned], np.ones(is_binned.sum())])
    sums = np.stack([np.bincount(rows * BINS + columns, values, BINS * BINS) for values in shown.T], axis=1)
    levels = level_sums(sums.reshape(BINS, BINS, 4))
    if not levels[-1][..., 3].any():
        return np.ones((BINS, BINS, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = filled_means(levels)[0] / colors.mean(axis=0, dtype=np.float64)
    # A mean of 0 is right whatever it is multiplied by.
    return np.clip(np.where(np.isfinite(ratio), ratio, 1), 0, LARGEST)


def flakes_texels(
    normals: np.ndarray, colors: np.ndarray | None, progress: Callable[[float], None] | None = None
) -> np.ndarray:
    """Padded RGBA float16 pixels of the table, row 0 at the bottom.

    normals: float32 (height, width, 3) of `flake_normals`; colors: linear (height, width, 3), or None for flakes of
    colour 1; progress: called with the part of the work done, 0..1; an exception that it raises ends the work.
    """
    height, width = normals.shape[:2]
    file_width, rows = list_shape(table_texels(width, height, colors is not None))
    texels = np.zeros((file_width * rows, 4), np.float16)
    texels[-1, :2] = MAGIC, colors is not None
    arrays: list[np.ndarray] = []
    steps = Steps(progress, 3)
    if colors is not None:
        colors = usable_colors(colors)
        ratios = slope_ratios(normals, colors)
        arrays = [np.concatenate([ratios, np.zeros_like(ratios[..., :1])], axis=-1)]
    steps.add(1)
    arrays += pyramid(normals, colors)[0 if colors is not None else 1 :]
    steps.add(1)
    start = 0
    for array in arrays:
        count = array.size // 4
        texels[start : start + count] = array.reshape(-1, 4)
        start += count
    steps.add(1)
    return texels.reshape(rows, file_width, 4)[::-1]


def flakes_name(normals: np.ndarray, colors: np.ndarray | None) -> str:
    """File name by content: the same flakes give the same name on every machine."""
    shown = "of colour 1" if colors is None else content_digest("colours", colors)
    return table_file_name(f"glint flakes {VERSION} {shown}", normals, "_flakes")


def bake_flakes(
    normals: np.ndarray,
    colors: np.ndarray | None,
    folder: Path,
    *,
    name: str = "flakes",
    progress: Callable[[float], None] | None = None,
) -> tuple[Path, bool]:
    """Write the flakes table into `folder`, unless there and whole: (path, whether it was written now).

    normals, colors and progress as for `flakes_texels`; `name` is the colour image's, for messages. The file appears
    whole or not at all. Raises MapError if the shapes differ, TableError if the folder cannot be written to.
    """
    if colors is not None and colors.shape[:2] != normals.shape[:2]:
        (height, width), (rows, columns) = normals.shape[:2], colors.shape[:2]
        raise MapError(
            f'Image "{name}" of the flakes\' colours has {columns} x {rows} pixels, and its normal map '
            f"{width} x {height}: scale one of them to the size of the other."
        )
    path = Path(folder) / flakes_name(normals, colors)
    if is_whole(path):
        return path, False
    texels = flakes_texels(normals, colors, progress and (lambda part: progress(BAKED * part)))
    write_whole(path, texels, half=True, steps=Steps(progress, len(texels), start=BAKED))
    return path, True
