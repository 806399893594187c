"""Float images on disk that appear whole or not at all."""

from __future__ import annotations

from pathlib import Path
from uuid import uuid4

import numpy as np

from ..errors import TableError


def write_whole(path: Path, pixels: np.ndarray, *, half: bool = False):
    """Write RGBA `pixels` (height, width, 4), row 0 at the bottom, to `path`: beside it first, then renamed.

    half: 16-bit floats, compressed; else 32-bit and not compressed, because loading must not cost more than reading.
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
        write_image(str(temporary), pixels, half=half)
        temporary.replace(path)
    except OSError as error:
        raise TableError(f"Glint table {path} cannot be written ({error.strerror}): free some disk space.") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_image(path: str, pixels: np.ndarray, *, half: bool = False):
    """Write `pixels` as `write_whole` does, in place; TableError with OpenImageIO's words if that fails."""
    from .openimageio import oiio

    height, width = pixels.shape[:2]
    spec = oiio.ImageSpec(width, height, 4, oiio.HALF if half else oiio.FLOAT)
    spec.attribute("compression", "zip" if half else "none")
    output = oiio.ImageOutput.create(path)
    written = output is not None and output.open(path, spec) and output.write_image(pixels[::-1])
    if output is not None:
        written = output.close() and written
    if not written:
        reason = output.geterror() if output is not None else oiio.geterror()
        raise TableError(f"Glint table {path} cannot be written ({reason}): free some disk space.")
