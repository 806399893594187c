"""Each function of osl/counts.h against its twin, on a table that the baker wrote."""

from types import SimpleNamespace

import numpy as np
import pytest

from glint_addon.bake import counts as bake
from glint_addon.bake import float_image
from tests.helpers.osl_functions import EPSILON, ROUNDING, ROWS, Inputs, assert_whole_agree
from tests.reference import counts as twin
from tests.reference import counts_cells, counts_groups, counts_table
from tests.reference.random_inputs import cells_inputs, footprint_inputs, hint_inputs, random_axes

HEADER = "counts.h"
SIZE = (300, 200)
LEVELS = (16, 128)
MOST = 4  # cells along a side of a random grid
FIELDS = ("mass", "first1", "first2", "square1", "square2")


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """The path of a table of counts, and its texels (texels, 4) in the order of the file. All bins hold slopes."""
    rng = np.random.default_rng(1)
    normals = np.ones((SIZE[1], SIZE[0], 3), np.float32)
    normals[..., :2] = rng.uniform(-0.5, 0.5, (SIZE[1], SIZE[0], 2))
    box = (np.full(2, -0.45, np.float32), np.full(2, 0.45, np.float32))
    pixels = bake.counts_texels(normals, "LINEAR", LEVELS, box)
    path = tmp_path_factory.mktemp("counts") / "counts.exr"
    float_image.write_whole(path, pixels)
    return path.as_posix(), pixels[::-1].reshape(-1, 4)


def facet_inputs(rng, inputs):
    """A struct Facet, and its fields."""
    alpha = inputs.structure("Facet", "facet", alpha=rng.uniform(0.01, 0.1, ROWS)).alpha
    is_ggx = inputs.add("is_ggx", rng.integers(0, 2, ROWS))
    inputs.statements.append('facet.distribution = is_ggx ? "ggx" : "beckmann";')
    return alpha, is_ggx


def hints_cells(rng, inputs, count):
    """Cells of `count` hints: with bins per slope, well conditioned, the inverse, and a tilt."""
    a = 20 * (np.eye(2) + 0.3 * rng.uniform(-1, 1, (count, ROWS, 2, 2)))
    p = np.linalg.inv(a)
    fields = {f"{name}{i + 1}{j + 1}": m[..., i, j] for name, m in (("a", a), ("p", p)) for i in (0, 1) for j in (0, 1)}
    fields |= {f"tilt{k}": rng.uniform(-0.5, 0.5, (count, ROWS)) for k in (1, 2)}
    cells = cells_inputs(rng, inputs, count, MOST, **fields)
    for own in cells:
        own.tilt = np.stack([own.tilt1, own.tilt2], axis=1)
    return cells


def selected_cells(cells, k, row):
    """Whether each cell (rows, columns) of hint k of one row is selected, by the twin."""
    grid = cells[k].grid
    i, j = (at.reshape(-1) for at in np.meshgrid(np.arange(grid.columns[row]), np.arange(grid.rows[row])))
    one = twin.row_of(SimpleNamespace(grid=grid, centre=cells[k].centre, reach=cells[k].reach), np.array([row]))
    within, _ = counts_cells.cell_is_within(one.grid, one.centre, one.reach, i, j)
    grids = [own.grid for own in cells]
    chosen = [counts_cells.cell_is_selected(grids, row, k, *cell) for cell in zip(i, j, within, strict=True)]
    return np.array(chosen, bool).reshape(grid.rows[row], grid.columns[row])


# --- Functions of cells, on random masses ---

CELLS = """
  Masses cleared;
  cleared.mass[which] = 3;
  cleared.first1[which] = 3;
  cleared.first2[which] = 3;
  cleared.square1[which] = 3;
  cleared.square2[which] = 3;
  clear_masses(cells_1, grid_1, facet, cleared);
  float mass[MOST_CELLS];
  mass = m.mass;
  sharpen_cells(cells, 1, m, mass);
  int peak = peak_cell(cells, 1, m);
  Grid wide = grid_1;
  wide.stride1 = wide_stride1;
  wide.stride2 = wide_stride2;
  Grid parts = cell_parts(wide, which);
  query.hints[2] = hint;
  SlopeLobe lobe = cell_lobe(query, 2, cells_1, bins, grid_1, m, which, 0.7);
"""
GRID = ("columns", "rows", "start1", "start2", "stride1", "stride2", "end1", "end2")
LOBE = ("weight", "p1", "p2", "c11", "c12", "c22", "place1", "place2")
CLEARED = (*(f"cleared.{name}[which]" for name in FIELDS), "cleared.spread_u", "cleared.spread_v")


@pytest.fixture(scope="module")
def masses():
    """Random masses of the cells of two hints, of which the second is asked for."""
    rng = np.random.default_rng(2)
    inputs = Inputs()
    alpha, is_ggx = facet_inputs(rng, inputs)
    width = inputs.add("width", rng.uniform(0, 3, ROWS))
    cells = hints_cells(rng, inputs, 2)
    grid = cells[1].grid
    number = grid.columns * grid.rows
    which = inputs.add("which", rng.integers(0, np.maximum(number, 1)))
    wide = [inputs.add(f"wide_stride{k}", rng.integers(1, 30, ROWS)) for k in (1, 2)]
    hint = hint_inputs(rng, inputs, "hint", rng.uniform(-0.5, 0.5, (ROWS, 2)))
    bins = inputs.add("bins", rng.uniform(20.0, 200.0, ROWS))
    inputs.statements.append("Masses m; Query query;")
    random = inputs.fill("query", random=rng.uniform(0, 1, (ROWS, 3))).random
    mass = np.where(np.arange(MOST**2)[:, None] < number, np.exp(rng.normal(size=(MOST**2, ROWS))), 0.0)
    mass = np.array([inputs.add(f"m.mass[{k}]", values) for k, values in enumerate(mass)]).T
    own = inputs.fill(
        "m", spread1=rng.uniform(-1, 1, ROWS) / 12, spread2=rng.uniform(-1, 1, ROWS) / 12,
        width1=rng.uniform(0.5, 2, ROWS), width2=rng.uniform(0.5, 2, ROWS), spread_u=rng.uniform(0, 500, ROWS),
        spread_v=rng.uniform(0, 500, ROWS),
    )
    # Moments of the cell that is asked for: a mean and a variance of its bins.
    at = np.arange(ROWS), which
    means, variances = rng.uniform(-3, 3, (2, ROWS)), rng.uniform(0, 2, (2, ROWS))
    for k in (1, 2):
        setattr(own, f"first{k}", inputs.add(f"m.first{k}[which]", mass[at] * means[k - 1]))
        setattr(own, f"square{k}",
                inputs.add(f"m.square{k}[which]", mass[at] * (means[k - 1] ** 2 + variances[k - 1])))
    own.mass = mass
    results = ["cell_spread(facet, width)", "cleared.width1", "cleared.width2", "cleared.spread1", "cleared.spread2",
               *CLEARED, *(f"mass[{k}]" for k in range(MOST**2)), "peak", *(f"parts.{name}" for name in GRID),
               *(f"lobe.{name}" for name in LOBE)]
    osl = inputs.call(HEADER, CELLS, results)
    return SimpleNamespace(osl=osl, alpha=alpha, is_ggx=is_ggx, width=width, cells=cells, grid=grid, which=which,
                           wide=wide, hint=hint, bins=bins, random=random, m=own, known=number > 0)


def test_the_spread_of_a_cell_goes_by_its_width(masses):
    expected = twin.cell_spread(masses.is_ggx != 0, masses.width)
    np.testing.assert_allclose(masses.osl["cell_spread(facet, width)"], expected, atol=ROUNDING / 12)
    assert len(np.unique(expected)) > 100


def test_masses_are_cleared_and_know_the_width_of_their_cells(masses):
    osl, known = masses.osl, masses.known
    for row in np.flatnonzero(known):
        grid = twin.row_of(masses.grid, row)
        widths, spread = twin.clear_masses(masses.cells[1].p[row], grid, masses.alpha[row], masses.is_ggx[row] != 0)
        np.testing.assert_allclose([osl[f"cleared.width{k}"][row] for k in (1, 2)], widths, rtol=8 * EPSILON)
        np.testing.assert_allclose([osl[f"cleared.spread{k}"][row] for k in (1, 2)], spread,
                                   atol=ROUNDING * widths.max())
    assert not osl.stacked(*CLEARED)[known].any()


def test_mass_moves_to_heavier_neighbours(masses):
    osl = masses.osl
    sharp = osl.stacked(*(f"mass[{k}]" for k in range(MOST**2)))
    moved = 0
    for row in np.flatnonzero(masses.known):
        shape = masses.grid.rows[row], masses.grid.columns[row]
        mass = masses.m.mass[row, : shape[0] * shape[1]].reshape(shape)
        spread = masses.m.spread1[row], masses.m.spread2[row]
        expected = twin.sharpen_cells(mass, selected_cells(masses.cells, 1, row), spread)
        np.testing.assert_allclose(sharp[row, : mass.size], expected.reshape(-1), atol=ROUNDING * mass.max())
        moved += (np.abs(expected - mass) > 0.01 * mass).any()
    assert moved > 0.3 * ROWS
    assert (sharp[masses.known] >= 0).all()
    np.testing.assert_allclose(sharp.sum(axis=1), masses.m.mass.sum(axis=1), atol=1e-4)


def test_a_peak_is_a_cell_that_holds_a_large_share(masses):
    known = np.flatnonzero(masses.known)
    expected, is_clear = [], []
    for row in known:
        shape = masses.grid.rows[row], masses.grid.columns[row]
        mass = masses.m.mass[row, : shape[0] * shape[1]].reshape(shape)
        selected = selected_cells(masses.cells, 1, row)
        expected.append(twin.peak_cell(mass, selected, twin.row_of(masses.grid, row)))
        is_clear.append(abs(mass.max() / mass.sum() - twin.NUMBERS["PEAK_SHARE"]) > 1e-5)
    assert 0.1 < np.mean(np.array(expected) >= 0) < 0.9
    assert_whole_agree(masses.osl["peak"][known], np.array(expected), np.array(is_clear))


def test_the_parts_of_a_cell_cover_it(masses):
    osl = masses.osl
    for row in np.flatnonzero(masses.known):
        grid = twin.row_of(masses.grid, row)
        grid.stride1, grid.stride2 = masses.wide[0][row], masses.wide[1][row]
        expected = twin.cell_parts(grid, masses.which[row])
        assert {name: osl[f"parts.{name}"][row] for name in GRID} == vars(expected)
    parts = SimpleNamespace(**{name: osl[f"parts.{name}"][masses.known] for name in GRID})
    for number, count in ((1, parts.columns), (2, parts.rows)):
        start, end, stride = (getattr(parts, f"{name}{number}") for name in ("start", "end", "stride"))
        assert ((count * stride >= end - start) & ((count - 1) * stride < end - start)).all()
        assert count.max() == twin.NUMBERS["PEAK_PARTS"]


def test_the_lobe_of_a_cell(masses):
    osl, known = masses.osl, np.flatnonzero(masses.known)
    grown = 0
    for row in known:
        m = twin.row_of(masses.m, row)
        cell = masses.which[row]
        one = SimpleNamespace(mass=m.mass[[cell]], first1=np.array([m.first1]), first2=np.array([m.first2]),
                              square1=np.array([m.square1]), square2=np.array([m.square2]), spread_u=m.spread_u,
                              spread_v=m.spread_v)
        grid = twin.row_of(masses.grid, row)
        hint = twin.row_of(masses.hint, row)
        widths = np.array([m.width1, m.width2])
        p, covariance, place = twin.cell_lobe(one, 0, twin.row_of(masses.cells[1], row), grid, hint, widths,
                                              masses.random[row])
        found = [osl[f"lobe.{name}"][row] for name in LOBE]
        assert found[0] == np.float32(0.7)
        np.testing.assert_allclose(found[1:3], p, atol=ROUNDING)
        np.testing.assert_allclose(found[6:], place / masses.bins[row], rtol=ROUNDING, atol=ROUNDING)
        np.testing.assert_allclose(found[3:6], covariance, atol=ROUNDING * (np.abs(covariance).max() + 1e-2))
        grown += ((np.array([grid.stride1, grid.stride2]) == 1) & (widths > twin.NUMBERS["CELL_NARROW"])).any()
    assert 0.1 * len(known) < grown < 0.9 * len(known)


# --- Functions that read the table ---

READ = """
  counts.table = "{file}";
  Map map;
  map.variation = 0; map.cut_u = 0; map.cut_v = 0;
  map.counts = counts;
  map.costs.fetches = 1;
  map.costs.visited = 2;
  Level level = counts_level(counts, block, {width}, {height}, 1);
  reading.group = group_0;
  float corner = weighted_corner(counts, level, reading, level.first + corner_texel);
  for (int c = 0; c < MOST_CELLS; ++c) {{
    added.mass[c] = 0;
    added.first1[c] = 0;
    added.first2[c] = 0;
    added.square1[c] = 0;
    added.square2[c] = 0;
  }}
  add_group(counts, level, reading, grid_0, added);
  Groups groups;
  groups.count = 2;
  groups.total = total;
  groups.group[0] = group_0;
  groups.group[1] = group_1;
  query.facet = facet;
  query.hints[1] = hint;
  Masses summed;
  grid_masses(map, level, query, 1, cells_0, groups, grid_0, summed);
"""


def level_rows(block):
    """The twin's level of each row, and one row of it as numbers."""
    size = [np.full(ROWS, side) for side in SIZE]
    counts = SimpleNamespace(first=np.full(ROWS, LEVELS[0]), levels=np.full(ROWS, 4))
    return counts_table.counts_level(counts, block, *size, np.ones(ROWS, int))


def counts_inputs(rng, inputs):
    """A struct Counts without its table, and the side of the blocks of a random level."""
    inputs.structure("Counts", "counts", first=np.full(ROWS, LEVELS[0]), levels=np.full(ROWS, 4))
    return level_rows(inputs.add("block", LEVELS[0] << rng.integers(0, 4, ROWS)))


@pytest.fixture(scope="module")
def reading(table):
    """Random groups read at the cells of a hint."""
    rng = np.random.default_rng(3)
    inputs = Inputs()
    alpha, is_ggx = facet_inputs(rng, inputs)
    level = counts_inputs(rng, inputs)
    groups = []
    for k in range(2):
        weight = rng.uniform(0, 1, (ROWS, 4)) * (rng.random((ROWS, 4)) < 0.8) + 1e-3
        places = rng.integers(-3, 6, (2, ROWS))
        group = inputs.structure("Group", f"group_{k}", column=places[0], row=places[1], weight=weight[:, :3],
                                 fourth=weight[:, 3])
        group.weights = np.append(group.weight, group.fourth[:, None], axis=1)
        groups.append(group)
    number = level.columns * level.rows
    read = inputs.structure("Reading", "reading", number=rng.integers(0, number), move1=rng.integers(-3, 4, ROWS),
                            move2=rng.integers(-3, 4, ROWS), turned1=rng.uniform(-20, 5, ROWS),
                            turned2=rng.uniform(-20, 5, ROWS))
    cells = hints_cells(rng, inputs, 1)
    cells[0].known = cells[0].grid.columns > 0
    hint = hint_inputs(rng, inputs, "hint", rng.uniform(-0.5, 0.5, (ROWS, 2)))
    cell = inputs.add("cell", rng.integers(0, np.maximum(cells[0].grid.columns * cells[0].grid.rows, 1)))
    corner = rng.integers(0, level.corners**2)
    pair = np.where(level.unit > 0, read.number // 2, read.number)
    inputs.add("corner_texel", pair * level.corners**2 + corner)
    inputs.statements.append("Masses added; Query query;")
    spread = inputs.fill("added", spread1=rng.uniform(-1, 1, ROWS) / 12, spread2=rng.uniform(-1, 1, ROWS) / 12)
    middle = inputs.fill("query", u=rng.uniform(0, SIZE[0], ROWS), v=rng.uniform(0, SIZE[1], ROWS))
    total = inputs.add("total", sum(group.weights.sum(axis=1) for group in groups) * rng.uniform(1, 2, ROWS))
    body = READ.format(file=table[0], width=SIZE[0], height=SIZE[1])
    results = ["corner", "map.costs.fetches", "map.costs.visited", "summed.spread_u", "summed.spread_v",
               *(f"{name}.{field}[cell]" for name in ("added", "summed") for field in FIELDS)]
    osl = inputs.call(HEADER, body, results)
    return SimpleNamespace(
        osl=osl, texels=table[1], level=level, groups=groups, read=read, cells=cells[0], hint=hint, cell=cell,
        corner=corner, spread=np.stack([spread.spread1, spread.spread2], axis=1), alpha=alpha, is_ggx=is_ggx,
        middle=np.stack([middle.u, middle.v], axis=1), total=total,
    )


def test_elements_below_a_corner_over_the_blocks_of_a_group(reading):
    level, number = reading.level, reading.read.number
    expected = [
        twin.weighted_corner(reading.texels, twin.row_of(level, row), number[row], reading.groups[0].weights[row],
                             reading.corner[row]) for row in range(ROWS)
    ]
    np.testing.assert_allclose(reading.osl["corner"], expected, rtol=8 * EPSILON)
    assert (np.array(expected) > 0).mean() > 0.8
    packed = level.unit > 0
    assert 0.5 < packed.mean() < 1 and {*(number[packed] % 2)} == {0, 1}


def assert_masses_agree(osl, name, row, expected, cell, noise):
    """The moments of one cell, whose mass is known to within `noise` elements."""
    mass = expected.mass.reshape(-1)[cell]
    for field in FIELDS:
        value = getattr(expected, field).reshape(-1)[cell]
        # A mass within the noise may count as none.
        size = max(np.sqrt(abs(expected.square1.reshape(-1)[cell]) / max(mass, noise)),
                   np.sqrt(abs(expected.square2.reshape(-1)[cell]) / max(mass, noise)), 1.0)
        power = {"m": 0, "f": 1, "s": 2}[field[0]]
        limit = noise * (30.0 + size) ** power + ROUNDING * abs(value)
        assert abs(osl[f"{name}.{field}[cell]"][row] - value) < limit, (row, field)


def test_a_group_adds_its_mass_and_moments_to_each_cell(reading):
    osl, known = reading.osl, np.flatnonzero(reading.cells.known)
    filled = 0
    for row in known:
        level, read = twin.row_of(reading.level, row), twin.row_of(reading.read, row)
        one = SimpleNamespace(number=read.number, weights=reading.groups[0].weights[row],
                              move=(read.move1, read.move2), turned=(read.turned1, read.turned2))
        grid = twin.row_of(reading.cells.grid, row)
        expected = twin.add_group(reading.texels, level, one, grid, reading.spread[row])
        noise = 16 * EPSILON * one.weights.sum() * level.group_u * level.group_v / 4
        assert_masses_agree(osl, "added", row, expected, reading.cell[row], noise)
        filled += expected.mass.reshape(-1)[reading.cell[row]] > 100 * noise
    assert filled > 0.4 * len(known)


def test_masses_are_the_sums_over_groups_that_turn(reading):
    osl, compared, filled = reading.osl, 0, 0
    known = np.flatnonzero(reading.cells.known)
    for row in known:
        level, hint, cells = (twin.row_of(values, row) for values in (reading.level, reading.hint, reading.cells))
        groups = (np.array([[group.column[row], group.row[row]] for group in reading.groups]),
                  np.array([group.weights[row] for group in reading.groups]))
        spread = twin.clear_masses(cells.p, cells.grid, reading.alpha[row], reading.is_ggx[row] != 0)[1]
        expected = twin.grid_masses(reading.texels, level, hint, cells, groups, cells.grid, reading.total[row],
                                    reading.middle[row], spread)
        np.testing.assert_allclose([osl["summed.spread_u"][row], osl["summed.spread_v"][row]],
                                   [expected.spread_u, expected.spread_v], rtol=ROUNDING)
        # A move that rounding decides is another cell.
        side = np.array([level.group_u, level.group_v])
        moves = [0.5 - cells.a @ hint.turns @ ((place + 0.5) * side - reading.middle[row]) for place in groups[0]]
        if not counts_cells.away(np.array(moves)[None]).all():
            continue
        noise = 32 * EPSILON * groups[1].sum() * level.group_u * level.group_v / 4
        assert_masses_agree(osl, "summed", row, expected, reading.cell[row], noise)
        compared += 1
        filled += expected.mass.reshape(-1)[reading.cell[row]] > 100 * noise
    assert compared > 0.95 * len(known) and filled > 0.4 * len(known)
    # Two groups, at all corners of the grid.
    grid = reading.cells.grid
    corners = (grid.columns + 1) * (grid.rows + 1)
    np.testing.assert_array_equal(osl["map.costs.fetches"][known], (1 + 2 * corners)[known])
    np.testing.assert_array_equal(osl["map.costs.visited"], 4)


# --- The query ---

QUERY_HINTS = 2
DRAWN = counts_groups.DRAWN_GROUPS + 1
QUERY = """
  counts.table = "{file}";
  Map map;
  map.variation = 0; map.cut_u = 0; map.cut_v = 0;
  map.counts = counts;
  Level level = counts_level(counts, block, {width}, {height}, 1);
  query.facet = facet;
  query.footprint = footprint;
  Selection s = new_selection(25, 1, facet);
  s.random = 0.3;
  counts_query(map, level, query, cells, s);
  float sum = 0;
  for (int k = 0; k < min(s.count, s.limit); ++k) {{
    sum += s.sum[k];
  }}
  Blocks blocks = blocks_under(map, level, query);
  Groups drawn = drawn_groups(blocks, map, level, query);
  float groups[NUMBERS];
  for (int k = 0; k < {drawn}; ++k) {{
    Group one;
    one.column = 0;
    one.row = 0;
    one.weight = color(0);
    one.fourth = 0;
    if (k < drawn.count) {{
      one = drawn.group[k];
    }}
    groups[6 * k] = one.column;
    groups[6 * k + 1] = one.row;
    groups[6 * k + 2] = one.weight[0];
    groups[6 * k + 3] = one.weight[1];
    groups[6 * k + 4] = one.weight[2];
    groups[6 * k + 5] = one.fourth;
  }}
"""


def test_a_query_selects_the_elements_in_the_cells(table):
    rng = np.random.default_rng(4)
    inputs = Inputs()
    alpha, is_ggx = facet_inputs(rng, inputs)
    level = counts_inputs(rng, inputs)
    axes = random_axes(rng, largest=0.5, thin=0.3) * level.group_u[:, None, None] * 0.4
    footprint_inputs(inputs, axes)
    cells = hints_cells(rng, inputs, QUERY_HINTS)
    inputs.statements.append("Query query;")
    hints = []
    for k in range(QUERY_HINTS):
        hints.append(hint_inputs(rng, inputs, f"hint_{k}", rng.uniform(-0.5, 0.5, (ROWS, 2))))
        inputs.statements.append(f"query.hints[{k}] = hint_{k};")
    own = inputs.fill("query", hint_count=np.full(ROWS, QUERY_HINTS), u=rng.uniform(0, SIZE[0], ROWS),
                      v=rng.uniform(0, SIZE[1], ROWS), random=rng.uniform(0, 1, (ROWS, 3)))
    body = QUERY.format(file=table[0], width=SIZE[0], height=SIZE[1], drawn=DRAWN).replace("NUMBERS", str(6 * DRAWN))
    osl = inputs.call(HEADER, body, ("s.count", "sum", "drawn.count", "drawn.total", "blocks.is_random",
                                     *(f"groups[{k}]" for k in range(6 * DRAWN))))
    drawn = osl.stacked(*(f"groups[{k}]" for k in range(6 * DRAWN))).reshape(ROWS, DRAWN, 6)

    expected = []
    assert not osl["blocks.is_random"].any() and (osl["drawn.count"] <= DRAWN).all()
    for row in range(ROWS):
        taken = drawn[row, : int(osl["drawn.count"][row])]
        query = SimpleNamespace(middle=np.array([own.u[row], own.v[row]]), alpha=alpha[row], is_ggx=is_ggx[row] != 0,
                                random=own.random[row])
        selected = [selected_cells(cells, k, row) for k in range(QUERY_HINTS)]
        expected.append(twin.counts_query(
            table[1], twin.row_of(level, row), query, [twin.row_of(hint, row) for hint in hints],
            [twin.row_of(one, row) for one in cells], selected, (taken[:, :2], taken[:, 2:]), osl["drawn.total"][row]))
    count, importance, peaks = np.array(expected).T
    # Rounding may leave next to nothing in a cell that is empty; a group whose move it decides is read at another cell.
    assert (osl["s.count"] == count).mean() > 0.9 and len(np.unique(count)) > 10
    assert (np.abs(osl["sum"] - importance) <= 4 * ROUNDING * importance + 1e-9).mean() > 0.98
    assert (importance > 0).mean() > 0.8 and 0.1 < (peaks > 0).mean() < 0.9
