"""The benchmark of a scene with nothing to do measures what it says."""

import pytest

from benchmarks import no_hints
from benchmarks.counters import REASONS, counters


@pytest.mark.parametrize(("name", "reason"), [(no_hints.WITHOUT, "NO_HINT"), (no_hints.UNREACHED, "NOT_REACHED")])
def test_every_sample_leaves_early_for_the_reason_in_the_name(name, reason):
    scene, plane, sun, materials = no_hints.build("CLOSEST")
    scene.render.resolution_percentage = 25
    material, is_hinted = materials[name]
    no_hints.use(scene, plane, sun, material, is_hinted)
    seen = counters(scene, material)
    assert seen.seen.all() and seen.share_left_early == 1.0
    assert {REASONS[reason] for reason in seen.reason.ravel()} == {reason}


def test_the_table_names_each_map_and_material_with_its_ratio():
    numbers = {"microseconds": 1.5, "ratio": 1.04, "low": 1.01, "high": 1.1}
    machine = {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "2000"}
    results = {"machine": machine, "bound": 1.3, "rounds": 9, "cases": {"CLOSEST": {no_hints.WITHOUT: numbers}}}
    text = no_hints.table(results)
    assert f"| Closest | {no_hints.WITHOUT} | 1.50 | 1.04 | 1.01 to 1.10 |" in text and "Abacus" in text
