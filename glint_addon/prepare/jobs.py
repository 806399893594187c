"""Long work in steps: a generator yields jobs that may run in any thread, and uses Blender's data between them."""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from ..errors import CancelledError, SceneError


@dataclass(frozen=True)
class Job:
    """A part of the work. text: its name for the user; start, end: its place in the whole, 0..1; work(progress=...):
    does the work in any thread, because it uses nothing of Blender; progress is called with 0..1, and an exception
    that it raises ends the work."""

    text: str
    start: float
    end: float
    work: Callable[..., Any]

    def done(self, progress: Callable[[float, str], None]) -> Any:
        """Do the work now and return its result; progress(fraction of the whole, text)."""
        progress(self.start, self.text)
        return self.work(progress=lambda part: progress(self.start + part * (self.end - self.start), self.text))


# Jobs, each to be answered with what it returns, and what they make together.
type Steps[Result] = Generator[Job, Any, Result]


def finished[Result](steps: Steps[Result], progress: Callable[[float, str], None]) -> Result:
    """Do all jobs that `steps` yields and send it the result of each; returns the value that `steps` returns.

    An exception of a job or of `progress` closes `steps` and is raised again.
    """
    with closing(steps):
        try:
            job = next(steps)
            while True:
                job = steps.send(job.done(progress))
        except StopIteration as stop:
            return stop.value


class Running[Result]:
    """Jobs that run one after the other in a thread of their own, while `step` is called now and then.

    fraction, text: the progress of the jobs; result: the value that the steps return, once `step` has returned True.
    """

    def __init__(self, steps: Steps[Result]) -> None:
        self.fraction, self.text = 0.0, ""
        self.result: Result | None = None
        self._steps = steps
        self._is_cancelled = False
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="glint")
        self._job: Future[Any] | None = None

    def step(self) -> bool:
        """Start the next job if the present one is done; returns whether all jobs are finished.

        Raises the exception of a job, CancelledError after `cancel`, SceneError if data-blocks were removed meanwhile.
        """
        if self._job is not None and not self._job.done():
            return False
        try:
            value = self._job.result() if self._job is not None else None
            self._job = self._thread.submit(self._steps.send(value).done, self._progress)
            return False
        except StopIteration as stop:
            self.result = stop.value
        except ReferenceError as error:
            self.close()
            raise SceneError("What was to be prepared is no longer in this file: prepare it again.") from error
        except BaseException:
            self.close()
            raise
        self.close()
        return True

    def cancel(self) -> None:
        """Let the running job end at its next report of progress."""
        self._is_cancelled = True

    def close(self) -> None:
        """End the jobs, wait for the running one, and remove the files that they wrote unless all are finished."""
        self.cancel()
        self._thread.shutdown(wait=True, cancel_futures=True)
        self._steps.close()

    def _progress(self, fraction: float, text: str) -> None:
        if self._is_cancelled:
            raise CancelledError("Stopped: nothing has changed, so prepare again before rendering.")
        self.fraction, self.text = fraction, text
