"""Pixels -> the bytes of an image file that holds them exactly."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

import numpy as np

from ..errors import MapError


def image_bytes(pixels: np.ndarray, *, is_float: bool, name: str, bits: int = 8) -> bytes:
    """A file of `pixels`, float32 (height, width, channels), row 0 at the bottom: OpenEXR of 32-bit floats, else PNG.

    bits: of a channel of a PNG, 8 or 16; Blender reads 16 as floats. name: of the image, for the MapError if the
    temporary folder does not take the file.
    """
    from .openimageio import oiio

    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.FLOAT if is_float else {8: oiio.UINT8, 16: oiio.UINT16}[bits])
    spec.attribute("compression", "zips")  # faster than "zip": decision 50
    spec.attribute("png:compressionLevel", 1)  # higher levels hardly compress random facets further: decision 51
    spec.attribute("oiio:UnassociatedAlpha", 1)  # the colours are values: alpha must not scale them
    try:
        with TemporaryDirectory(prefix="glint-") as folder:
            path = Path(folder) / ("pixels.exr" if is_float else "pixels.png")
            _write(oiio, str(path), spec, np.ascontiguousarray(pixels[::-1]))
            return path.read_bytes()
    except OSError as error:
        reason = error.strerror or error
        raise MapError(f'Image "{name}" cannot be copied ({reason}): free some disk space.') from error


def _write(oiio: ModuleType, path: str, spec: Any, pixels: np.ndarray):
    """Write `pixels` to a file. Raises OSError with OpenImageIO's words if that fails."""
    output = oiio.ImageOutput.create(path)
    if output is None:
        raise OSError(oiio.geterror())
    written = output.open(path, spec) and output.write_image(pixels)
    if not (output.close() and written):
        raise OSError(output.geterror())
