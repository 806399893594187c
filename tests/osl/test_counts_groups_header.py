"""Each function of osl/counts_groups.h against its twin."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.helpers.osl_functions import EPSILON, MARGIN, ROUNDING, ROWS, Inputs, assert_whole_agree
from tests.reference import counts_groups as twin
from tests.reference import tiles
from tests.reference.random_inputs import footprint_inputs, random_axes

HEADER = "counts_groups.h"
FAST_MATH = 2e-5  # OSL's pow and sincos: a few float32 roundings of their argument's own size
BODY = """
  Map map; map.variation = 0; map.width = 0; map.height = 0;
  map.tile_u = 0; map.tile_v = 0; map.cut_u = 0; map.cut_v = 0;
  Blocks blocks = blocks_under(map, level, query);
  Ellipse ellipse = blocks.ellipse;
  Group under = group_under(blocks, level, query, g % blocks.groups);
  Group at_random = random_group(blocks, map, level, query, g);
  Groups drawn = drawn_groups(blocks, map, level, query);
  int columns[READ];
  int rows[READ];
  float weights[NUMBERS];
  for (int k = 0; k < READ; ++k) {
    if (k < drawn.count) {
      Group one = drawn.group[k];
      columns[k] = one.column;
      rows[k] = one.row;
      weights[4 * k] = one.weight[0];
      weights[4 * k + 1] = one.weight[1];
      weights[4 * k + 2] = one.weight[2];
      weights[4 * k + 3] = one.fourth;
    }
    else {
      columns[k] = 0;
      rows[k] = 0;
      weights[4 * k] = 0;
      weights[4 * k + 1] = 0;
      weights[4 * k + 2] = 0;
      weights[4 * k + 3] = 0;
    }
  }
  float all = 0;
  for (int k = 0; k < drawn.count; ++k) {
    Group one = drawn.group[k];
    all += one.weight[0] + one.weight[1] + one.weight[2] + one.fourth;
  }
"""
ELLIPSE = ("ellipse.quu", "ellipse.quv", "ellipse.qvv", "ellipse.reach_u", "ellipse.reach_v")
BLOCKS = ("first_column", "first_row", "columns", "groups", "is_random", "is_thin")
WEIGHTS = ("weight[0]", "weight[1]", "weight[2]", "fourth")
READ = twin.DRAWN_GROUPS + 1  # groups of a drawing that BODY gives


@pytest.fixture(scope="module")
def groups():
    """Groups under random footprints: (OSL's results, level, query, g, twin's blocks)."""
    rng = np.random.default_rng(1)
    inputs = Inputs()
    group_u = rng.uniform(24, 130, ROWS)
    level = inputs.structure(
        "Level", "level", columns=rng.integers(1, 4, ROWS), rows=rng.integers(1, 4, ROWS), group_u=group_u,
        group_v=group_u * rng.uniform(0.8, 1.25, ROWS),
    )
    axes = random_axes(rng, largest=1.3, thin=1.2) * group_u[:, None, None] / 2
    axes[:20] *= 1e4  # so wide that a number of groups is no int32
    footprint = footprint_inputs(inputs, axes)
    inputs.statements.append("Query query; query.footprint = footprint;")
    values = inputs.fill("query", u=rng.uniform(-0.5, 1500, ROWS), v=rng.uniform(-0.5, 1500, ROWS),
                         random=rng.uniform(0, 1, (ROWS, 3)), hint_count=rng.integers(1, 9, ROWS))
    g = inputs.add("g", rng.integers(0, twin.FAR_GROUPS, ROWS))
    query = SimpleNamespace(
        middle=np.stack([values.u, values.v], axis=1), random=values.random, hint_count=values.hint_count,
        axes=footprint.axes,
    )
    results = [*ELLIPSE, "blocks.side_u", "blocks.side_v", *(f"blocks.{name}" for name in BLOCKS), "drawn.count",
               "drawn.total", "all", *(f"columns[{k}]" for k in range(READ)), *(f"rows[{k}]" for k in range(READ)),
               *(f"weights[{k}]" for k in range(4 * READ))]
    for name in ("under", "at_random"):
        results += [f"{name}.{field}" for field in ("column", "row", *WEIGHTS)]
    body = BODY.replace("READ", str(READ)).replace("NUMBERS", str(4 * READ))
    return inputs.call(HEADER, body, results), level, query, g, twin.blocks_under(level, query)


def shared_blocks(osl, blocks):
    """The twin's blocks with the whole numbers that OSL found, and where these leave no doubt."""
    names = ("first_column", "first_row", "columns", "groups")
    numbers = {name: osl[f"blocks.{name}"] for name in names}
    flags = {name: osl[f"blocks.{name}"] != 0 for name in ("is_random", "is_thin")}
    return SimpleNamespace(**{**vars(blocks), **numbers, **flags})


def near_whole(places):
    """Whether some place of a row lies where float32 may round across a whole number."""
    return (np.abs(places - np.round(places)) < np.maximum(MARGIN, 8 * EPSILON * np.abs(places))).any(axis=1)


def test_the_ellipse_of_the_blocks_is_widened_by_a_block(groups):
    osl, level, query, _, blocks = groups
    np.testing.assert_allclose(osl.stacked("blocks.side_u", "blocks.side_v"),
                               np.stack([blocks.side_u, blocks.side_v], axis=1), rtol=EPSILON)
    np.testing.assert_allclose(osl.stacked(*ELLIPSE[3:]), blocks.reach, rtol=8 * EPSILON)
    expected = blocks.ellipse[:, [0, 0, 1], [0, 1, 1]]
    # The determinant of the axes' squares is that much smaller than their product.
    square = np.linalg.inv(blocks.ellipse)
    lost = square[:, 0, 0] * square[:, 1, 1] / np.linalg.det(square)
    size = np.abs(expected).max(axis=1) * lost
    assert (np.abs(osl.stacked(*ELLIPSE[:3]) - expected).max(axis=1) < ROUNDING * size).all()


def test_the_groups_under_a_footprint(groups):
    osl, level, query, _, blocks = groups
    is_clear = ~near_whole(blocks.edges)
    is_clear &= np.arange(ROWS) >= 20  # whose places have no fractions in float32
    for name in ("first_column", "first_row", "columns", "groups", "is_random"):
        assert_whole_agree(osl[f"blocks.{name}"], getattr(blocks, name), is_clear, least=0.95)
    assert (osl["blocks.is_random"][:20] != 0).all()
    short = np.linalg.svd(query.axes, compute_uv=False)[:, 1]
    thin_is_clear = np.abs(short / np.maximum(blocks.side_u, blocks.side_v) - 1) > MARGIN
    assert_whole_agree(osl["blocks.is_thin"], blocks.is_thin, thin_is_clear)
    assert set(np.unique(blocks.groups[blocks.is_random])) == {1, twin.FAR_GROUPS}


def test_a_group_at_a_random_point(groups):
    osl, level, query, g, blocks = groups
    group, weights, place = twin.random_group(shared_blocks(osl, blocks), level, query, g)
    # The point may lie as far from the twin's as OSL's fast functions are inexact.
    axes = np.linalg.norm(query.axes, axis=2) / twin.sides(level)
    inexact = 10 * FAST_MATH * axes + 8 * EPSILON * np.abs(place) + MARGIN
    near = np.abs(2 * place - np.round(2 * place)) < 2 * inexact
    is_clear = ~near.any(axis=1)
    is_clear[:20] = False
    for k, name in enumerate(("at_random.column", "at_random.row")):
        assert_whole_agree(osl[name], group[:, k], is_clear, least=0.95)
    for k, name in enumerate(WEIGHTS):
        assert_whole_agree(osl[f"at_random.{name}"], weights[:, k], is_clear, least=0.95)


def test_a_group_under_a_footprint_weighs_what_the_kernel_is_in_its_blocks(groups):
    osl, level, query, g, blocks = groups
    own = shared_blocks(osl, blocks)
    group, weights = twin.group_under(own, level, query, g % own.groups)
    known = np.arange(ROWS) >= 20
    np.testing.assert_array_equal(osl.stacked("under.column", "under.row")[known], group[known])
    # A place's rounding in the kernel, whose slope in its argument is at most 2.
    square = np.linalg.inv(blocks.ellipse)
    short = np.sqrt(np.linalg.eigvalsh(square)[:, 0])
    places = np.abs(query.middle).max(axis=1) + blocks.reach.max(axis=1)
    tolerance = 4 * (EPSILON * places / short + ROUNDING * square[:, 0, 0] * square[:, 1, 1] / np.linalg.det(square))
    found = np.stack([osl[f"under.{name}"] for name in WEIGHTS], axis=1)
    assert (weights[known] > 0).mean() > 0.2
    assert (np.abs(found - weights).max(axis=1) < tolerance)[known].all() and np.median(tolerance) < 2e-3


SURE = """
  float weights[MOST_GROUPS];
  float total = 0;
  for (int k = 0; k < count; ++k) {
    weights[k] = in[2 + k];
    total += weights[k];
  }
  float sure = sure_weight(weights, count, read, total);
"""


def test_the_sure_weight_reads_as_many_groups_as_asked_for():
    rng = np.random.default_rng(2)
    inputs = Inputs()
    count = inputs.add("count", rng.integers(1, twin.MOST_GROUPS + 1, ROWS))
    read = inputs.add("read", rng.integers(1, twin.DRAWN_GROUPS + 1, ROWS))
    weights = np.exp(2 * rng.normal(size=(twin.MOST_GROUPS, ROWS)))
    weights[:, :100] = 0.7  # all alike
    weights = np.array([inputs.add(f"weight_{k}", values) for k, values in enumerate(weights)]).T
    osl = inputs.call(HEADER, SURE, ("sure",))["sure"]
    expected = np.array([twin.sure_weight(weights[row, : count[row]], read[row]) for row in range(ROWS)])
    np.testing.assert_array_equal(osl == 0, count <= read)
    # What is left of the total after the larger weights is a difference.
    lost = weights.sum(axis=1) / np.maximum(expected, 1e-30)
    assert (np.abs(osl - expected) <= ROUNDING * np.maximum(lost, 1) * expected).all()
    several = np.flatnonzero(expected > 0)
    found = [np.minimum(weights[row, : count[row]] / osl[row], 1).sum() for row in several]
    np.testing.assert_allclose(found, read[several], rtol=1e-3)
    assert len(several) > 0.7 * ROWS


def listed_groups(blocks, level, query, row):
    """All groups under the footprint of one row that weigh anything, and their weights."""
    one = SimpleNamespace(**{name: np.asarray(values)[row : row + 1] for name, values in vars(blocks).items()})
    level = SimpleNamespace(**{name: values[row : row + 1] for name, values in vars(level).items()})
    query = SimpleNamespace(**{name: values[row : row + 1] for name, values in vars(query).items()})
    method = twin.random_group if one.is_random[0] else twin.group_under
    found = [method(one, level, query, np.array([g]))[:2] for g in range(int(one.groups[0]))]
    places, weights = np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])
    weighs = weights.sum(axis=1) > 0
    return places[weighs], weights[weighs]


def test_the_drawn_groups_stand_for_all(groups):
    osl, level, query, _, blocks = groups
    own = shared_blocks(osl, blocks)
    found = osl.stacked(*(f"weights[{k}]" for k in range(4 * READ))).reshape(ROWS, READ, 4)
    places = np.stack([osl.stacked(*(f"{name}[{k}]" for k in range(READ))) for name in ("columns", "rows")], axis=2)
    compared = 0
    for row in range(20, ROWS):
        all_places, all_weights = listed_groups(own, level, query, row)
        total = all_weights.sum()
        if not own.is_random[row]:
            assert osl["drawn.total"][row] == pytest.approx(total, rel=5e-3)
        assert osl["all"][row] == pytest.approx(osl["drawn.total"][row], rel=1e-4)
        read = int(twin.groups_read(query.hint_count[row]))
        sure = 0.0 if own.is_random[row] else twin.sure_weight(all_weights.sum(axis=1), read)
        drawn, weights, is_clear = twin.drawn_groups(all_places, all_weights, sure, query.random[row, 2])
        if own.is_random[row]:
            assert osl["drawn.count"][row] == own.groups[row]
            continue
        assert osl["drawn.count"][row] <= read + 1
        # A group on the rim weighs nothing or hardly anything, as rounding has it.
        if not is_clear or len(drawn) != osl["drawn.count"][row] or len(drawn) > READ:
            continue
        is_same = (places[row, : len(drawn)] == drawn).all()
        close = np.abs(found[row, : len(drawn)] - weights).max() < 5e-3 * max(weights.max(), 1)
        compared += is_same and close
    assert compared > 0.97 * (own.is_random == 0).sum()
    assert 0.15 < own.is_random.mean() < 0.8


OTHER_TILES = """
  map.variation = 1;
  tile_cut(map.tile_u, map.tile_v, map.width, map.height, map.cut_u, map.cut_v);
  level.group_u = map.width / (float)level.columns;
  level.group_v = map.height / (float)level.rows;
  query.u = map.cut_u + inside_u;
  query.v = map.cut_v + inside_v;
  int leaves = leaves_tile(map, query, reach_u, reach_v);
  Blocks blocks = blocks_under(map, level, query);
  int groups = blocks.groups;
  blocks.is_thin = 0;
  Group found = random_group(blocks, map, level, query, g);
"""


def test_groups_of_other_tiles_are_those_that_their_cuts_show():
    rng = np.random.default_rng(3)
    inputs = Inputs()
    inputs.statements.append("Map map; Level level; Query query;")
    sizes = rng.integers(60, 300, (ROWS, 2))
    tile = rng.integers(-50, 50, (ROWS, 2))
    inputs.fill("map", width=sizes[:, 0], height=sizes[:, 1], tile_u=tile[:, 0], tile_v=tile[:, 1])
    counts = rng.integers(1, 4, (ROWS, 2))
    inputs.fill("level", columns=counts[:, 0], rows=counts[:, 1])
    footprint = footprint_inputs(inputs, random_axes(rng, largest=1.3, thin=1.2) * 60)
    inputs.statements.append("query.footprint = footprint;")
    random = inputs.fill("query", random=rng.uniform(0, 1, (ROWS, 3))).random
    names = "inside_u", "inside_v"
    inside = np.stack([inputs.add(name, rng.uniform(0, sizes[:, k])) for k, name in enumerate(names)], axis=1)
    reach = np.stack([inputs.add(f"reach_{axis}", rng.uniform(0, 60, ROWS)) for axis in "uv"], axis=1)
    g = inputs.add("g", rng.integers(0, twin.FAR_GROUPS, ROWS))
    osl = inputs.call(HEADER, OTHER_TILES, (
        "leaves", "found.column", "found.row", "found.shift_u", "found.shift_v", "groups", "blocks.is_random"))

    margin = np.minimum(inside - reach, sizes - inside - reach).min(axis=1)
    assert_whole_agree(osl["leaves"], (margin < 0).astype(int), np.abs(margin) > 1e-3)
    cut = np.array([tiles.tile_cut(*pair) for pair in zip(tile, sizes, strict=True)])
    query = SimpleNamespace(middle=cut + inside, random=random, axes=footprint.axes)
    group_u, group_v = (sizes / counts).T
    level = SimpleNamespace(group_u=group_u, group_v=group_v, columns=counts[:, 0], rows=counts[:, 1])
    blocks = twin.blocks_under(level, query)
    own_reach = blocks.reach - np.stack([blocks.side_u, blocks.side_v], axis=1) / 2
    own_margin = np.minimum(inside - own_reach, sizes - inside - own_reach).min(axis=1)
    few = np.where(counts.prod(axis=1) == 1, 1, twin.DRAWN_GROUPS)
    groups = np.where(blocks.is_random | (own_margin >= 0), blocks.groups, few)
    sure = (np.abs(own_margin) > 1e-3) & ~near_whole(blocks.edges)
    assert_whole_agree(osl["groups"], groups, sure, least=0.9)
    assert_whole_agree(osl["blocks.is_random"], blocks.is_random | (own_margin < 0), sure, least=0.9)

    level = SimpleNamespace(group_u=np.ones(ROWS), group_v=np.ones(ROWS))
    point = twin.random_group(SimpleNamespace(is_thin=np.zeros(ROWS, bool)), level, query, g)[2]
    away = (point - cut) / sizes
    other = np.array([tiles.tile_cut(*pair) for pair in zip(tile + np.floor(away).astype(int), sizes, strict=True)])
    place = (point - cut + other) / sizes * counts
    is_clear = (np.abs(away - np.round(away)) > 1e-3).all(axis=1) & (np.abs(place - np.round(place)) > 1e-3).all(axis=1)
    assert 0.2 < (np.floor(away) != 0).any(axis=1).mean() < 0.8
    expected = np.concatenate([np.floor(place), cut - other], axis=1).T
    for name, values in zip(("column", "row", "shift_u", "shift_v"), expected, strict=True):
        assert_whole_agree(osl[f"found.{name}"], values, is_clear, least=0.9)
