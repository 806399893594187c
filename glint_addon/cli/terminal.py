"""Progress of long work in a terminal: lines on standard error, and Ctrl-C to stop it."""

from __future__ import annotations

import signal
import sys
from contextlib import contextmanager

from ..errors import CancelledError


@contextmanager
def terminal_progress():
    """Gives a function progress(fraction 0..1, text) that writes a line for each hundredth, in one thread.

    Ctrl-C within this block does not interrupt; the next call raises CancelledError, so that nothing stays half done.
    Blender's own answer to Ctrl-C, put back afterwards, would stop renders alone.
    """
    interrupts: list[int] = []  # signal numbers
    lines = [""]

    def progress(fraction: float, text: str):
        if interrupts:
            raise CancelledError("Stopped with Ctrl-C: nothing has changed, so run the command again when you like.")
        line = f"[{fraction:4.0%}] {text}"
        if line != lines[-1]:
            print(line, file=sys.stderr)
            lines.append(line)

    before = signal.signal(signal.SIGINT, lambda number, frame: interrupts.append(number))
    try:
        yield progress
    finally:
        # None: what answered before was not set by Python.
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)
