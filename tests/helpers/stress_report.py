"""`pytest --stress-report FILE`: every stress case of the session and its outcome, as JSON that a rerun repeats.

The file holds {"blender": version, "cases": [{group, case, outcome, nodes, lobe, deviations, note}, ...]}, sorted.
Workers of pytest-xdist send their lines with the reports of their tests; only the controlling process writes.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import bpy
import pytest

OPTION = "--stress-report"
PROPERTY = "stress case"
DIGITS = 3  # significant ones: beyond, threads that add in another order may show
_LINES = pytest.StashKey[list]()


def pytest_addoption(parser):
    """The option."""
    parser.addoption(OPTION, metavar="FILE", type=Path, help="write the outcome of every stress case as JSON")


def pytest_configure(config):
    """Start with no lines."""
    config.stash[_LINES] = []
    config.pluginmanager.register(_Collector(config), "stress report")


@pytest.fixture
def stress_record(request):
    """record(outcome=, nodes=, lobe=, deviations=, case="", note=""): add a line about the test that asks for it.

    Group and case are taken from the test's file and name; `case` tells several lines of one test apart.
    """

    def record(*, outcome, nodes=math.nan, lobe=math.nan, deviations=math.nan, case="", note=""):
        group = request.module.__name__.rpartition(".")[2].removeprefix("test_")
        name = request.node.name.removeprefix("test_").replace("_", " ").replace("[", ": ").removesuffix("]")
        request.node.user_properties.append((PROPERTY, {
            "group": group,
            "case": f"{name}: {case}" if case else name,
            "outcome": outcome,
            "nodes": _rounded(nodes),
            "lobe": _rounded(lobe),
            "deviations": None if not math.isfinite(deviations) else round(float(deviations), 1) + 0.0,
            "note": note,
        }))

    return record


class _Collector:
    """Gathers the lines from the reports of the tests, wherever these ran."""

    def __init__(self, config):
        self.config = config

    def pytest_runtest_logreport(self, report):
        if report.when == "call":
            for key, value in report.user_properties:
                if key == PROPERTY:
                    fails = report.failed and value["outcome"] == "agrees"
                    self.config.stash[_LINES].append(value | ({"outcome": "the test fails"} if fails else {}))

    def pytest_sessionfinish(self):
        file = self.config.getoption(OPTION)
        is_run = not self.config.option.collectonly  # or the stored report would be emptied
        if file is not None and is_run and not hasattr(self.config, "workerinput"):
            lines = sorted(self.config.stash[_LINES], key=lambda line: (line["group"], line["case"]))
            _write(file, {"blender": bpy.app.version_string, "cases": lines})


def _rounded(value):
    """`value` to DIGITS significant digits; None where there is no number, which JSON cannot write."""
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def _write(file, content):
    """Write JSON that appears whole or not at all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(file.name + ".part")
    part.write_text(json.dumps(content, indent=1) + "\n")
    part.replace(file)
