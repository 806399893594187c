"""Each function of osl/counts_cells.h, and two of counts.h that ask for cells, against its twin.

Where one function needs another's answer, its twin is given what OSL answered, so that one error fails one test.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from glint_addon.bake import counts as bake
from glint_addon.bake import float_image
from tests.helpers.normals import random_normals
from tests.helpers.osl_functions import EPSILON, ROUNDING, ROWS, Inputs, assert_whole_agree
from tests.reference import counts_cells as twin
from tests.reference.random_inputs import cells_inputs, footprint_inputs, hint_inputs, matrices, random_axes

HEADER = "counts_cells.h"
GRID = ("columns", "rows", "start1", "start2", "stride1", "stride2", "end1", "end2")
CELLS = ("centre1", "centre2", "reach1", "reach2", "a11", "a12", "a21", "a22", "p11", "p12", "p21", "p22", "tilt1",
         "tilt2")
VIEW = ("I[0]", "I[1]", "I[2]")


def matrix(osl, name):
    """A matrix (n, 2, 2) of OSL's fields NAME11 ... NAME22."""
    return osl.stacked(*(f"{name}{i}{j}" for i in (1, 2) for j in (1, 2))).reshape(-1, 2, 2)


def osl_grid(osl, name):
    """OSL's grid as a namespace."""
    return SimpleNamespace(**{field: osl[f"{name}.{field}"] for field in GRID})


AROUND = """
  Grid none = { 0, 0, 0, 0, 1, 1, 0, 0 };
  Cells cells;
  cells.grid = none;
  cells.reach1 = 0;
  cells.reach2 = 0;
  int is_known = bins_around(hint, counts, level, strength, cells);
  if (is_known) {
    cover_region(hint, alpha, cells);
    lay_grid(hint, alpha, level, numbers, cells);
  }
  Grid grid = cells.grid;
  Map map;
  map.variation = 0; map.cut_u = 0; map.cut_v = 0;
  map.counts = counts;
  map.strength = strength;
  Facet facet;
  facet.alpha = alpha;
  Query query;
  query.facet = facet;
  query.random = numbers;
  query.hints[3] = hint;
  Cells whole = hint_cells(query, 3, map, level);
  Grid whole_grid = whole.grid;
"""


@pytest.fixture(scope="module")
def around():
    """Cells around random half vectors, some near or below the horizon."""
    rng = np.random.default_rng(1)
    inputs = Inputs()
    slopes = rng.uniform(-0.6, 0.6, (ROWS, 2))
    slopes[:150] *= 10.0 ** rng.uniform(0, 2.5, (150, 1))
    hint = hint_inputs(rng, inputs, "hint", slopes)
    corners = inputs.structure("Level", "level", corners=rng.choice([28, 46, 64, 90, 128, 168, 208], ROWS)).corners
    box = rng.uniform(0.2, 0.9, (2, ROWS, 3)) * [[[-1.0]], [[1.0]]]
    counts = inputs.structure("Counts", "counts", low=box[0], high=box[1])
    strength = rng.choice([1.0, 1.0, 0.0, np.nan], ROWS, p=[0.2, 0.2, 0.05, 0.55])
    strength = inputs.add("strength", np.where(np.isnan(strength), rng.uniform(-0.5, 2.5, ROWS), strength))
    alpha = inputs.add("alpha", hint.radius / rng.uniform(2.5, 4, ROWS))
    random = inputs.add("numbers", rng.uniform(0, 1, (ROWS, 3)))
    results = ["is_known", *VIEW, *(f"cells.{name}" for name in CELLS), *(f"grid.{name}" for name in GRID),
               *(f"whole.{name}" for name in CELLS), *(f"whole_grid.{name}" for name in GRID)]
    osl = inputs.call(HEADER, AROUND, results)
    return SimpleNamespace(osl=osl, hint=hint, corners=corners, low=counts.low, high=counts.high, strength=strength,
                           alpha=alpha, random=random, view=osl.stacked(*VIEW), known=osl["is_known"] != 0)


def test_the_bins_around_a_half_vector(around):
    osl = around.osl
    known, z, expected = twin.bins_around(around.hint.forms, around.low, around.high, around.corners, around.strength)
    assert 0.6 < known.mean() < 0.97
    assert_whole_agree(around.known, known, (np.abs(z - twin.NUMBERS["LEAST_HEIGHT"]) > 1e-5) | (around.strength == 0))
    known &= around.known
    # Slopes are quotients by the height, and their changes by its square.
    tolerance = ROUNDING * np.linalg.cond(around.hint.forms) / z**2
    bins = (around.corners - 1) / (around.high - around.low)[:, :2].min(axis=1)
    gain = np.abs(expected.a).max(axis=(1, 2)) / bins + 1
    for name, size in (("centre", bins * gain), ("tilt", 1.0)):
        found = osl.stacked(f"cells.{name}1", f"cells.{name}2")
        error = np.abs(found - getattr(expected, name)).max(axis=1) / size
        assert (error < tolerance)[known].all(), name
    lost = tolerance * np.linalg.cond(expected.a)
    for name, limit in (("a", tolerance), ("p", lost)):
        wanted = getattr(expected, name)
        error = np.abs(matrix(osl, f"cells.{name}") - wanted).max(axis=(1, 2)) / np.abs(wanted).max(axis=(1, 2))
        assert (error < limit)[known].all(), name
    assert np.median(lost[known]) < 1e-3


def test_a_slope_is_the_quotient_that_the_cells_say(around):
    """p = l / (1 - l . tilt) for l by the linear map from bins, whatever the slope."""
    osl, known = around.osl, around.known & (around.strength == 1)
    p = np.random.default_rng(2).uniform(-0.2, 0.2, (ROWS, 2))
    n = twin.normal_of(around.hint.forms, p)
    bins = (around.corners[:, None] - 1) / (around.high - around.low)[:, :2]
    at = (n[:, :2] / n[:, 2:] - around.low[:, :2]) * bins
    linear = np.einsum("nij,nj->ni", matrix(osl, "cells.p"), at - osl.stacked("cells.centre1", "cells.centre2"))
    found = linear / (1 - (linear * osl.stacked("cells.tilt1", "cells.tilt2")).sum(axis=1))[:, None]
    known &= n[:, 2] > 0.3
    assert known.sum() > 100
    assert (np.abs(found - p).max(axis=1) < 1e-3)[known].all()


def test_the_region_is_an_ellipse_that_the_view_flattens(around):
    osl, hint = around.osl, around.hint
    a = matrix(osl, "cells.a")
    expected = twin.cover_region(a, hint.h, hint.t1, hint.t2, around.view, hint.radius, around.alpha)
    found = osl.stacked("cells.reach1", "cells.reach2")
    # The plane of incidence has the direction of what is left of I across h.
    left = np.linalg.norm([np.einsum("nk,nk->n", axis, around.view) for axis in (hint.t1, hint.t2)], axis=0)
    size = hint.radius * np.linalg.norm(a, axis=(1, 2))
    assert (np.abs(found - expected).max(axis=1) < ROUNDING / left * size)[around.known].all()
    assert np.median(left) > 0.1


def assert_grids_agree(osl, expected, is_clear, name):
    is_laid = (expected.columns > 0) | (osl[f"{name}.columns"] > 0)
    for field in GRID:
        if not field.startswith("stride"):
            assert_whole_agree(osl[f"{name}.{field}"][is_clear], getattr(expected, field)[is_clear], True)
        else:
            laid = is_clear & is_laid
            assert_whole_agree(osl[f"{name}.{field}"][laid], getattr(expected, field)[laid], True)


def test_the_grid_of_cells_over_a_region(around):
    osl, known = around.osl, around.known
    cells = SimpleNamespace(
        a=matrix(osl, "cells.a"), p=matrix(osl, "cells.p"), centre=osl.stacked("cells.centre1", "cells.centre2"),
        reach=osl.stacked("cells.reach1", "cells.reach2"),
    )
    expected, is_clear = twin.lay_grid(cells, around.hint.turn, around.alpha, around.corners, around.random)
    is_clear &= known
    assert is_clear.sum() > 0.9 * known.sum()
    assert_grids_agree(osl, expected, is_clear, "grid")
    assert 0.05 < (expected.columns[is_clear] == 0).mean() < 0.9
    # No grid has more cells than the arrays of counts.h.
    assert (osl["grid.columns"] * osl["grid.rows"] <= twin.NUMBERS["MOST_CELLS"]).all()
    assert (np.maximum(osl["grid.columns"], osl["grid.rows"]) < twin.NUMBERS["MOST_CELL_CORNERS"]).all()


def test_the_cells_of_a_hint_are_laid_from_its_half_vector(around):
    osl = around.osl
    expected, is_clear, known = twin.hint_cells(around.hint, around.view, around.low, around.high, around.corners,
                                                around.strength, around.alpha, around.random)
    is_clear &= known == around.known
    assert is_clear.mean() > 0.6
    assert_grids_agree(osl, expected.grid, is_clear, "whole_grid")
    np.testing.assert_allclose(osl.stacked("whole.reach1", "whole.reach2")[is_clear], expected.reach[is_clear],
                               rtol=1e-3)
    # The same as its parts, bit by bit.
    for name in [f"cells.{name}" for name in CELLS]:
        whole = osl[name.replace("cells", "whole")]
        np.testing.assert_array_equal(whole[around.known], osl[name][around.known])
    assert not osl["whole_grid.columns"][~around.known].any()


ROW = """
  int lowest, highest;
  float span = region_span(centre, reach, turn, corners, lowest, highest);
  int count, start, end;
  lay_row(from, to, stride, share, count, start, end);
"""


@pytest.fixture(scope="module")
def row():
    """Random rows of cells: (OSL's results, arguments of region_span, arguments of lay_row)."""
    rng = np.random.default_rng(3)
    inputs = Inputs()
    corners = rng.choice([28, 64, 208], ROWS)
    span = [inputs.add(name, values) for name, values in (
        ("centre", rng.uniform(-0.3, 1.3, ROWS) * corners), ("reach", rng.uniform(0, 0.3, ROWS) * corners),
        ("turn", rng.uniform(1, 6, ROWS)), ("corners", corners),
    )]
    start = rng.integers(-7, 200, ROWS)
    lay = [inputs.add(name, values) for name, values in (
        ("from", start), ("to", start + rng.integers(0, 50, ROWS)), ("stride", rng.integers(1, 12, ROWS)),
        ("share", rng.uniform(0, 1, ROWS)),
    )]
    return inputs.call(HEADER, ROW, ("span", "lowest", "highest", "count", "start", "end")), span, lay


def test_the_bins_of_a_region_that_elements_can_reach(row):
    osl, (centre, reach, turn, corners), _ = row
    lowest, highest, span, is_clear = twin.region_span(centre, reach, turn, corners)
    np.testing.assert_allclose(osl["span"], span, atol=4 * EPSILON * 400)
    assert 0.05 < (span == 0).mean() < 0.5
    assert_whole_agree(osl["lowest"], lowest, is_clear)
    assert_whole_agree(osl["highest"], highest, is_clear)


def test_a_row_of_cells_covers_all_bins_and_begins_at_random(row):
    osl, _, arguments = row
    count, start, end, is_clear = twin.lay_row(*arguments)
    for name, values in (("count", count), ("start", start), ("end", end)):
        assert_whole_agree(osl[name], values, is_clear)
    lowest, highest, stride, _ = arguments
    assert ((osl["start"] <= lowest) & (osl["end"] > highest)).all()
    assert ((lowest - osl["start"] < stride) & (osl["end"] - highest <= stride)).all()


def random_bins(rng, count, size):
    """Fields a11 ... a22 (count, n) of cells, bins per slope."""
    return {f"a{i}{j}": rng.normal(size=(count, ROWS)) * size for i in (1, 2) for j in (1, 2)}


SELECT = """
  int within = cell_is_within(cells_2, i, j);
  int selected = cell_is_selected(cells, 2, i, j);
  int move1, move2;
  cell_move(hint, cells_2, offset_u, offset_v, move1, move2);
"""


@pytest.fixture(scope="module")
def selected():
    """Cells of three hints, of which the third is asked for: (OSL's results, cells, i, j, turns, offset)."""
    rng = np.random.default_rng(4)
    inputs = Inputs()
    cells = cells_inputs(rng, inputs, 3, **random_bins(rng, 3, 30))
    i, j = (inputs.add(name, rng.integers(0, np.maximum(size, 1)))
            for name, size in (("i", cells[2].grid.columns), ("j", cells[2].grid.rows)))
    turns = 1e-2 * rng.normal(size=(2, 2, ROWS))
    hint = inputs.structure("HalfVector", "hint", turn_u1=turns[0, 0], turn_v1=turns[0, 1], turn_u2=turns[1, 0],
                            turn_v2=turns[1, 1])
    turns = matrices([[hint.turn_u1, hint.turn_v1], [hint.turn_u2, hint.turn_v2]])
    offset = np.stack([inputs.add(f"offset_{name}", rng.uniform(-30, 30, ROWS)) for name in ("u", "v")], axis=1)
    return inputs.call(HEADER, SELECT, ("within", "selected", "move1", "move2")), cells, i, j, turns, offset


def test_a_cell_within_a_region(selected):
    osl, cells, i, j, _, _ = selected
    own = cells[2]
    expected, margin = twin.cell_is_within(own.grid, own.centre, own.reach, i, j)
    assert_whole_agree(osl["within"], expected, np.abs(margin) > 1e-4)


def test_a_cell_is_selected_where_no_earlier_hint_has_its_bins(selected):
    osl, cells, i, j, _, _ = selected
    grids = [own.grid for own in cells]
    expected = [twin.cell_is_selected(grids, row, 2, i[row], j[row], osl["within"][row]) for row in range(ROWS)]
    assert 0.2 < np.mean(expected) < 0.9 * osl["within"].mean()
    assert_whole_agree(osl["selected"], expected, True)


def test_cells_move_as_the_surface_turns(selected):
    osl, cells, _, _, turns, offset = selected
    own = cells[2]
    expected, is_clear = twin.cell_move(own.a, turns, offset)
    assert_whole_agree(osl["move1"], expected[:, 0], is_clear, least=0.9)
    assert_whole_agree(osl["move2"], expected[:, 1], is_clear, least=0.9)


HINTS = 2
COUNTED = """
  map.counts = counts;
  int counted = hit_is_counted(query, cells, level, map, hit);
"""


def test_a_hit_is_counted_where_its_bin_is_in_a_selected_cell():
    rng = np.random.default_rng(5)
    inputs = Inputs()
    inputs.statements.append("Query query; Map map; Level level; Counts counts; Hit hit;")
    cells = cells_inputs(rng, inputs, HINTS, **random_bins(rng, HINTS, 15))
    hints = []
    for k in range(HINTS):
        hints.append(hint_inputs(rng, inputs, f"hint_{k}", rng.uniform(-0.5, 0.5, (ROWS, 2)), turn=1e-2))
        inputs.statements.append(f"query.hints[{k}] = hint_{k};")
    inputs.fill("query", hint_count=np.full(ROWS, HINTS))
    sizes = np.stack(list(vars(inputs.fill("map", width=rng.integers(20, 60, ROWS),
                                           height=rng.integers(20, 60, ROWS))).values()), axis=1)
    groups = rng.integers(1, 6, (ROWS, 2))
    level = inputs.fill("level", columns=groups[:, 0], rows=groups[:, 1], corners=rng.choice([28, 46, 64], ROWS),
                        group_u=sizes[:, 0] / groups[:, 0], group_v=sizes[:, 1] / groups[:, 1])
    box = rng.uniform(0.3, 0.6, (2, ROWS, 3)) * [[[-1.0]], [[1.0]]]
    counts = inputs.fill("counts", low=box[0], high=box[1])
    # Linear begins half a texel before the map. Half of the hits lie in the texels where one group ends and the next
    # begins.
    place = rng.uniform(-0.5, sizes - 0.5)
    ends = (rng.integers(1, groups + 1) * sizes // groups - rng.integers(0, 2, (ROWS, 2))) % sizes
    place[::2] = (ends + rng.uniform(0, 1, (ROWS, 2)))[::2]
    hit = inputs.fill("hit", u=place[:, 0], v=place[:, 1])
    place = np.stack([hit.u, hit.v], axis=1)
    whole = np.floor(place)
    texel = np.mod(whole, sizes).astype(int)
    inputs.fill("hit", i=whole[:, 0], j=whole[:, 1], column=texel[:, 0], row=texel[:, 1])
    # About the cells of one hint, which move by a few bins.
    own = [cells[k].grid for k in range(HINTS)]
    start, end = (np.choose(np.arange(ROWS)[:, None] % HINTS, [
        np.stack([getattr(grid, f"{name}1"), getattr(grid, f"{name}2")], axis=1) for grid in own])
        for name in ("start", "end"))
    bins = rng.uniform(start - 0.3, end + 0.3)
    slopes = counts.low[:, :2] + bins / (level.corners - 1)[:, None] * (counts.high - counts.low)[:, :2]
    normals = np.append(slopes, np.ones((ROWS, 1)), axis=1) * rng.uniform(0.3, 1, (ROWS, 1))
    normals[:40] *= -1
    unscaled = inputs.fill("hit", unscaled=normals).unscaled
    osl = inputs.call("counts.h", COUNTED, ("counted",))["counted"]

    expected, is_clear = twin.hit_is_counted(hints, cells, counts.low, counts.high, level.corners, sizes, groups,
                                             texel, place, unscaled)
    assert 0.1 < expected.mean() < 0.9 and not expected[:40].any()
    assert_whole_agree(osl, expected, is_clear, least=0.9)


MAP = 512
LEVELS = (32, 256)
SERVE = """
  counts.table = "{file}";
  map.counts = counts;
  map.costs.fetches = 5;
  query.facet = facet;
  query.footprint = footprint;
  Level level;
  Cells cells[HINT_COUNT];
  int serves = counts_serve(map, query, widest, level, cells);
  int block = 0;
  float reach1 = 0;
  float reach2 = 0;
  if (serves) {{
    block = level.block;
    Cells first = cells[0];
    reach1 = first.reach1;
    reach2 = first.reach2;
  }}
  counts.table = "/no/such/file.exr";
  map.counts = counts;
  int missing_serves = counts_serve(map, query, widest, level, cells);
"""


def test_counts_serve_from_the_level_on_whose_bins_are_narrow_enough(tmp_path):
    rng = np.random.default_rng(6)
    normals = random_normals(MAP, MAP)
    normals[..., 2] = 1
    low, high = bake.slope_box(normals)
    float_image.write_whole(tmp_path / "c.exr", bake.counts_texels(normals, "LINEAR", LEVELS, (low, high)))
    inputs = Inputs()
    inputs.statements.append("Query query; Map map;")
    box = np.append([low, high], np.zeros((2, 1)), axis=1)
    counts = inputs.structure("Counts", "counts", first=np.full(ROWS, LEVELS[0]), levels=np.full(ROWS, 4),
                              low=np.tile(box[0], (ROWS, 1)), high=np.tile(box[1], (ROWS, 1)))
    strength = np.where(rng.random(ROWS) < 0.5, 1.0, rng.uniform(0.3, 2, ROWS))
    own = inputs.fill("map", width=np.full(ROWS, MAP), height=np.full(ROWS, MAP), is_linear=np.ones(ROWS, int),
                      strength=strength)
    footprint = footprint_inputs(inputs, random_axes(rng, largest=1.4, thin=1.2) * 20)
    hints = []
    for k in range(2):
        hints.append(hint_inputs(rng, inputs, f"hint_{k}", rng.uniform(-0.6, 0.6, (ROWS, 2)), largest_turn=2.2))
        inputs.statements.append(f"query.hints[{k}] = hint_{k};")
    alpha = inputs.structure("Facet", "facet", alpha=np.minimum(hints[0].radius, hints[1].radius) / 2.6).alpha
    random = inputs.fill("query", hint_count=np.full(ROWS, 2), random=rng.uniform(0, 1, (ROWS, 3))).random
    names = ("FAR_SIDE_FIRST", "FAR_SIDE_SUBSET")
    widest = inputs.add("widest", rng.choice([twin.TABLE[name] for name in names], ROWS))
    results = ("serves", "block", "reach1", "reach2", "map.costs.fetches", "missing_serves", *VIEW)
    osl = inputs.call("counts.h", SERVE.format(file=(tmp_path / "c.exr").as_posix()), results)

    map_ = SimpleNamespace(counts=counts, is_linear=own.is_linear, strength=own.strength)
    query = SimpleNamespace(axes=footprint.axes, short_axis=footprint.short_axis, alpha=alpha, random=random)
    serves, block, is_clear = twin.counts_serve(map_, hints, query, osl.stacked(*VIEW), widest)
    assert 0.2 < serves.mean() < 0.8 and len(np.unique(block)) > 3
    assert_whole_agree(osl["serves"], serves, is_clear, least=0.9)
    assert_whole_agree(osl["block"], block, is_clear, least=0.9)
    # The header is fetched where all else allows the counts: here once of each of two tables.
    np.testing.assert_array_equal(osl["map.costs.fetches"], 5 + 2 * osl["serves"])
    assert not osl["missing_serves"].any()
    # The cells are those of the level.
    known = is_clear & serves
    cells, cells_are_clear, _ = twin.hint_cells(
        hints[0], osl.stacked(*VIEW), counts.low, counts.high, twin.counts_table.level_corners(
            np.maximum(block, 32), own.is_linear), own.strength, alpha, random)
    known &= cells_are_clear
    np.testing.assert_allclose(osl.stacked("reach1", "reach2")[known], cells.reach[known], rtol=1e-3)
    assert known.sum() > 100
