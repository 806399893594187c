"""Standard output for results alone: what Blender prints, from C and from Python, goes to standard error."""

import contextlib
import ctypes
import os
import sys


@contextlib.contextmanager
def blender_talks_to_stderr():
    """Within this block whatever is printed, by Python or by Blender, goes to standard error."""
    _flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        _flush()
        os.dup2(kept, 1)
        os.close(kept)


def _flush() -> None:
    sys.stdout.flush()
    # What Blender has printed may still wait in the C library's own buffer.
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)
    library.fflush(None)
