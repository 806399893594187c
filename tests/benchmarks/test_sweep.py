"""The sweep: walls with the footprints they say, in the material they say, under as many suns as they say."""

import numpy as np
import pytest

from benchmarks import query_scene, sweep, sweep_scene
from benchmarks.cost import Cost
from benchmarks.counters import counters
from tests.helpers.cycles import rendered

AREAS = (16, 64)  # texels, so few that every one is visited
SIDE = 64  # texels of the map
VISITED = 0.05  # relative; texels within 576 ellipses of 16 scatter by 1 %
MACHINE = {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "2000"}
COUNTS = {"visited": 16.0, "closures": 2.0, "fetches": 18.0, "hints": 1.0, "mode": "all"}


@pytest.fixture(scope="module")
def walls():
    return sweep_scene.build(query_scene.query_map("flakes", SIDE), AREAS)


@pytest.fixture(scope="module")
def counts(walls):
    """(Counts under one sun, the same of each block, the same under eight suns)."""
    sweep_scene.shine(walls, 1)
    one, blocks = counters(walls.scene, walls.material), sweep.block_counts(walls, len(AREAS))
    sweep_scene.shine(walls, sweep_scene.SUNS)
    return one, blocks, sweep.block_counts(walls, len(AREAS))


def test_only_the_glint_materials_row_of_walls_has_counters(counts):
    wanted = np.zeros((2 * query_scene.SIDE, len(AREAS) * query_scene.SIDE), bool)
    for column in range(len(AREAS)):
        wanted[sweep_scene.block(column, sweep_scene.GLINT)] = True
    np.testing.assert_array_equal(counts[0].seen, wanted)


@pytest.mark.parametrize("column", range(len(AREAS)))
def test_a_sample_visits_as_many_texels_as_the_footprint_is_said_to_have(counts, column):
    assert counts[1][column]["visited"] == pytest.approx(AREAS[column], rel=VISITED)
    assert counts[1][column]["mode"] == "all"


def test_every_sun_that_shines_is_a_hint_that_the_map_reaches_and_no_other(counts):
    assert [block["hints"] for block in counts[1]] == [1.0] * len(AREAS)
    assert [block["hints"] for block in counts[2]] == [sweep_scene.SUNS] * len(AREAS)


def test_a_border_leaves_one_wall_of_the_picture(walls):
    rows, columns = sweep_scene.block(1, sweep_scene.NODES)
    walls.scene.cycles.samples = 4
    with sweep_scene.border(walls.scene, rows, columns):
        shown = rendered(walls.scene)
    inside = np.zeros(shown.shape[:2], bool)
    inside[rows, columns] = True
    np.testing.assert_array_equal(shown[..., 3] > 0, inside)
    assert not walls.scene.render.use_border


def test_each_round_renders_every_case_once_and_rows_are_their_medians(monkeypatch):
    """Renders are replaced by a cost that depends on the material, the suns and the round."""
    seen = []

    def cost(scene, spp, start_up, *, guess, start_ups):
        row = round(scene.render.border_min_y * 2)
        suns = sum(not lamp.hide_render for lamp in scene.objects if lamp.type == "LIGHT")
        seen.append((round(scene.render.border_min_x * len(AREAS)), row, suns))
        number = seen.count(seen[-1])  # of the round
        return Cost(spp, 1, {(0, 1): 1.0, (1, 1): 3.0, (1, 8): 6.0}[row, suns] * (10.0 if number == 1 else 1.0), 0.0)

    monkeypatch.setattr(sweep, "render_cost", cost)
    monkeypatch.setattr(sweep, "block_counts", lambda walls, columns: [COUNTS] * columns)
    monkeypatch.setattr(sweep_scene, "start_up_seconds", lambda walls, row: 0.0)
    rows = sweep.curve(query_scene.query_map("flakes", SIDE), AREAS, rounds=3)
    assert seen[: len(seen) // 3] == [(0, 0, 1), (0, 1, 1), (0, 1, 8), (1, 0, 1), (1, 1, 1)]
    assert [row["area"] for row in rows] == list(AREAS)
    assert [row["ratio"] for row in rows] == pytest.approx([3.0, 3.0])
    assert rows[0]["eight_ratio"] == pytest.approx(2.0) and "eight_ratio" not in rows[1]
    assert rows[0]["nodes"] == pytest.approx(2e6 / query_scene.SIDE**2)


def row(area, one, ratio, **more):
    return {"area": area, "nodes": 1.1, "one": one, "ratio": ratio, "low": 0.9 * ratio, "high": 1.1 * ratio,
            "counts": COUNTS, **more}


def test_the_summary_is_the_worst_of_every_curve():
    curves = [
        {"map": "bumps", "texels": 64, "rows": [row(1, 9.0, 7.5, eight_ratio=2.5), row(1024, 3.0, 2.7),
                                                row(4096, 4.5, 4.1)]},
        {"map": "flakes", "texels": 64, "rows": [row(1, 2.0, 1.8, eight_ratio=3.5), row(1024, 8.0, 7.3)]},
    ]
    assert sweep.summary(curves) == {"ratio": 7.5, "flatness": 1.5, "eight": 3.5}


def test_the_table_says_what_was_measured():
    results = {"machine": MACHINE, "alpha": 0.01, "slope": 0.15, "bump_width": 8.0, "rounds": 3,
               "curves": [{"map": "bumps", "texels": 4096, "rows": [row(1024, 3.25, 2.5, eight_ratio=1.75)]}],
               "summary": {"ratio": 2.5, "flatness": 1.5, "eight": 1.75}}
    text = sweep.table(results)
    assert "| bumps 4096² | 1024 | 1.10 | 3.25 | 2.50 | 2.25 to 2.75 | 1.75 | all | 16.0 | 2.0 | 18.0 |" in text
    assert "| a sample of Glint / of Blender's nodes under OSL | 2.5 | 6 |" in text and "Abacus" in text
