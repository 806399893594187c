"""The first layer of a layered OpenEXR file, which is what Cycles shows of it.

Source: Cycles, scene/image_oiio.cpp: the first four channels of the first part, in OpenImageIO's order.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..errors import MapError

CHANNELS = 4  # that Cycles reads at most


def layer_shape(path: Path, contents: bytes | None = None) -> tuple[int, int, int]:
    """(height, width, channels) of the first layer; (0, 0, 0) if there is none. contents: of the file, if at hand."""
    with _opened(path, contents) as source:
        if source is None:
            return 0, 0, 0
        spec = source.spec()
        return spec.height, spec.width, min(spec.nchannels, CHANNELS)


def first_layer(path: Path, contents: bytes | None = None) -> np.ndarray:
    """Pixels of the first layer as they are stored, float32 (height, width, channels), row 0 at the bottom.

    Raises MapError with OpenImageIO's words if the file is damaged.
    """
    from .openimageio import oiio

    with _opened(path, contents) as source:
        if source is None:
            raise MapError(f"Layered image {path} cannot be opened: choose another file.")
        pixels = source.read_image(0, 0, 0, min(source.spec().nchannels, CHANNELS), oiio.FLOAT)
        if pixels is None:
            raise MapError(f"Layered image {path} cannot be read ({source.geterror()}): export it again.")
    return np.ascontiguousarray(pixels[::-1])


@contextmanager
def _opened(path: Path, contents: bytes | None) -> Iterator[Any]:
    """OpenImageIO's reader of the file, or None; it reads from disk alone.

    Raises MapError if the temporary folder does not take the contents.
    """
    from .openimageio import opened

    with TemporaryDirectory(prefix="glint-") as folder:
        if contents is not None:
            path = Path(folder) / (path.name or "layers.exr")
            try:
                path.write_bytes(contents)
            except OSError as error:
                raise MapError(f"Layered image {path.name} cannot be unpacked ({error.strerror}): free some disk space."
                               ) from error
        with opened(path) as source:
            yield source
