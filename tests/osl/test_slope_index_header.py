"""Each function of osl/slope_index.h against its twin: what the index finds is what a visit of every element finds."""

from types import SimpleNamespace

import numpy as np
import pytest

from glint_addon.bake import float_image
from glint_addon.bake import slope_index as bake
from glint_addon.bake import table as table_bake
from tests.helpers.normals import random_normals
from tests.helpers.osl_functions import ROWS, Inputs, assert_whole_agree
from tests.reference import slope_cells, tiles
from tests.reference import slope_index as twin
from tests.reference.random_inputs import footprint_inputs, hint_inputs, random_axes

HEADER = "slope_index.h"
SIZE = (72, 52)  # no multiple of a block, so that blocks are cut off where the map repeats
HINTS = 2
TILE = (3, -2)  # of the hit points, where each tile shows another cut of the map
AROUND = 2  # tiles on each side of it that a footprint may reach
COMPARED = 160  # rows, of which every element is visited one by one
SETUP = """
  Map map;
  map.variation = {variation};
  map.tile_u = {tile[0]};
  map.tile_v = {tile[1]};
  map.cut_u = {cut[0]};
  map.cut_v = {cut[1]};
  map.table = "{table}";
  map.index = "{index}";
  map.width = {width};
  map.height = {height};
  map.inverse_padded_width = 1.0 / padded_size({width});
  map.inverse_padded_height = 1.0 / padded_size({height});
  map.kept = 0;
  map.flakes.are_there = 1;
  map.costs.fetches = 0;
  map.costs.visited = 0;
"""
BODY = """
  query.facet = facet;
  query.footprint = footprint;
  query.hint_count = 2;
  int serves = index_serves(map, query);
  Index index = map_index(map.index, map.width, map.height);
  block.ellipse = footprint_ellipse(query.footprint, 0.0, 0.0);
  block.record = INDEX_RECORD * (block.column / INDEX_SIDE + index.columns * (block.row / INDEX_SIDE));
  Selection s = new_selection(25, 1, facet);
  s.random = 0.3;
  visit_listed(map, index, query, block, k, start, end, s);
  Selection in_block = new_selection(25, 1, facet);
  in_block.random = 0.3;
  visit_block(map, index, query, block, k, in_block);
  Selection all = new_selection(25, 1, facet);
  all.random = 0.3;
  map.costs.visited = 0;
  float total = index_query(map, query, all);
  int visited = map.costs.visited;
  Selection own = new_selection(25, 1, facet);
  own.random = 0.3;
  int in_tile = is_in_tile(block, x, y);
  visit_blocks(map, index, query, block, 0, 0, own);
  float sum_of_own = 0;
  float sum_of_listed = 0;
  float sum_in_block = 0;
  float sum_of_all = 0;
  for (int r = 0; r < 24; ++r) {
    sum_of_listed += r < s.count ? s.sum[r] : 0.0;
    sum_in_block += r < in_block.count ? in_block.sum[r] : 0.0;
    sum_of_all += r < all.count ? all.sum[r] : 0.0;
    sum_of_own += r < own.count ? own.sum[r] : 0.0;
  }
"""
RESULTS = ("serves", "s.count", "sum_of_listed", "in_block.count", "sum_in_block", "all.count", "sum_of_all", "total",
           "visited", "own.count", "sum_of_own", "in_tile")


def damaged_index(folder):
    """A map (height, width, 3), the path of its table, and the texels of its index, of which the last block's record is
    damaged: all its elements are visited."""
    rng = np.random.default_rng(2)
    # Waves with grain, and a few normals that stick out or lie below the horizon.
    i, j = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    normals = np.stack([0.4 * np.sin(i / 9), 0.4 * np.cos(j / 7), np.ones(i.shape)], axis=2)
    normals[..., :2] += 0.02 * rng.normal(size=(SIZE[1], SIZE[0], 2))
    normals[::17, ::23] = random_normals(*SIZE)[::17, ::23]
    normals = (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)
    # A part of the map has texels that are no flakes.
    normals[:, :40][rng.random((SIZE[1], 40)) < 0.4] = 0
    table, _ = table_bake.bake_table(normals, folder, interpolation="CLOSEST")
    pixels = bake.index_texels(normals)
    last = bake.blocks(SIZE[0]) * bake.blocks(SIZE[1]) - 1
    pixels.reshape(-1, 4)[last * slope_cells.RECORD + 1, 3] = 0
    float_image.write_whole(folder / "index.exr", pixels)
    return normals, table, pixels.reshape(-1, 4)


def near_hints(rng, inputs, normals, strength, middle):
    """Hints of `query` with half vectors at about the slope of a texel nearby, and regions above the surface."""
    hints = []
    for k in range(HINTS):
        i, j = (np.floor(middle).astype(int) + rng.integers(-8, 9, (ROWS, 2))).T
        near = normals[j % SIZE[1], i % SIZE[0]]
        near = np.where(near.any(axis=1, keepdims=True), near, [0, 0, 1])
        slopes = np.clip(strength[:, None] * near[:, :2] / near[:, 2:], -0.5, 0.5)
        hint = hint_inputs(rng, inputs, f"hint_{k}", slopes)
        hint.radius = inputs.add(f"hint_{k}.radius", rng.uniform(0.03, 0.12, ROWS))
        turns = np.linalg.norm(hint.turns, axis=1).sum(axis=1)
        added = inputs.fill(f"hint_{k}", patch_turn=0.5 * turns, reach=0.02 + turns, ball_growth=np.full(ROWS, 2.0))
        vars(hint).update(vars(added))
        inputs.statements.append(f"query.hints[{k}] = hint_{k};")
        hints.append(hint)
    return hints


def near_blocks(rng, inputs, middle):
    """A struct Block around the hit, or one beside it, where the map may begin anew; start and end in its list."""
    plane, first, size = np.empty((3, ROWS, 2), int)
    for axis in range(2):
        texel = np.floor(middle[:, axis]).astype(int) + rng.integers(-20, 21, ROWS)
        plane[:, axis], place = slope_cells.block_start(texel, SIZE[axis])
        first[:, axis] = 32 * place
        size[:, axis] = np.minimum(SIZE[axis] - first[:, axis], 32)
    is_listed = rng.integers(0, 2, ROWS)
    # As many elements as are listed, or all texels of as many rows.
    most = np.where(is_listed, size[:, 0], slope_cells.SIDE) * size[:, 1]
    ends = np.sort(rng.integers(0, most + 1, (2, ROWS)), axis=0)
    start, end = inputs.add("start", ends[0]), inputs.add("end", ends[1])
    inputs.structure(
        "Block", "block", column=first[:, 0], row=first[:, 1], plane_column=plane[:, 0], plane_row=plane[:, 1],
        columns=size[:, 0], rows=size[:, 1], is_listed=is_listed,
    )
    return SimpleNamespace(plane=plane, first=first, size=size, is_listed=is_listed), start, end


@pytest.fixture(scope="module", params=[0, 1], ids=["repeat", "shuffle"])
def visits(request, tmp_path_factory):
    """Queries of a map that its index answers: inputs, OSL's results, and the tables. Where each tile shows another cut
    of the map, `plane` are the normals of the tiles around TILE, which begin at `origin` in the hit's plane."""
    variation = request.param
    cut = tiles.tile_cut(TILE, SIZE) * variation
    folder = tmp_path_factory.mktemp("index")
    normals, table, texels = damaged_index(folder)
    rng = np.random.default_rng(1)
    inputs = Inputs()
    inputs.statements.append(SETUP.format(table=table.as_posix(), index=(folder / "index.exr").as_posix(),
                                          width=SIZE[0], height=SIZE[1], variation=variation, tile=TILE, cut=cut))
    strength = np.where(rng.random(ROWS) < 0.5, 1.0, rng.uniform(0.5, 1.5, ROWS))
    map_ = inputs.fill("map", strength=strength, visits=rng.choice([500, 1500, 4096], ROWS),
                       is_linear=(rng.random(ROWS) < 0.1).astype(int),
                       is_indexed=(rng.random(ROWS) < 0.9).astype(int))
    map_.size = SIZE
    footprint = footprint_inputs(inputs, random_axes(rng, largest=0.9, thin=0.6) * 7)
    inputs.statements.append("Query query;")
    middle = inputs.fill("query", u=cut[0] + rng.uniform(0, SIZE[0] - 1, ROWS),
                         v=cut[1] + rng.uniform(0, SIZE[1] - 1, ROWS))
    query = SimpleNamespace(middle=np.stack([middle.u, middle.v], axis=1), area=footprint.area,
                            short_axis=footprint.short_axis, axes=footprint.axes)
    hints = near_hints(rng, inputs, normals, map_.strength, query.middle)
    alpha = inputs.structure("Facet", "facet", alpha=rng.uniform(0.01, 0.04, ROWS)).alpha
    inputs.statements.append('facet.distribution = "beckmann";')
    wanted = inputs.add("k", rng.integers(0, HINTS, ROWS))
    blocks, start, end = near_blocks(rng, inputs, query.middle)
    inside = np.stack([inputs.add(name, rng.integers(0, 32, ROWS)) for name in "xy"], axis=1)
    inputs.fill("block", **{name: np.full(ROWS, value) for name, value in zip(
        ("first_u", "first_v", "last_u", "last_v"), (*cut, *(cut + SIZE - 1)), strict=True)})
    plane = normals
    if variation:
        plane = tiles.shuffled(normals, (2 * AROUND + 1,) * 2, first=np.array(TILE) - AROUND)
    osl = inputs.call(HEADER, BODY, RESULTS)
    return SimpleNamespace(osl=osl, plane=plane, origin=cut - AROUND * np.array(SIZE) * variation, variation=variation,
                           cut=cut, inside=inside, texels=texels, map=map_, query=query, hints=hints, alpha=alpha,
                           k=wanted, start=start, end=end, blocks=blocks)


def arguments(visits, row):
    """normals, settings, hints, middle and axes of one row for the twin."""
    settings = SimpleNamespace(strength=visits.map.strength[row], alpha=visits.alpha[row])
    hints = [SimpleNamespace(forms=hint.forms[row], turns=hint.turns[row], radius=hint.radius[row])
             for hint in visits.hints]
    return visits.plane, settings, hints, visits.query.middle[row] - visits.origin, visits.query.axes[row]


def block_of(visits, row):
    """The block of one row for the twin, and which of the texels of its plane are seen."""
    low = visits.cut - visits.origin if visits.variation else np.full(2, -np.inf)
    return SimpleNamespace(plane=visits.blocks.plane[row] - visits.origin, size=visits.blocks.size[row], low=low,
                           high=low + SIZE if visits.variation else np.full(2, np.inf))


def assert_sums_agree(visits, count, importance, expected, filled=0.25):
    """The number of elements and the sum of their importances lie where the twin has them; `filled`: share of the rows
    that select several at least."""
    several = 0
    for row, (fewest, most, least, largest) in enumerate(expected):
        assert fewest <= visits.osl[count][row] <= most, row
        assert least * (1 - 1e-4) - 1e-6 <= visits.osl[importance][row] <= largest * (1 + 1e-4) + 1e-6, row
        several += most > 3
    assert several > filled * len(expected)


def test_the_index_serves_where_it_is_faster(visits):
    expected, is_clear = twin.index_serves(visits.texels, visits.map, visits.hints, visits.query)
    assert 0.1 < expected.mean() < 0.9
    assert not expected[(visits.map.is_indexed == 0) | (visits.map.is_linear != 0)].any()
    assert_whole_agree(visits.osl["serves"], expected, is_clear, least=0.9)


def test_listed_elements_are_visited_and_no_others(visits):
    expected = []
    for row in range(COMPARED):
        block = block_of(visits, row)
        codes = np.arange(slope_cells.SIDE**2)
        if visits.blocks.is_listed[row]:
            place = visits.blocks.first[row] // slope_cells.SIDE
            record = slope_cells.RECORD * (place[1] * bake.blocks(SIZE[0]) + place[0])
            pairs = visits.texels[record + slope_cells.FIRST_ELEMENT :][:128].reshape(-1).astype(int)
            codes = np.stack([pairs % 1024, pairs // 1024], axis=1).reshape(-1)
        codes = codes[visits.start[row] : visits.end[row]]
        expected.append(twin.visit_listed(*arguments(visits, row), block, codes, visits.k[row]))
    assert_sums_agree(visits, "s.count", "sum_of_listed", expected, 0.1)


def test_a_visit_of_a_block_finds_all_its_elements_of_a_hint(visits):
    expected = []
    for row in range(COMPARED):
        block = block_of(visits, row)
        expected.append(twin.visit_block(*arguments(visits, row), block, visits.k[row]))
    assert_sums_agree(visits, "in_block.count", "sum_in_block", expected)


def test_a_query_finds_all_elements_under_the_footprint(visits):
    found = [twin.index_query(*arguments(visits, row)) for row in range(COMPARED)]
    assert_sums_agree(visits, "all.count", "sum_of_all", [sums for sums, _ in found])
    np.testing.assert_allclose(visits.osl["total"][:COMPARED], [total for _, total in found], rtol=1e-5)
    # The index leaves most elements unvisited.
    assert visits.osl["visited"].sum() < 0.7 * visits.query.area.sum() * HINTS


def test_blocks_within_bounds_are_visited_and_what_is_seen_of_a_block_lies_in_its_tile(visits):
    low = visits.cut - visits.origin
    found = [twin.visit_blocks(*arguments(visits, row), low, low + SIZE) for row in range(COMPARED)]
    assert_sums_agree(visits, "own.count", "sum_of_own", found, 0.2)
    texel = visits.blocks.plane + visits.inside
    seen = ((texel >= visits.cut) & (texel < visits.cut + SIZE)).all(axis=1)
    assert 0.2 < seen.mean() < 0.9
    np.testing.assert_array_equal(visits.osl["in_tile"], seen)
