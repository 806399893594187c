"""docs/decisions.md: a row for each decision that the code cites, whole rows, numbers that stay, real commands."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = ["number", "question and constant", "what won", "what lost, and by how much", "measured again by", "date"]
SOURCES = sorted([*ROOT.glob("osl/*"), *ROOT.glob("glint_addon/**/*.py")])
NOT_KEPT = "not kept"
REMOVED = "Removed:"
# "decision 5", "decisions 16, 17 and 29"; a comment's line may end anywhere within.
CITED = re.compile(r"[Dd]ecisions?[\s*#]+(\d+(?:(?:[\s*#]*(?:,|and))+[\s*#]+\d+)*)")
COMMAND = re.compile(r"`python -m benchmarks(?:\.(\w+)| run(?: --only (\w+(?: \w+)*))?)`")
FIGURES = re.compile(r"Measured|by numpy|us a sample")


def rows(text: str) -> list[list[str]]:
    """Cells of every row of the tables in `text`, without heads and rules."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if row != COLUMNS and not set("".join(row)) <= set("-: ")]


def cited(text: str) -> set[int]:
    """Numbers of the decisions that `text` cites."""
    return {int(number) for group in CITED.findall(text) for number in re.findall(r"\d+", group)}


DECISIONS = rows((ROOT / "docs" / "decisions.md").read_text(encoding="utf-8"))
CITATIONS = {file.relative_to(ROOT).as_posix(): cited(file.read_text(encoding="utf-8")) for file in SOURCES}
NUMBERS = {int(row[0]) for row in DECISIONS}


def test_citations_are_found_across_the_lines_of_a_comment():
    text = "/* Wide blocks blur: decision\n * 12, too: decisions 3, 4\n * and 50. */\n# slow: decision 7\n3 numbers"
    assert cited(text) == {12, 3, 4, 50, 7}


def test_every_row_has_all_columns_and_none_is_empty():
    assert len(DECISIONS) > 50
    for row in DECISIONS:
        assert len(row) == len(COLUMNS) and all(row), row
        assert re.fullmatch(r"20\d\d-\d\d-\d\d", row[-1]), row


def test_numbers_are_positive_and_each_is_given_once():
    numbers = [int(row[0]) for row in DECISIONS]
    assert len(NUMBERS) == len(numbers) and min(numbers) == 1 and max(numbers) == len(numbers)


def test_numbers_rise_within_every_table():
    text = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8")
    for section in text.split("\n## ")[1:]:
        numbers = [int(row[0]) for row in rows(section)]
        assert numbers and numbers == sorted(numbers), section.splitlines()[0]


def test_every_decision_that_the_code_cites_has_its_row():
    missing = {file: sorted(numbers - NUMBERS) for file, numbers in CITATIONS.items() if numbers - NUMBERS}
    assert not missing


@pytest.mark.parametrize("row", DECISIONS, ids=lambda row: row[0])
def test_the_files_that_a_row_names_cite_it_or_the_row_says_that_its_subject_is_gone(row):
    if row[1].startswith(REMOVED):
        return
    named = re.findall(r"\b(?:osl|glint_addon)/[\w/]+\.(?:h|osl|py)\b", row[1])
    assert named, "a row names the file of its constant"
    for file in named:
        assert int(row[0]) in CITATIONS[file], f"{file} does not cite decision {row[0]}"


@pytest.mark.parametrize("row", DECISIONS, ids=lambda row: row[0])
def test_the_constants_that_a_row_names_are_in_its_file(row):
    if row[1].startswith(REMOVED):
        return
    text = "".join((ROOT / file).read_text(encoding="utf-8")
                   for file in re.findall(r"\b(?:osl|glint_addon)/[\w/]+\.(?:h|osl|py)\b", row[1]))
    for name in re.findall(r"`(\w+)`", row[1]):
        assert re.search(rf"\b{name}\b", text), f"{name} of decision {row[0]}"


@pytest.mark.parametrize("row", DECISIONS, ids=lambda row: row[0])
def test_a_row_names_a_command_that_exists_or_says_that_none_was_kept(row):
    if row[4] == NOT_KEPT:
        return
    command = COMMAND.fullmatch(row[4])
    assert command, f"decision {row[0]}: {row[4]}"
    module, scenes = command.groups()
    if module is not None:
        source = ROOT / "benchmarks" / f"{module}.py"
        assert source.is_file() and '__name__ == "__main__"' in source.read_text(encoding="utf-8")
    for scene in (scenes or "").split():
        assert (ROOT / "benchmarks" / "scenes" / f"{scene}.py").is_file(), scene


@pytest.mark.parametrize("file", CITATIONS)
def test_no_source_holds_figures_of_experiments(file):
    assert not FIGURES.search((ROOT / file).read_text(encoding="utf-8"))
