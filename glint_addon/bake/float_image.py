"""Float images on disk that appear whole or not at all, and the test whether a file is still whole.

A full disk, a copy that broke off, or a machine that lost its power leaves files of the right name, often of the right
size, that end in zeros. So each file carries a digest of itself, as an attribute of its OpenEXR header, which goes
where the file goes. The attribute has a fixed length, so that it can be filled in after the rest is written.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from os import SEEK_END
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4

import numpy as np

from ..errors import TableError
from .progress import Steps

SUFFIX = ".exr"  # of every table
SMALLEST_WIDTH, LARGEST_WIDTH = 16, 1 << 20  # of a list's file, in texels; OpenImageIO writes no wider OpenEXR file
ATTRIBUTE, DIGITS = "glint:digest", 64  # of the header: SHA-256
BLANK = "0" * DIGITS  # what the attribute holds until the digest is known, and while it is computed
# The attribute as it lies in the file: name, type, length, value (OpenEXR File Layout, openexr.com).
FIELD = f"{ATTRIBUTE}\0string\0".encode() + DIGITS.to_bytes(4, "little")
# The digest covers the file's size and so many blocks, spread evenly, with the first and the last, because a read of
# the whole file would take long: decision 49. Of a smaller file it covers all. A block is a page, the least that disks
# and caches lose. A loss in one piece of 1 / 63 of the file or more meets a block.
BLOCK, BLOCKS = 4096, 64
ROWS = 32  # written at a time, so that no whole picture is copied, and two threads have a block of compressed rows each


# (path, inode, size, time) of files that `is_whole` has looked at.
_known_whole: set[tuple[Path, int, int, int]] = set()


@dataclass(frozen=True)
class PixelRows:
    """Pixels made as they are written: shape (height, width, 4); rows(low, high) gives rows low..high - 1."""

    shape: tuple[int, int, int]
    rows: Callable[[int, int], np.ndarray]

    def __getitem__(self, part: slice) -> np.ndarray:
        return self.rows(part.start, part.stop)


def content_digest(heading: str, pixels: np.ndarray) -> str:
    """Part of a file's name that says what is in it: the same heading and float32 pixels give the same everywhere."""
    digest = hashlib.sha256(heading.encode())
    digest.update(np.ascontiguousarray(pixels, dtype=np.float32).data)
    return digest.hexdigest()[:24]


def table_file_name(heading: str, normals: np.ndarray, ending: str = "") -> str:
    """File name of a table of a map by its content: the same heading and normals give the same name on every machine.

    heading: what the table is, with its version; ending: what tells tables of the same content apart.
    """
    return f"glint_{content_digest(f'{heading} {normals.shape}', normals)}{ending}{SUFFIX}"


def list_shape(texels: int) -> tuple[int, int]:
    """(width, height) of a file for a list of `texels` texels: powers of two, one row if it can be.

    Cycles fetches exactly only at (i + 0.5) / 2^n. It reads the texel above too, unless there is none, and that is
    seldom in the processor's cache.
    """
    width = SMALLEST_WIDTH
    while width < LARGEST_WIDTH and width < texels:
        width *= 2
    return width, 1 << (-(-texels // width) - 1).bit_length()


def write_whole(
    path: Path,
    pixels: np.ndarray | PixelRows,
    *,
    half: bool = False,
    pairs: Mapping[str, Iterable[float]] | None = None,
    steps: Steps | None = None,
):
    """Write RGBA `pixels` (height, width, 4), row 0 at the bottom, to `path`: beside it first, then renamed.

    pixels: float32 array or PixelRows. half: 16-bit floats, compressed; else 32-bit and not compressed, because loading
    must not cost more than reading. pairs: {name: two floats} for the header, see `stored_pairs`. steps: counts each
    row written; an exception that its listener raises leaves no file. The file carries its digest, see `is_whole`.
    Raises TableError if the folder or the disk does not take it.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.stem}_{uuid4().hex}{path.suffix}")
        temporary.touch(exist_ok=False)  # not tempfile, whose files other users of a render farm may not read
    except OSError as error:
        raise TableError(
            f"Glint tables cannot be written to {path.parent} ({error.strerror}): "
            "save the .blend file in a folder you may write to."
        ) from error
    try:
        write_image(str(temporary), pixels, half=half, pairs=pairs, steps=steps)
        _add_digest(temporary)
        temporary.replace(path)
    except OSError as error:
        raise TableError(f"Glint table {path} cannot be written ({error.strerror}): free some disk space.") from error
    finally:
        temporary.unlink(missing_ok=True)


def is_whole(path: Path) -> bool:
    """Whether `path` is a file of `write_whole` that is as it was written: False too if it is not there or unreadable.

    Reads BLOCKS blocks of BLOCK bytes at most, whatever its size, and none of a file that was whole and did not change
    since this was asked last.
    """
    try:
        state = path.stat()
        known = path, state.st_ino, state.st_size, state.st_mtime_ns
        if known in _known_whole:
            return True
        if not path.is_file():  # to open a pipe would wait forever
            return False
        with path.open("rb", buffering=BLOCK) as file:
            place, stored, digest = _digests(file)
    except (OSError, ValueError):  # ValueError: a name that no file can have
        return False
    if not place or stored != digest:
        return False
    _known_whole.add(known)
    return True


def _add_digest(path: Path):
    """Fill in the blank digest of a file that is written but for its digest."""
    with path.open("r+b", buffering=BLOCK) as file:
        place, _, digest = _digests(file)
        file.seek(place)
        file.write(digest)


def _digests(file: BinaryIO) -> tuple[int, bytes, bytes]:
    """Where a file keeps its digest (0: nowhere), the digest written there, and the right one."""
    size = file.seek(0, SEEK_END)
    digest = hashlib.sha256(str(size).encode())
    place, stored = 0, b""
    for start in _block_starts(size):
        file.seek(start)
        block = file.read(BLOCK)
        if start == 0 and FIELD in block:
            place = block.index(FIELD) + len(FIELD)
            stored = block[place : place + DIGITS]
            block = block[:place] + BLANK.encode() + block[place + DIGITS :]
        digest.update(block)
    return place, stored, digest.hexdigest().encode()


def _block_starts(size: int) -> list[int]:
    """First byte of each block that the digest covers: whole pages, but the last block ends where the file ends."""
    if size <= BLOCK * BLOCKS:
        return list(range(0, size, BLOCK))
    last = size - BLOCK
    return [last * k // (BLOCKS - 1) // BLOCK * BLOCK for k in range(BLOCKS - 1)] + [last]


def write_image(
    path: str,
    pixels: np.ndarray | PixelRows,
    *,
    half: bool = False,
    pairs: Mapping[str, Iterable[float]] | None = None,
    steps: Steps | None = None,
):
    """Write `pixels` as `write_whole` does, in place and with a blank digest.

    Raises TableError with OpenImageIO's words if that fails.
    """
    from .openimageio import oiio

    height, width = pixels.shape[:2]
    spec = oiio.ImageSpec(width, height, 4, oiio.HALF if half else oiio.FLOAT)
    spec.attribute("compression", "zip" if half else "none")
    spec.attribute(ATTRIBUTE, BLANK)
    for name, pair in (pairs or {}).items():
        spec.attribute(name, oiio.TypeDesc(oiio.FLOAT, oiio.VEC2), tuple(map(float, pair)))
    output = oiio.ImageOutput.create(path)
    written = output is not None and output.open(path, spec)
    try:
        # Write rows from the top, as the file stores them.
        for high in range(height, 0, -ROWS):
            low = max(high - ROWS, 0)
            written = written and output.write_scanlines(height - high, height - low, 0, pixels[low:high][::-1])
            if not written:
                break
            if steps is not None:
                steps.add(high - low)
    finally:
        if output is not None:
            written = output.close() and written
    if not written:
        reason = output.geterror() if output is not None else oiio.geterror()
        raise TableError(f"Glint table {path} cannot be written ({reason}): free some disk space.")


def stored_pairs(path: Path, names: Iterable[str]) -> list[np.ndarray] | None:
    """The pairs of floats, float32 (2,), under these names in a whole file's header; None if it has not all of them.

    None too if the file is not whole.
    """
    from .openimageio import opened

    if not is_whole(path):
        return None
    with opened(path) as source:
        pairs = [source.spec().getattribute(name) for name in names] if source is not None else [None]
    return None if None in pairs else [np.array(pair, np.float32) for pair in pairs]
