"""The benchmark of the generators measures every kind, and its table says what was measured."""

from benchmarks import generate
from glint_addon.generate import GENERATORS

MACHINE = {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "2000"}


def test_every_generator_is_measured_at_both_sizes():
    assert {case.kind for case in generate.CASES.values()} == set(GENERATORS)
    found = generate.run({"Dents": GENERATORS["DENTS"]()}, full=128, preview=64, repeats=1)
    (row,) = found["rows"]
    assert row["name"] == "Dents" and row["preview_seconds"] > 0 and 0 < row["seconds"] < generate.BOUND
    assert (found["full"], found["preview"]) == (128, 64)


def test_the_table_names_seconds_bound_and_machine():
    rows = [{"name": "Dents", "seconds": 0.456, "preview_seconds": 0.0123}]
    text = generate.table({"machine": MACHINE, "bound": 5.0, "full": 2048, "preview": 256, "rows": rows})
    assert "| Dents | 0.46 | 0.012 |" in text and "Bound: 5 s" in text and "Abacus" in text
    assert "2048 x 2048" in text and "256 x 256" in text
