"""The counts table: how many elements of square blocks of a normal map have a slope below any corner of a grid.

In footprints of thousands of texels only the number of elements of each slope matters, not which elements these are. A
summed-area table over slope bins gives the number in any rectangle of slopes by four fetches (Crow, "Summed-Area Tables
for Texture Mapping", SIGGRAPH 1984). Blocks of several sizes let a footprint of any size do with a few fetches.

* Elements: texels (Closest), or bilinear patches between texel centres (Linear; the map repeats), cut in k x k
  sub-points of 1 / k^2 each. Patch (i, j), whose lower left corner is texel (i, j), belongs to the block of that texel.
* Blocks: of side B = 32, 64, ... texels (Closest) or 16, 32, ... (Linear), in groups of 2 x 2, up to the side where
  one group is the whole map. The sides are stretched so that whole groups fill the map, whatever its size.
* Slope: (n.x / n.z, n.y / n.z) of the map's normals, without Strength. Normals with n.z <= 0 and slopes outside the box
  (see `slope_box`) are not counted: the shader meets them at random, in its remainder. Nor are texels that are no
  flakes, whose normal is 0.

Layout (read by osl/counts.h; a test compares the constants): an RGBA float32 OpenEXR file, both sides powers of two,
because Cycles fetches exactly only at (i + 0.5) / 2^n. Texel t of the list lies at column t % width, row t / width, row
0 at the top, in the order of the file:

* the file's last texel: (MAGIC, side of the first level's blocks, number of levels, 0). A file stores the channels of a
  row one after the other, so MAGIC is the last number of the file, and a file that was cut off lacks it;
* from 0 on, for each level in rising B, each group row by row, each j, each i below `corners`: the number of elements
  whose bin is below i along slope u and below j along slope v, in the group's four blocks (R: low u low v, G: high u
  low v, B: low u high v, A: high u high v). So (0, *) and (*, 0) are 0, and the last corner counts the whole box.

Small blocks, up to PACKED texels, hold few elements and would take most of the memory: there two groups share texels,
the 2g-th and the (2g+1)-th of a level's list. Each number is then a + PACKED_STEP b, where a and b count the first and
the second group in whole units of `packed_unit` elements; a float32 holds it exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ..errors import TableError
from .float_image import list_shape, stored_pairs, table_file_name, write_whole
from .progress import Steps
from .slope_counts import group_counts, slope_box

MAGIC = 7927.0  # other kinds of table have other numbers
VERSION = 7  # part of the content address: raise it when the layout, the bins or the samples change
FIRST_BLOCK = {"CLOSEST": 32, "LINEAR": 16}  # texels; the shader visits the elements of nearer footprints: decision 29
# Corners of the slope grid along each axis, by block side: larger blocks hold more elements and get more. All levels of
# a square map whose side is a power of two fit 16 bytes a texel with the padding: decision 30.
CORNERS = {
    "CLOSEST": {32: 56, 64: 88, 128: 120, 256: 168, 512: 192, 1024: 208},
    "LINEAR": {16: 28, 32: 46, 64: 64, 128: 90, 256: 128, 512: 160, 1024: 192},
}
LARGEST_LISTED = 1024  # texels: larger blocks have as many corners
PACKED = 64  # texels: largest side of blocks of which two groups share texels
PACKED_STEP = 4096  # two numbers below it fit the 24 bits of a float32
# Sub-points of a patch along each axis (Linear), by block side: a small block holds few patches, so each is sampled at
# more points: decision 31.
SUB_POINTS = {16: 6, 32: 6, 64: 4, 128: 4, 256: 3}
SUB_POINTS_ABOVE = 2
BOX = ("glint:low", "glint:high")  # slope box in the file's header: to compute it of a large map again takes seconds
BOXED, COUNTED = 0.05, 0.96  # part of the work done when the box is known, and when the counts are in memory


def groups(size: int, block: int) -> int:
    """Groups of two blocks of side `block` (texels) along a side of `size` texels; at least 1."""
    return max(1, (size + block) // (2 * block))


def counts_levels(width: int, height: int, interpolation: str) -> tuple[int, ...]:
    """Sides in texels of the blocks of every level of a map, rising; the last has one group."""
    levels = [FIRST_BLOCK[interpolation]]
    while groups(width, levels[-1]) * groups(height, levels[-1]) > 1:
        levels.append(2 * levels[-1])
    return tuple(levels)


def corners(block: int, interpolation: str) -> int:
    """Corners of the slope grid along each axis, one more than bins, at blocks of side `block`."""
    return CORNERS[interpolation][min(block, LARGEST_LISTED)]


def sub_points(block: int, interpolation: str) -> int:
    """Points along each axis at which a patch is sampled, at blocks of side `block`; 0 for texels."""
    return SUB_POINTS.get(block, SUB_POINTS_ABOVE) if interpolation == "LINEAR" else 0


def packed_unit(width: int, height: int, block: int) -> float:
    """Elements that one step of a packed count stands for, so that the fullest block fits; 0 where none is packed."""
    if block > PACKED:
        return 0.0
    fullest = -(-width // (2 * groups(width, block))) * -(-height // (2 * groups(height, block)))
    return fullest / (PACKED_STEP - 1)


def level_texels(width: int, height: int, block: int, interpolation: str) -> int:
    """Texels of the list that a level takes."""
    count = groups(width, block) * groups(height, block)
    stored = -(-count // 2) if block <= PACKED else count
    return stored * corners(block, interpolation) ** 2


def block_edges(size: int, block: int) -> np.ndarray:
    """First texel of each block (two in a group) along a side of `size` texels, and `size` itself."""
    count = 2 * groups(size, block)
    return np.arange(count + 1) * size // count


def group_edges(width: int, height: int, block: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """First, middle and end texel along u and along v of each group of a level, row by row."""
    edges_u, edges_v = block_edges(width, block), block_edges(height, block)
    for v in range(0, len(edges_v) - 1, 2):
        for u in range(0, len(edges_u) - 1, 2):
            yield edges_u[u : u + 3], edges_v[v : v + 3]


def stored_levels(width: int, height: int, interpolation: str, levels: tuple[int, int]) -> tuple[int, ...]:
    """Block sides from `levels` = (first, last), both included. Raises TableError unless the map has both."""
    every = counts_levels(width, height, interpolation)
    first, last = levels
    if first not in every or last not in every or first > last:
        raise TableError(
            f"Blocks of {first} to {last} texels are no levels of a {interpolation.title()} map of {width} x {height}: "
            f"choose among {', '.join(map(str, every))}."
        )
    return every[every.index(first) : every.index(last) + 1]


def file_size(width: int, height: int, interpolation: str, levels: tuple[int, int]) -> tuple[int, int]:
    """(width, height) in texels of the file with the `levels` of a map of `width` x `height` texels."""
    blocks = stored_levels(width, height, interpolation, levels)
    texels = 1 + sum(level_texels(width, height, block, interpolation) for block in blocks)
    return list_shape(texels)


def counts_texels(
    normals: np.ndarray,
    interpolation: str,
    levels: tuple[int, int],
    box: tuple[np.ndarray, np.ndarray],
    progress: Callable[[float], None] | None = None,
) -> np.ndarray:
    """Padded RGBA float32 pixels of the table, row 0 at the bottom; normals: float32 (height, width, 3).

    levels: sides of the first and the last level's blocks; box: `slope_box`; progress: called often with the part of
    the work done, 0..1; an exception that it raises ends the work. Raises TableError for levels that the map lacks.
    """
    height, width = normals.shape[:2]
    blocks = stored_levels(width, height, interpolation, levels)
    file_width, rows = file_size(width, height, interpolation, levels)
    texels = np.zeros((file_width * rows, 4), np.float32)
    texels[-1, :3] = MAGIC, blocks[0], len(blocks)
    points = [sub_points(block, interpolation) for block in blocks]
    steps = Steps(progress, width * height * sum(max(k * k, 1) for k in points))
    start = 0
    for block, k in zip(blocks, points, strict=True):
        size = level_texels(width, height, block, interpolation)
        unit = packed_unit(width, height, block)
        side = corners(block, interpolation)
        level = texels[start : start + size].reshape(-1, side, side, 4)
        for g, (edges_u, edges_v) in enumerate(group_edges(width, height, block)):
            group = group_counts(normals, edges_u, edges_v, side, k, box, steps.add)
            if unit:
                level[g // 2] += np.rint(group / unit) * (PACKED_STEP if g % 2 else 1)
            else:
                level[g] = group
        start += size
    return texels.reshape(rows, file_width, 4)[::-1]


def counts_name(normals: np.ndarray, interpolation: str, levels: tuple[int, int]) -> str:
    """File name by content and levels: the same normals give the same name on every machine."""
    return table_file_name(f"glint counts {VERSION} {interpolation}", normals, f"_{levels[0]}_{levels[1]}")


def bake_counts(
    normals: np.ndarray,
    folder: Path,
    *,
    interpolation: str,
    levels: tuple[int, int],
    progress: Callable[[float], None] | None = None,
) -> tuple[Path, bool, np.ndarray, np.ndarray]:
    """Write the counts of `normals`, (height, width, 3) of `decoded_normals`, into `folder`, unless there and whole.

    levels and progress as for `counts_texels`. Returns the path, whether it was written now, and the slope box, low and
    high. The file appears whole or not at all; its header keeps the box. Raises TableError for levels that the map
    lacks, or if the folder cannot be written to.
    """
    stored_levels(normals.shape[1], normals.shape[0], interpolation, levels)
    path = Path(folder) / counts_name(normals, interpolation, levels)
    stored = stored_pairs(path, BOX)
    if stored is not None:
        low, high = stored
        return path, False, low, high
    low, high = slope_box(normals)

    def counted(part: float):
        if progress is not None:
            progress(BOXED + (COUNTED - BOXED) * part)

    counted(0.0)
    texels = counts_texels(normals, interpolation, levels, (low, high), counted)
    steps = Steps(progress, len(texels), start=COUNTED)
    write_whole(path, texels, pairs=dict(zip(BOX, (low, high), strict=True)), steps=steps)
    return path, True, low, high
