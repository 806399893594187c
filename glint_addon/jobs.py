"""Long work in steps: a generator yields what may run in any thread, and between the steps touches Blender's data."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass


@dataclass(frozen=True)
class Job:
    """A part of the work. text: what it is; start, end: which part of the whole, 0..1; work(progress=...): does it,
    in any thread, because it touches nothing of Blender; progress is called with 0..1, what it raises ends the work."""

    text: str
    start: float
    end: float
    work: Callable

    def done(self, progress: Callable[[float, str], None]):
        """Do the work now; progress(fraction of the whole, text). Returns what the work does."""
        progress(self.start, self.text)
        return self.work(progress=lambda part: progress(self.start + part * (self.end - self.start), self.text))


def finished(steps: Generator, progress: Callable[[float, str], None]):
    """Do all jobs that `steps` yields, sending it what each returns; returns what `steps` does.

    What a job or `progress` raises closes `steps` and is raised again.
    """
    with closing(steps):
        try:
            job = next(steps)
            while True:
                job = steps.send(job.done(progress))
        except StopIteration as stop:
            return stop.value
