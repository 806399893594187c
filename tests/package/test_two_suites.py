"""`make test` and `make stress` together run every test, and what waits for `make stress` does not wait alone."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Collects the tests with the arguments of each target, in one process, and writes {target: [[id, facts], ...]}.
_COLLECT = """
import json, sys, pytest

class Noted:
    def __init__(self):
        self.chosen = []

    def pytest_collection_finish(self, session):
        for item in session.items:
            mark = item.get_closest_marker("stress")
            facts = {"mark": mark.kwargs if mark else None, "is_in_table": "stress_record" in item.fixturenames}
            self.chosen.append([item.nodeid, facts])

found = {}
for target, arguments in json.loads(sys.argv[1]).items():
    noted = Noted()
    code = pytest.main(["--collect-only", "-qq", *arguments], plugins=[noted])
    assert code == 0, f"collecting for {target} ended with {code}"
    found[target] = noted.chosen
with open(sys.argv[2], "w") as file:
    json.dump(found, file)
"""


def recipe(target: str) -> str:
    """The lines that the Makefile runs for a target."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    return re.search(rf"^{target}:.*\n((?:\t.*\n)+)", text, re.MULTILINE)[1]


def arguments(target: str) -> list[str]:
    """What a target gives pytest where ARGS are empty."""
    line = recipe(target).partition("\n")[0].partition("$(PYTEST) ")[2]
    return shlex.split(re.sub(r"\$\(if .*,,(.*)\)\$\(ARGS\)", r"\1", line))


@pytest.fixture(scope="module")
def collected(tmp_path_factory) -> dict:
    """What each target collects, and all there is: {target: {id: {mark: its arguments, is_in_table}}}.

    All 3,000 tests are imported in a process of its own, once: 8 s of processor time.
    """
    file = tmp_path_factory.mktemp("collected") / "tests.json"
    given = {"test": arguments("test"), "stress": arguments("stress"), "all": []}
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-c", _COLLECT, json.dumps(given), str(file)]
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout[-2000:] + ended.stderr[-2000:]
    return {target: dict(found) for target, found in json.loads(file.read_text(encoding="utf-8")).items()}


def test_the_targets_choose_by_the_mark():
    assert arguments("test") == ["-m", "not stress"]
    assert arguments("stress") == ["-m", "stress", "tests", "--stress-report", "benchmarks/results/stress.json"]


def test_every_test_is_in_one_of_both_suites(collected):
    fast, slow = set(collected["test"]), set(collected["stress"])
    assert fast | slow == set(collected["all"])
    assert not fast & slow and len(fast) > len(slow) > 0


def test_a_test_that_waits_says_why_and_another_guards_its_rule_meanwhile(collected):
    at_once = {name.removeprefix("tests/").partition("[")[0] for name in collected["test"]}
    for name, facts in collected["stress"].items():
        mark = facts["mark"]
        own = name.removeprefix("tests/").partition("[")[0]
        assert mark["reason"], name
        assert set(mark["fast"] or [own]) <= at_once, f"{name} waits alone: {mark['fast']}"


def test_the_table_of_stress_cases_has_all_that_are_recorded(collected):
    """But for those of one_of_each, which are in it already, as cases of their groups."""
    others = {name.partition("[")[0] for name, facts in collected["test"].items() if facts["is_in_table"]}
    assert {name.partition("::")[0] for name in others} == {"tests/stress/test_one_of_each.py"}


def test_continuous_integration_runs_both_suites_and_the_checks_of_style():
    called = re.findall(r"make (\w+)", (ROOT / ".ci" / "run").read_text(encoding="utf-8"))
    assert called == ["lint", "test", "stress"]
