"""Which tests wait for `make stress`, why, and what guards their rule in `make test` meanwhile.

`make stress` takes what is statistical: cases by the hundred, means with many samples or seeds, stored truths, tables
of the benchmark. `make test` takes all else. Nothing waits alone: package/test_two_suites.py checks that each waiting
test names one that does not, or is one parameter of several of which another runs at once.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

import pytest


def stress(reason: str, *, fast: Collection[str] = ()) -> pytest.MarkDecorator:
    """A mark that leaves a test, a parameter or a file (as `pytestmark`) to `make stress`.

    fast: "room/test_file.py::test_name" under tests/, of tests in `make test` that guard the same rule; without any, it
    is the same test with other parameters.
    """
    return pytest.mark.stress(reason=reason, fast=tuple(fast))


def thinned(values: Iterable, kept: Collection, reason: str) -> list:
    """`values` as parameters of a test, of which `make test` runs those in `kept` and `make stress` the others.

    A tuple holds a value for each of several arguments.
    """
    mark = stress(reason)
    return [value if value in kept else pytest.param(*_arguments(value), marks=mark) for value in values]


def _arguments(value) -> tuple:
    return value if isinstance(value, tuple) else (value,)
