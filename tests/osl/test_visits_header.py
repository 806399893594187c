"""osl/visits.h against its numpy twin, which lists and tests all elements of each footprint by brute force."""

import numpy as np
import pytest

from glint_addon.bake import table as bake
from tests.helpers.osl_functions import MARGIN, ROWS, Inputs, unit
from tests.osl.queries import declared_map, declared_query, give_hints, whole_hint
from tests.reference import map as normal_map
from tests.reference import query, table, tiles, visits
from tests.reference.footprint import Footprint

HEADERS = ("visits.h",)
SIZE = (11, 7)  # texels, neither a power of two: the padded table has other things beyond the edge
POINTS = 12
LIMIT = 24  # elements that are all kept as they are
SUMS = """
  float sums[7] = { 0, 0, 0, 0, 0, 0, 0 };
  for (int k = 0; k < min(s.count, s.limit); ++k) {
    SlopeLobe lobe = s.lobe[k];
    sums[0] += lobe.weight; sums[1] += lobe.p1; sums[2] += lobe.p2; sums[3] += lobe.c11; sums[4] += lobe.c12;
    sums[5] += lobe.c22; sums[6] += s.hint[k];
  }
"""
SHOWN = ("s.count", "map.costs.fetches", *(f"sums[{k}]" for k in range(7)))


def baked(rng, folder, is_linear, std=0.2):
    """A map (height, width, 3) float32 whose slopes have this deviation, and its table."""
    slopes = std * rng.normal(size=(SIZE[1], SIZE[0], 2))
    normals = np.append(slopes, np.ones((SIZE[1], SIZE[0], 1)), axis=2).astype(np.float32)
    return normals, bake.bake_table(normals, folder, interpolation="LINEAR" if is_linear else "CLOSEST")[0]


def hints_at(rng, n, radius, extent, *, turn=0.02):
    """Hints in whose region, of a radius up to `radius`, lie the normals n (rows, 3) at the hit; turn: per texel."""
    h = unit(n)
    first = unit(np.cross(h, rng.normal(size=h.shape)))
    radius = rng.uniform(0.02, radius, len(h))
    slope = radius[:, None] * rng.uniform(-1, 1, (len(h), 2))
    forms = np.stack([first + slope[:, :1] * h, np.cross(h, first) + slope[:, 1:] * h, h], axis=1)
    return whole_hint(forms, turn * rng.normal(size=(len(h), 2, 2)), radius, extent)


def declared(normals, file, hints, is_linear, visited=4096):
    return declared_map(file, normals, is_linear=is_linear, visits=visited) + declared_query(hints)


def give_facet(given, alpha):
    given.statements += ["Facet facet;", "facet.distribution = \"beckmann\";"]
    alpha = given.floats("facet.alpha", alpha)
    given.statements += ["query.facet = facet;", "Selection s = new_selection(25, 1, facet);"]
    return alpha


def assert_selected(osl, twin, clear):
    """OSL's SHOWN is what the twin selects, in the queries where this is clear."""
    counts = np.bincount(twin.row, minlength=ROWS)
    assert clear.mean() > 0.7 and (counts > 0).mean() > 0.1 and (counts == 0).mean() > 0.03
    np.testing.assert_array_equal(osl[clear, 0], counts[clear])
    few = clear & (counts <= LIMIT)
    assert few.sum() > 0.8 * clear.sum()
    columns = [*twin.lobe.T, twin.hint]
    sums = np.stack([np.bincount(twin.row, column, ROWS) for column in columns], axis=1)
    sizes = np.stack([np.bincount(twin.row, np.abs(column), ROWS) for column in columns], axis=1)
    # Slopes turn by float32 places, and are tested to 1e-4 by the twin.
    assert (np.abs(osl[:, 2:] - sums) <= 2e-3 * sizes + 1e-5)[few].all()


@pytest.mark.parametrize("is_linear", [False, True])
@pytest.mark.parametrize(("between", "std", "turn"), [((0, 1), 0.2, 0.02), ((1, 2), 0.02, 0.2)])
def test_a_visit_selects_what_its_hints_select_at_the_edges_of_the_map_too(tmp_path, is_linear, between, std, turn):
    """On a rough map, and on a smooth one on which slopes turn within a patch: no patch is skipped there either."""
    rng = np.random.default_rng(11)
    width, height = SIZE
    normals, file = baked(rng, tmp_path, is_linear, std)
    i, j = np.arange(ROWS) % width, np.arange(ROWS) // width % height
    strength = rng.uniform(-2, 3, ROWS).astype(np.float32).astype(float)
    given = Inputs()
    at = rng.random((ROWS, 2))
    if is_linear:
        n = normal_map.patch_normal(normal_map.map_patch(normals, strength, i, j), *at.T)
    else:
        n = normal_map.map_normal(normals, strength, i, j)
    # The second hint is tried where the first selects nothing; both are far away from every fourth element.
    away = np.where(np.arange(ROWS)[:, None] % 4 == 0, 2.0, 0.0) * rng.normal(size=n.shape)
    n += away
    first, second = hints_at(rng, n + 0.2 * rng.normal(size=n.shape), 0.3, 1.0), hints_at(rng, n, 0.4, 1.0, turn=turn)
    hints = give_hints(given, [first, second])
    alpha = give_facet(given, rng.uniform(0.02, 0.3, ROWS))
    given.statements.append("Visit visit = whole_visit(query);")
    given.floats("map.strength", strength)
    given.ints("visit.i, visit.j", np.stack([i, j], axis=1))
    offset = given.floats("visit.offset_u, visit.offset_v", -at)
    weight = given.floats("visit.weight", rng.uniform(0.1, 1, ROWS))
    body = f"""
      visit.from = {between[0]}; visit.to = {between[1]};
      {"visit_patch(map, query, visit, s)" if is_linear else "visit_texel(map, query, visit, s)"};
    """
    osl = given.evaluate(HEADERS, declared(normals, file, hints, is_linear), body + SUMS, SHOWN)
    every = visits.Visits(np.arange(ROWS), i, j, *offset.T, weight, np.zeros(ROWS, bool))
    if is_linear:
        twin = visits.visit_patch(hints, normals, strength, alpha, every, ROWS, between)
    else:
        twin = visits.visit_texel(hints, normals, strength, every, ROWS, between)
    assert_selected(osl, twin, ~twin.unclear)
    if not is_linear:
        assert (osl[:, 1] == 1).all()
        return
    # One fetch for the bounds, where there are any, and four for the corners of what they do not rule out.
    bounded = table.patch_has_bounds(width, height, i, j)
    assert (osl[~bounded, 1] == 4).all() and not bounded.all()
    pixels = bake.table_pixels(normals, "LINEAR")
    centre, ball = table.patch_bounds(pixels, *np.where(bounded, [i, j], 1))
    centre, ball = table.strengthened(centre, strength), ball * np.maximum(np.abs(strength), 1.0)
    reached, margins = zip(*(
        query.hint_reaches_ball(hint, centre, ball, *(offset + 0.5).T) for hint in hints[between[0] : between[1]]
    ), strict=True)
    clear = bounded & (np.abs(margins) > MARGIN).all(axis=0)
    assert clear.mean() > 0.7 and 0.01 < np.any(reached, axis=0)[clear].mean() < 0.95
    np.testing.assert_array_equal(osl[clear, 1], np.where(np.any(reached, axis=0), 5, 1)[clear])


def test_a_whole_visit_is_of_weight_one():
    given = Inputs()
    hints = given.ints("query.hint_count", np.arange(ROWS) % 9)
    osl = given.evaluate(HEADERS, "Query query;", "Visit visit = whole_visit(query);",
                         ("visit.weight", "visit.is_point", "visit.from", "visit.to"))
    np.testing.assert_array_equal(osl, np.stack([np.ones(ROWS), np.zeros(ROWS), np.zeros(ROWS), hints], axis=1))


SURE = visits.SURE_WEIGHT
CALLS = {
    # OSL's call: its mode as visit_elements names it, points (0: as the mode), linear, sure.
    "visit_rows(map, query, 0.0, s)": (query.MODE_ALL, 0, False, 0.0),
    f"visit_rows(map, query, {SURE}, s)": (query.MODE_ALL, 0, True, SURE),
    f"visit_points(map, query, {POINTS}, 0, s)": (query.MODE_SUBSET, POINTS, True, 0.0),
    f"visit_points(map, query, {POINTS}, 1, s)": (query.MODE_POINTS, POINTS, False, 0.0),
    "visit_elements(map, query, MODE_ALL, 0.0, s)": (query.MODE_ALL, 0, True, 0.0),
    "visit_elements(map, query, MODE_POINTS, 0.0, s)": (query.MODE_POINTS, 0, True, 0.0),
    "visit_elements(map, query, MODE_SUBSET, 0.0, s)": (query.MODE_SUBSET, 0, False, 0.0),
}


TILE = (5, -1)  # of the hit points, where each tile shows another cut of the map
AROUND = 2  # tiles on each side of it that a footprint may reach
OF_TEXELS = [call for call, (_, _, is_linear, _) in CALLS.items() if not is_linear]


def random_footprints(rng, given, *, is_thin):
    """Give OSL's `query` random footprints; the same as OSL gets them."""
    turn = rng.uniform(0, 2 * np.pi, ROWS)
    long_axis = rng.uniform(0.6, 2.5, ROWS)
    short_axis = long_axis * rng.uniform(0.02, 0.4, ROWS) if is_thin else rng.uniform(0.5, 1, ROWS)
    short_axis = np.minimum(short_axis, long_axis)
    axes = np.stack([long_axis * np.cos(turn), -short_axis * np.sin(turn), long_axis * np.sin(turn),
                     short_axis * np.cos(turn)], axis=1)
    axes = given.floats("f.ux, f.uy, f.vx, f.vy", axes)
    long_axis, short_axis, area = given.floats("f.long_axis, f.short_axis, f.area", np.stack(
        [long_axis, short_axis, np.pi * long_axis * short_axis], axis=1)).T
    given.statements.append("query.footprint = f;")
    return Footprint(*axes.T, *[None] * 4, area, long_axis, short_axis)


@pytest.mark.parametrize(("call", "variation"), [*((call, 0) for call in CALLS), *((call, 1) for call in OF_TEXELS)])
def test_visits_of_a_footprint_select_what_brute_force_selects(tmp_path, call, variation):
    mode, points, is_linear, sure = CALLS[call]
    rng = np.random.default_rng(12)
    normals, file = baked(rng, tmp_path, is_linear)
    given = Inputs()
    cut = tiles.tile_cut(TILE, SIZE) * variation
    u, v = given.floats("query.u, query.v", cut + rng.uniform(-3, (SIZE[0] + 3, SIZE[1] + 3), (ROWS, 2))).T
    tile = f"""
      map.variation = {variation}; map.tile_u = {TILE[0]}; map.tile_v = {TILE[1]};
      map.cut_u = {cut[0]}; map.cut_v = {cut[1]};
    """
    footprint = random_footprints(rng, given, is_thin=mode == query.MODE_POINTS)
    place = rng.integers(0, SIZE, (ROWS, 2)).T
    n = normal_map.map_normal(normals, 1.0, *place)
    hints = give_hints(given, [hints_at(rng, n, 0.2, 4.0), hints_at(rng, n[::-1], 0.2, 4.0)])
    alpha = give_facet(given, rng.uniform(0.1, 0.4, ROWS))
    chance = given.vectors("query.random", rng.random((ROWS, 3)))
    osl = given.evaluate(HEADERS, declared(normals, file, hints, is_linear, POINTS) + "Footprint f;",
                         f"{tile} float total = {call}; int border = next_border(map, (int)floor(query.u));" + SUMS,
                         (*SHOWN, "border", "total", "map.costs.visited"))
    # Where all tiles are alike no column to come is a border.
    border = cut[0] + (np.floor(u - cut[0]) // SIZE[0] + 1) * SIZE[0] if variation else np.floor(u)
    np.testing.assert_array_equal(osl[:, -3], border)

    if variation:
        # The tiles around as one map, and the footprints in it.
        normals = tiles.shuffled(normals, (2 * AROUND + 1,) * 2, first=np.array(TILE) - AROUND)
        u, v = u - cut[0] + AROUND * SIZE[0], v - cut[1] + AROUND * SIZE[1]
    if points:
        total, every = np.full(ROWS, points), visits.visit_points(
            footprint, u, v, chance[:, :2], np.full(ROWS, points), is_linear, mode == query.MODE_POINTS)
    else:
        total, every = visits.visit_elements(footprint, u, v, chance[:, :2], mode, POINTS, is_linear, sure)
    strength = np.ones(ROWS)
    if is_linear:
        twin = visits.visit_patch(hints, normals, strength, alpha, every, ROWS)
    else:
        twin = visits.visit_texel(hints, normals, strength, every, ROWS)
    np.testing.assert_allclose(osl[:, -2], total, rtol=1e-4, atol=1e-4)
    assert_selected(osl[:, :-3], twin, ~twin.unclear)
    whole = np.ones(ROWS, bool)
    whole[every.row[every.unclear]] = False
    # An element at the very rim of the kernel has no weight that rounding can tell from none.
    visited = np.bincount(every.row, minlength=ROWS)
    assert (np.abs(osl[:, -1] - visited)[whole] == 0).mean() > 0.99
