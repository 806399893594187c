"""Memory in words: one unit, and no exponents."""

import pytest

from glint_addon.operators.prepare import counts_line
from glint_addon.prepare.memory import DEFAULT_BUDGET, MIB, mebibytes
from glint_addon.prepare.report import Report, ReportCounts


@pytest.mark.parametrize(("count", "words"), [
    (0, "0 MiB"), (1000, "0.000954 MiB"), (2**14, "0.0156 MiB"), (1.5 * MIB, "1.5 MiB"), (12.345 * MIB, "12.3 MiB"),
    (999.4 * MIB, "999 MiB"), (999.9 * MIB, "1000 MiB"), (DEFAULT_BUDGET * MIB, "2048 MiB"), (2**40, "1048576 MiB"),
])
def test_memory_is_said_in_mebibytes_without_an_exponent(count, words):
    assert mebibytes(count) == words


def test_the_line_of_counts_says_memory_in_the_unit_of_the_budget():
    report = Report(counts=ReportCounts(1, 3, MIB, 2048 * MIB, 1))
    assert counts_line(report) == "Tables: 1 baked (1 MiB), 3 in use (2048 MiB), 1 image read."
