"""Each function of osl/slope_cells.h against its twin, on a table that the baker wrote."""

from types import SimpleNamespace

import numpy as np
import pytest

from glint_addon.bake import float_image
from glint_addon.bake import slope_index as bake
from tests.helpers.normals import random_normals
from tests.helpers.osl_functions import EPSILON, MARGIN, ROUNDING, ROWS, Inputs, assert_whole_agree
from tests.reference import slope_cells as twin
from tests.reference.random_inputs import frames_near, random_frames

HEADER = "slope_cells.h"
SIZE = (100, 70)
SEVERAL = np.arange(64 * 16 * 4, dtype=np.float32).reshape(16, 64, 4)  # of a file of several rows


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """The path of an index and its list of texels (texels, 4)."""
    # Slopes change little within a patch, but for a few that stick out.
    i, j = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    waves = np.stack([0.3 * np.sin(i / 3), 0.3 * np.cos(j / 3), np.ones(i.shape)], axis=2)
    normals = waves + 0.03 * random_normals(*SIZE)
    normals[::9, ::13] = random_normals(*SIZE)[::9, ::13]
    normals[5::7, ::3] = 0
    pixels = bake.index_texels(normals.astype(np.float32))
    texels = pixels.reshape(-1, 4)
    for block, (texel, channel) in enumerate(((1, 3), (1, 0), (1, 1), (0, 2))):
        texels[block * twin.RECORD + texel, channel] = 0
    texels[4 * twin.RECORD + 1, 2] += 0.5
    path = tmp_path_factory.mktemp("index") / "index.exr"
    float_image.write_whole(path, pixels)
    return path.as_posix(), texels


LAYOUT = """
  Index index = map_index("{file}", width, height);
  int place;
  int start = block_start(i, width, place);
  Index own = map_index("{file}", {width}, {height});
  float fourth = 0;
  color found = index_texel(own, texel, fourth);
  Index rows;
  rows.table = "{several}";
  rows.log_width = 6;
  rows.inverse_width = 1.0 / {columns};
  rows.inverse_height = 1.0 / {rows};
  float last = 0;
  color in_rows = index_texel(rows, texel_in_rows, last);
"""


@pytest.fixture(scope="module")
def layout(table, tmp_path_factory):
    """Where blocks and texels lie: (OSL's results, width, height, i, texel, texel of a file of several rows)."""
    several = tmp_path_factory.mktemp("index") / "several.exr"
    float_image.write_whole(several, SEVERAL)
    rng = np.random.default_rng(1)
    inputs = Inputs()
    width, height = (inputs.add(name, np.exp(rng.uniform(0, np.log(16384), ROWS)).astype(int))
                     for name in ("width", "height"))
    i = inputs.add("i", rng.integers(-3, 3, ROWS) * width + rng.integers(0, width))
    texel = inputs.add("texel", rng.integers(0, len(table[1]), ROWS))
    in_rows = inputs.add("texel_in_rows", rng.permutation(SEVERAL.size // 4)[:ROWS])
    body = LAYOUT.format(file=table[0], width=SIZE[0], height=SIZE[1], several=several.as_posix(),
                         columns=SEVERAL.shape[1], rows=SEVERAL.shape[0])
    fields = [f"index.{name}" for name in ("columns", "rows", "log_width", "inverse_width", "inverse_height")]
    results = [*fields, "start", "place", "found[0]", "found[1]", "found[2]", "fourth", "in_rows[0]", "in_rows[1]",
               "in_rows[2]", "last"]
    return inputs.call(HEADER, body, results), width, height, i, texel, in_rows


def test_a_texel_of_the_list_is_what_the_baker_wrote(layout, table):
    osl, _, _, _, texel, _ = layout
    expected = twin.index_texel(table[1], texel)
    assert (expected != 0).mean() > 0.2
    np.testing.assert_array_equal(osl.stacked("found[0]", "found[1]", "found[2]", "fourth"), expected)


def test_a_texel_of_a_list_of_several_rows(layout):
    osl, *_, texel = layout
    # Row 0 at the bottom, as in the array.
    expected = twin.index_texel(SEVERAL.reshape(-1, 4), texel)
    np.testing.assert_array_equal(osl.stacked("in_rows[0]", "in_rows[1]", "in_rows[2]", "last"), expected)


def test_the_shape_of_an_index_is_that_of_the_baker(layout):
    osl, width, height, *_ = layout
    for field, values in vars(twin.map_index(width, height)).items():
        assert len(np.unique(values)) > 1
        np.testing.assert_array_equal(osl[f"index.{field}"], np.float32(values))


def test_the_block_around_a_texel_where_the_map_repeats(layout):
    osl, width, _, i, *_ = layout
    start, place = twin.block_start(i, width)
    assert_whole_agree(osl["start"], start, True)
    assert_whole_agree(osl["place"], place, True)


REGION = """
  SlopeBasis basis = slope_basis(hint);
  float low = 0;
  float high = 0;
  region_bounds(basis.g3 + c1 * basis.g1 + c2 * basis.g2, basis.g1, basis.g2, radius, axis, low, high);
  int is_upright = region_is_upright(basis, c1, c2, radius);
"""


def regions(rng, inputs, forms):
    """Random regions around half vectors: forms (n, 3, 3), middles and radii."""
    hint = inputs.structure("HalfVector", "hint", f1=forms[:, 0], f2=forms[:, 1], f3=forms[:, 2])
    forms = np.stack([hint.f1, hint.f2, hint.f3], axis=1)
    radius = inputs.add("radius", rng.uniform(0.02, 0.4, ROWS))
    c1, c2 = (inputs.add(name, rng.uniform(-0.2, 0.2, ROWS)) for name in ("c1", "c2"))
    return forms, c1, c2, radius


@pytest.fixture(scope="module")
def region():
    """The slopes of regions: (OSL's results, forms, c1, c2, radius, axis)."""
    rng = np.random.default_rng(2)
    inputs = Inputs()
    arguments = regions(rng, inputs, random_frames(rng))
    axis = inputs.add("axis", rng.integers(0, 2, ROWS))
    vectors = [f"basis.g{n}[{k}]" for n in (1, 2, 3) for k in range(3)]
    return inputs.call(HEADER, REGION, [*vectors, "low", "high", "is_upright"]), *arguments, axis


def test_the_normals_of_slopes_are_the_inverse_of_the_forms(region):
    osl, forms, *_ = region
    found = osl.stacked(*(f"basis.g{n}[{k}]" for n in (1, 2, 3) for k in range(3))).reshape(ROWS, 3, 3)
    error = np.abs(found - twin.slope_basis(forms)).max(axis=(1, 2))
    assert (error < ROUNDING * np.linalg.cond(forms)).all()
    # As the header says: n(p) has the slopes p.
    np.testing.assert_allclose(forms @ found.transpose(0, 2, 1), np.tile(np.eye(3), (ROWS, 1, 1)), atol=4 * ROUNDING)


def test_a_region_is_upright_if_all_its_normals_are(region):
    osl, forms, c1, c2, radius, _ = region
    expected, margin = twin.region_is_upright(twin.slope_basis(forms), c1, c2, radius)
    assert 0.1 < expected.mean() < 0.9
    assert_whole_agree(osl["is_upright"], expected, np.abs(margin) > MARGIN)


def test_bounds_of_the_slopes_in_a_region(region):
    osl, forms, c1, c2, radius, axis = region
    basis = twin.slope_basis(forms)
    upright, margin = twin.region_is_upright(basis, c1, c2, radius)
    middle = c1[:, None] * basis[:, 0] + c2[:, None] * basis[:, 1] + basis[:, 2]
    low, high = twin.region_bounds(middle, basis[:, 0], basis[:, 1], radius, axis)
    # Only upright regions are asked for bounds. The root is a difference that is small beside the squares in it.
    height = margin + twin.NUMBERS["INDEX_HEIGHT"]
    tolerance = (ROUNDING / radius + 1e-5 * radius) / height**2 * (1 + np.abs(low) + np.abs(high))
    assert upright.sum() > 100 and np.median(tolerance[upright]) < 1e-3
    assert (np.abs(osl["low"] - low) < tolerance)[upright].all()
    assert (np.abs(osl["high"] - high) < tolerance)[upright].all()


def test_bounds_without_strength_hold_for_all_heights():
    rng = np.random.default_rng(3)
    inputs = Inputs()
    strength = rng.uniform(0.1, 3, ROWS) * rng.choice([-1, 1, 1], ROWS)
    strength = inputs.add("strength", strength)
    least_z = inputs.add("least_z", rng.uniform(0.1, 1, ROWS))
    bounds = np.sort(rng.normal(size=(2, ROWS)), axis=0)
    low, high = (inputs.add(name, values) for name, values in zip(("low", "high"), bounds, strict=True))
    osl = inputs.call(HEADER, "unscaled_bounds(strength, least_z, low, high);", ("low", "high"))
    expected = twin.unscaled_bounds(strength, least_z, low, high)
    for name, values in zip(("low", "high"), expected, strict=True):
        np.testing.assert_allclose(osl[name], values, rtol=8 * EPSILON)


CELLS = """
  map.costs.fetches = 0;
  Index index = map_index("{file}", {width}, {height});
  CellRange range = block_cells(map, index, record, slope_basis(hint), c1, c2, radius);
  int fetches = map.costs.fetches;
  int row = range.from2 + (range.is_intact ? which % (range.to2 - range.from2 + 1) : 0);
  int start = 0;
  int end = 0;
  if (range.is_intact) {{
    row_elements(map, index, record, range, row, start, end);
  }}
  int row_fetches = map.costs.fetches - fetches;
"""
RANGE = ("from1", "to1", "from2", "to2", "listed", "absent", "is_intact")


@pytest.fixture(scope="module")
def cells(table):
    """The cells of blocks for regions that are upright: (OSL's results, strength, record, basis, c1, c2, radius)."""
    rng = np.random.default_rng(4)
    inputs = Inputs()
    inputs.statements.append("Map map;")
    strength = inputs.add("map.strength", np.where(rng.random(ROWS) < 0.4, 1.0, rng.uniform(0.3, 2, ROWS)))
    blocks = bake.blocks(SIZE[0]) * bake.blocks(SIZE[1])
    record = inputs.add("record", twin.RECORD * rng.integers(0, blocks, ROWS))
    arguments = regions(rng, inputs, frames_near(rng, rng.uniform(-0.5, 0.5, (ROWS, 2))))
    inputs.add("which", rng.integers(0, 50, ROWS))
    body = CELLS.format(file=table[0], width=SIZE[0], height=SIZE[1])
    results = [f"range.{name}" for name in RANGE] + ["row", "start", "end", "fetches",
                                                     "row_fetches"]
    forms, *region = arguments
    return inputs.call(HEADER, body, results), strength, record, twin.slope_basis(forms), *region


def test_the_cells_that_a_region_can_reach(cells, table):
    osl, strength, record, *region = cells
    upright, margin = twin.region_is_upright(*region)
    expected, is_clear = twin.block_cells(table[1], strength, record, *region)
    is_clear &= upright & (margin > 0.02)
    assert is_clear.mean() > 0.3
    whole = is_clear & expected.is_intact
    np.testing.assert_array_equal(osl["range.is_intact"] != 0, expected.is_intact)
    np.testing.assert_array_equal(osl["range.listed"], expected.listed)
    np.testing.assert_array_equal(osl["range.absent"], expected.absent)
    assert len(np.unique(expected.absent)) > 2
    for name in RANGE[:4]:
        assert_whole_agree(osl[f"range.{name}"][whole], getattr(expected, name)[whole], True)
    np.testing.assert_array_equal((osl["range.to2"] < osl["range.from2"]), ~expected.is_intact)
    assert (expected.from2 > 0)[whole].any() and (expected.to2 < twin.ROWS - 1)[whole].any()
    assert set(record[~expected.is_intact] // twin.RECORD) == set(range(5)), "each damage is noticed"
    np.testing.assert_array_equal(osl["fetches"], 2)


def test_the_elements_in_a_row_of_cells(cells, table):
    osl, _, record, *_ = cells
    intact = osl["range.is_intact"] != 0
    found = {name: osl[f"range.{name}"].astype(int)[intact] for name in RANGE}
    found = SimpleNamespace(**found)
    row = osl["row"].astype(int)[intact]
    start, end = twin.row_elements(table[1], record[intact], found, row)
    assert_whole_agree(osl["start"][intact], start, True)
    assert_whole_agree(osl["end"][intact], end, True)
    assert (end > start).any() and (row == twin.ROWS - 1).any() and (found.to1 == twin.COLUMNS - 1).any()
    # One fetch holds four cells: two lie in one or in two texels.
    assert set(osl["row_fetches"][intact]) == {1, 2}


def test_the_constants_are_those_of_the_baker():
    expected = (bake.MAGIC, bake.SIDE, bake.COLUMNS, bake.ROWS, bake.RECORD, bake.FIRST_PREFIX, bake.FIRST_ELEMENT)
    names = ("MAGIC", "SIDE", "COLUMNS", "ROWS", "RECORD", "FIRST_PREFIX", "FIRST_ELEMENT")
    assert tuple(twin.NUMBERS[f"INDEX_{name}"] for name in names) == expected
