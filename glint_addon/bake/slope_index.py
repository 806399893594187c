"""The index table: the texels of each small block of a normal map that is read by Closest, sorted by slope.

For footprints of a hundred to some thousand texels, where one still sees single glints: of each block under the
footprint the shader visits only the texels whose slopes lie near a half vector (the inverse bin map of Atanasov,
Wilkie, Koylazov, Krivanek, "A Multiscale Microfacet Model Based on Inverse Bin Mapping", Eurographics 2021, in blocks).
The index holds the places of texels and no slopes: the shader fetches each normal from the table of normals, so
nothing is rounded. Smooth maps (Linear) have none: decision 71.

* Blocks: SIDE x SIDE texels, the last of a row or column cut off at the map's edge.
* Cells: ROWS x COLUMNS over the slopes of the block (n.x / n.z, n.y / n.z), without Strength; slopes beyond these fall
  into the outermost cells. Normals below the horizon and steep normals are the tail, which is always visited. Texels
  that are no flakes, whose normal is 0, are in neither.

Layout (read by osl/slope_index.h; a test compares the constants): an RGBA float32 OpenEXR file, both sides powers of
two, texel t at column t % width, row t / width, row 0 at the bottom. Block (i, j) has RECORD texels from
RECORD (j columns + i) on:

* texel 0: low slope u, low slope v, cells per slope along u and along v;
* texel 1: 1 plus the number of texels that are no flakes, smallest n.z of what is in cells, number of texels in cells,
  MAGIC. A file stores the channels of a row one after the other, so any may be lost by itself, and is 0 then: the first
  number, smallest n.z, cells per slope along u and MAGIC, one of each channel, are more than 0 in all that is whole;
* texels 2..127: for each cell, row by row, how many texels lie in the cells before it, four to a texel;
* texels 128..255: the texels, cell by cell, then the tail: row SIDE + column within the block; two to a float (the
  second times SIDE^2), eight to a texel.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from .float_image import is_whole, list_shape, table_file_name, write_whole
from .normal_map import are_flakes
from .progress import Steps
from .slope_counts import LARGEST_SLOPE

MAGIC = 7951.0  # other kinds of table have other numbers
VERSION = 4  # part of the content address: raise it when the layout changes
SIDE = 32  # texels of a block
COLUMNS, ROWS = 36, 14  # cells along slope u and v: as many as a record has room for
CELLS = COLUMNS * ROWS
RECORD = 256  # texels of a block's record
FIRST_PREFIX, FIRST_ELEMENT = 2, 128
# Standard deviations of the slopes from their mean that the cells span; the outermost cells hold all slopes beyond.
SPAN = 2.5
LEAST_RANGE = 1e-6  # of slopes in a block: a flat block has cells too
INDEXED = 0.96  # part of the work done when the index is in memory


def blocks(size: int) -> int:
    """Blocks along a side of `size` texels."""
    return -(-size // SIDE)


def index_shape(width: int, height: int) -> tuple[int, int]:
    """(width, height) in texels of the file for a map of `width` x `height` texels."""
    return list_shape(RECORD * blocks(width) * blocks(height))


def index_texels(normals: np.ndarray, progress: Callable[[float], None] | None = None) -> np.ndarray:
    """Padded RGBA float32 pixels of the table, row 0 at the bottom; normals: float32 (height, width, 3).

    progress: called often with the part of the work done, 0..1; an exception that it raises ends the work.
    """
    height, width = normals.shape[:2]
    file_width, file_height = index_shape(width, height)
    texels = np.zeros((file_width * file_height, 4), np.float32)
    steps = Steps(progress, height)
    in_row = RECORD * blocks(width)
    for row in range(blocks(height)):
        low, high = row * SIDE, min(row * SIDE + SIDE, height)
        texels[row * in_row : (row + 1) * in_row] = _row_records(normals[low:high]).reshape(-1, 4)
        steps.add(high - low)
    return texels.reshape(file_height, file_width, 4)


def index_name(normals: np.ndarray) -> str:
    """File name by content: the same normals give the same name on every machine."""
    return table_file_name(f"glint index {VERSION}", normals, "_index")


def bake_index(
    normals: np.ndarray, folder: Path, *, progress: Callable[[float], None] | None = None
) -> tuple[Path, bool]:
    """Write the index of `normals`, (height, width, 3) of `decoded_normals`, into `folder`, unless there and whole.

    progress: called often with the part of the work done, 0..1; an exception that it raises ends the bake.
    Returns its path and whether it was written now. The file appears whole or not at all.
    Raises TableError if the folder cannot be written to.
    """
    path = Path(folder) / index_name(normals)
    if is_whole(path):
        return path, False
    texels = index_texels(normals, progress and (lambda part: progress(INDEXED * part)))
    write_whole(path, texels, steps=Steps(progress, len(texels), start=INDEXED))
    return path, True


def _row_records(normals: np.ndarray) -> np.ndarray:
    """Records of the blocks of one row, whose normals are (up to SIDE, width, 3): float32 (blocks, RECORD, 4)."""
    rows, width = normals.shape[:2]
    count = blocks(width)
    x, y, z = np.moveaxis(normals, -1, 0)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        slopes = np.nan_to_num(np.stack([x / z, y / z]), nan=np.inf)
    listed = (z > 0) & (np.abs(slopes) <= LARGEST_SLOPE).all(axis=0)

    # (blocks, SIDE^2) of each, row by row within a block; beyond the map's edge nothing is present.
    present = _by_blocks(are_flakes(normals), count)
    absent = _by_blocks(~are_flakes(normals), count).sum(axis=1)
    listed = _by_blocks(listed, count)
    slopes = np.stack([_by_blocks(part, count) for part in slopes])

    start, scale = np.empty((2, count), np.float32), np.empty((2, count), np.float32)
    cell = np.zeros((count, SIDE * SIDE), np.int32)
    for axis, cells, stride in ((0, COLUMNS, 1), (1, ROWS, COLUMNS)):
        mean, top = _mean_and_deviations(slopes[axis], listed, SPAN)
        smallest = np.where(listed, slopes[axis], np.inf).min(axis=1)
        largest = np.where(listed, slopes[axis], -np.inf).max(axis=1)
        start[axis] = np.where(listed.any(axis=1), np.maximum(2 * mean - top, smallest), 0)
        end = np.where(listed.any(axis=1), np.minimum(top, largest), 0)
        scale[axis] = cells / np.maximum(end - start[axis], LEAST_RANGE)
        place = np.where(listed, (slopes[axis] - start[axis, :, None]) * scale[axis, :, None], 0)
        cell += stride * np.clip(place, 0, cells - 1).astype(np.int32)
    cell[~listed] = CELLS
    cell[~present] = CELLS + 1

    return _records(cell, start, scale, np.where(listed, _by_blocks(z, count), np.inf).min(axis=1), absent)


def _records(
    cell: np.ndarray, start: np.ndarray, scale: np.ndarray, least_z: np.ndarray, absent: np.ndarray
) -> np.ndarray:
    """Pack the records. cell: int (blocks, SIDE^2), CELLS for the tail, CELLS + 1 for nothing; absent: (blocks,)."""
    count = len(cell)
    keys = (np.arange(count)[:, None] * (CELLS + 2) + cell).reshape(-1)
    found = np.bincount(keys, minlength=count * (CELLS + 2)).reshape(count, CELLS + 2)
    before = found.cumsum(axis=1) - found
    order = np.argsort(cell.astype(np.uint16), axis=1, kind="stable")
    records = np.zeros((count, RECORD, 4), np.float32)
    records[:, 0] = np.stack([*start, *scale], axis=1)
    records[:, 1] = np.stack(
        [1 + absent, np.minimum(least_z, 1), before[:, CELLS], np.full(count, MAGIC)], axis=1)
    records[:, FIRST_PREFIX:FIRST_ELEMENT] = before[:, :CELLS].reshape(count, -1, 4)
    records[:, FIRST_ELEMENT:] = (order[:, ::2] + SIDE * SIDE * order[:, 1::2]).reshape(count, -1, 4)
    return records


def _by_blocks(values: np.ndarray, count: int) -> np.ndarray:
    """(rows, width) -> (count, SIDE^2): each block's values row by row, zeros beyond the map's edge."""
    rows, width = values.shape
    padded = np.zeros((SIDE, count * SIDE), values.dtype)
    padded[:rows, :width] = values
    return padded.reshape(SIDE, count, SIDE).transpose(1, 0, 2).reshape(count, -1)


def _mean_and_deviations(
    values: np.ndarray, listed: np.ndarray, deviations: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the listed values of each block, and that many deviations above it: (blocks,) each, 0 where none is."""
    number = np.maximum(listed.sum(axis=1), 1)
    known = np.where(listed, values, 0)
    mean = known.sum(axis=1) / number
    spread = np.where(listed, values - mean[:, None], 0)
    return mean, mean + deviations * np.sqrt((spread * spread).sum(axis=1) / number)
