"""Progress of a bake, reported to a listener, which may end the bake by raising an exception."""

from __future__ import annotations

from collections.abc import Callable

STEPS = 200  # most reports of a bake, because a listener that draws a bar takes a millisecond or more


class Steps:
    """Counts work and passes on the part of `whole` that is done, 0..1, whenever it has grown by 1 / STEPS.

    progress: called with that part; an exception that it raises ends the work. None: there is no listener.
    start, end: the parts to report before the first and after the last of the work.
    """

    def __init__(self, progress: Callable[[float], None] | None, whole: int, start: float = 0.0, end: float = 1.0):
        self.progress, self.whole, self.start, self.end = progress, whole, start, end
        self.done, self.told = 0, start

    def add(self, work: int):
        """Count `work` more, in units of `whole`."""
        self.done += work
        part = self.start + (self.end - self.start) * min(self.done / self.whole, 1.0)
        if self.progress is not None and (part - self.told >= 1 / STEPS or self.done >= self.whole):
            self.told = part
            self.progress(part)
