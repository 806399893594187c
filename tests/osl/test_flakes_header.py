"""Each function of osl/flakes.h against its twin, on a table that the baker wrote."""

from types import SimpleNamespace

import numpy as np
import pytest

from glint_addon.bake import flakes as bake
from glint_addon.bake.normal_map import flake_normals
from glint_addon.bake.slope_counts import slope_box
from glint_addon.bake.table import bake_table
from tests.helpers.osl_functions import EPSILON, FAST_MATH, MARGIN, ROWS, Inputs, assert_whole_agree, each, split
from tests.osl.queries import declared_map
from tests.osl.shading import SURFACE, TURNED, VIEW, give_view, random_texels, surface_of
from tests.reference import flakes as twin
from tests.reference import lobe
from tests.reference.random_inputs import footprint_inputs, random_axes

HEADER = "flakes.h"
SIZE = (300, 200)  # two regions by one, no whole blocks
HALF = 2.0**-11  # rounding of a 16-bit float
COMPARED = 400  # rows of which the twin looks at every texel
LAYOUT = """
  Map map;
  map.variation = 0; map.cut_u = 0; map.cut_v = 0;
  map.width = width; map.height = height; map.flakes.have_colors = have_colors;
  lay_flakes(map);
  int before = texels_before_level(map, level);
"""


def test_the_layout_is_that_of_the_baker():
    rng = np.random.default_rng(1)
    inputs = Inputs()
    width, height = (inputs.add(name, np.exp(rng.uniform(0, np.log(4096), ROWS)).astype(int))
                     for name in ("width", "height"))
    has_colors = inputs.add("have_colors", rng.integers(0, 2, ROWS))
    expected = twin.lay_flakes(width, height, has_colors)
    level = inputs.add("level", rng.integers(0, expected.levels + 2))
    names = ("levels", "log_width", "inverse_width", "inverse_height")
    calls = ("flakes_regions(width)", "level_blocks(width, level)")
    osl = inputs.call(HEADER, LAYOUT, (*(f"map.flakes.{name}" for name in names), *calls, *split("before")))
    for name in names:
        np.testing.assert_array_equal(osl[f"map.flakes.{name}"], np.float32(getattr(expected, name)))
    assert_whole_agree(osl[calls[0]], twin.flakes_regions(width), True)
    assert_whole_agree(osl[calls[1]], twin.level_blocks(width, level), True)
    before = twin.texels_before_level(width, height, has_colors, level)
    assert_whole_agree(osl.joined("before"), before, True)
    assert before.max() > 2**20, "no list is longer than a row of its file"


@pytest.fixture(scope="module", params=[True, False], ids=["colours", "no colours"])
def sheet(request, tmp_path_factory):
    """A map of flakes whose colours depend on slope and place, and its tables."""
    rng = np.random.default_rng(2)
    # Dense on the left, sparse on the right, with blocks that have none.
    presence = rng.random(SIZE[::-1]) < np.where(np.arange(SIZE[0]) < 150, 0.5, 0.02)
    slopes = rng.normal(0, 0.2, (*SIZE[::-1], 2))
    normals = flake_normals(np.dstack([slopes, np.ones(SIZE[::-1])]).astype(np.float32), presence)
    colors = rng.uniform(0.5, 1, (*SIZE[::-1], 3)).astype(np.float32)
    colors[..., 1] *= np.where(normals[..., 0] > 0, 1, 0.2)
    colors[..., 2] *= np.linspace(0.1, 1, SIZE[1], dtype=np.float32)[:, None]
    folder = tmp_path_factory.mktemp("flakes")
    file, _ = bake_table(normals, folder, interpolation="CLOSEST")
    path, _ = bake.bake_flakes(normals, colors if request.param else None, folder)
    texels = bake.flakes_texels(normals, colors if request.param else None)[::-1].reshape(-1, 4)
    declared = declared_map(file, normals, is_linear=False, has_flakes=True)
    declared += f'map.flakes.table = "{path.as_posix()}"; map.flakes.have_colors = {int(request.param)};\n'
    return SimpleNamespace(presence=presence, normals=normals, colors=colors if request.param else np.ones_like(colors),
                           texels=texels.astype(float), declared=declared, has_colors=request.param,
                           box=slope_box(normals))


TEXELS = """
  lay_flakes(map);
  float fourth = 0;
  color found = flakes_texel(map, texel, fourth);
  int is_intact = flakes_are_intact(map);
  Map other = map;
  other.flakes.have_colors = !map.flakes.have_colors;
  Map none = map;
  none.flakes.table = "no such file.exr";
  color flake = map.flakes.have_colors ? flake_color(map, i, j) : color(1);
"""


def test_texels_are_what_the_baker_wrote_and_flakes_have_their_colours(sheet):
    rng = np.random.default_rng(3)
    given = Inputs()
    texel = given.add("texel", rng.integers(0, len(sheet.texels), ROWS))
    i, j = given.add("i", rng.integers(0, SIZE[0], ROWS)), given.add("j", rng.integers(0, SIZE[1], ROWS))
    osl = given.evaluate((HEADER,), sheet.declared, TEXELS, (
        *each("found"), "fourth", *each("flake"), "is_intact", "flakes_are_intact(other)", "flakes_are_intact(none)",
    ))
    np.testing.assert_array_equal(osl[:, :4], twin.flakes_texel(sheet.texels, texel))
    seen = sheet.presence[j, i]
    np.testing.assert_allclose(osl[seen, 4:7], twin.flake_color(sheet.colors, i, j)[seen], rtol=HALF)
    np.testing.assert_array_equal(osl[:, 7:], np.tile([1, 0, 0], (ROWS, 1)))


AROUND = """
  lay_flakes(map);
  Hit hit = map_hit(map, point(across, up, 0));
  int taps = 0;
  int level = coverage_level(footprint, map.flakes.levels, taps);
  float along_u = 0;
  float along_v = 0;
  long_axis(footprint, along_u, along_v);
  map.costs.fetches = 0;
  FlakesAround around = flakes_around(map, hit, footprint);
  int fetches = map.costs.fetches;
  hit.flakes.mean = around.mean;
  color merged = 1;
  color own = 1;
  color single = 1;
  if (map.flakes.have_colors) {
    merged = merged_color(map, hit, slope1, slope2);
    own = element_color(map, hit, 1, slope1, slope2);
    single = element_color(map, hit, 0, hit.column, hit.row);
  }
"""


@pytest.fixture(scope="module")
def around(sheet):
    """What OSL finds around hit points, and the inputs."""
    rng = np.random.default_rng(4)
    given = Inputs()
    axes = footprint_inputs(given, random_axes(rng, largest=3.1, thin=1.2) * 0.6).axes
    uv = given.floats("float across, float up", rng.uniform(0, 1, (ROWS, 2)))
    slope = given.floats("float slope1, float slope2", rng.normal(0.5, 0.2, (ROWS, 2)))
    osl = given.evaluate((HEADER,), sheet.declared, AROUND, (
        "level", "taps", "along_u", "along_v", "around.coverage", *each("around.mean", "merged", "own", "single"),
        "fetches",
    ))
    return osl, axes, uv * SIZE, slope


def test_the_level_and_the_row_of_blocks_are_as_wide_as_the_footprint(around):
    osl, axes, _, _ = around
    long, short = np.linalg.svd(axes, compute_uv=False).T
    level, taps, is_clear = twin.coverage_level(long, short, bake.level_count(*SIZE))
    assert_whole_agree(osl[:, 0], level, is_clear)
    assert_whole_agree(osl[:, 1], taps, is_clear)
    # A block of one texel is known from the hit.
    expected = np.where((level == 0) & (taps == 1), 0, taps)
    np.testing.assert_array_equal(osl[is_clear, -1], expected[is_clear])
    assert set(taps) == set(range(1, twin.TAPS + 1)) and {0, bake.level_count(*SIZE)} <= set(level)


def test_the_long_axis_of_a_footprint(around):
    osl, axes, _, _ = around
    expected = twin.long_axis(axes)
    found = osl[:, 2:4] * np.sign((osl[:, 2:4] * expected).sum(axis=1, keepdims=True))
    long, short = np.linalg.svd(axes, compute_uv=False).T
    # The direction is a difference of the axes' squares.
    tolerance = 10 * FAST_MATH * long / np.maximum(1 - (short / long) ** 2, 1e-6)
    assert np.median(tolerance / long) < 1e-3
    assert (np.abs(found - expected).max(axis=1) < tolerance).all()


def test_the_flakes_around_a_hit_point_are_those_of_blocks_along_the_footprint(around, sheet):
    osl, axes, hit, _ = (values[:COMPARED] for values in around)
    coverage, mean, is_clear, level = twin.flakes_around(
        sheet.presence, sheet.colors, hit, axes, bake.level_count(*SIZE))
    assert is_clear.mean() > 0.9 and 0.1 < (level == 0).mean() < 0.5
    np.testing.assert_allclose(osl[is_clear, 4], coverage[is_clear], rtol=2 * HALF, atol=EPSILON)
    known = is_clear & (coverage > 0)
    assert 0.6 < known.mean() < 0.98
    # A block without flakes has a weight of a millionth.
    np.testing.assert_allclose(osl[known, 5:8], mean[known], rtol=3 * HALF)
    assert (osl[:, 5:8] > 0).all()


def test_merged_flakes_have_the_colour_of_their_slopes_in_their_region(around, sheet):
    osl, _, hit, slope = (values[:COMPARED] for values in around)
    if not sheet.has_colors:
        pytest.skip("without colours nothing is asked")
    places = slope * bake.BINS
    is_clear = (np.abs(places - np.round(places)) > MARGIN * bake.BINS).all(axis=1)
    is_clear &= (np.abs(hit - np.round(hit)) > 1e-3).all(axis=1)
    expected = twin.merged_color(sheet.normals, sheet.colors, sheet.box, osl[:, 5:8], hit, slope)
    assert is_clear.mean() > 0.9
    np.testing.assert_allclose(osl[is_clear, 8:11], expected[is_clear], rtol=4 * HALF)
    assert (np.abs(expected / osl[:, 5:8] - 1) > 0.1).mean() > 0.2
    np.testing.assert_array_equal(osl[:, 11:14], osl[:, 8:11])


def test_single_flakes_have_their_own_colour(around, sheet):
    osl, _, hit, _ = around
    is_clear = (np.abs(hit - np.round(hit)) > 1e-3).all(axis=1)
    i, j = np.floor(hit).astype(int).T % np.array(SIZE)[:, None]
    is_clear &= sheet.presence[j, i]
    assert is_clear.mean() > 0.2
    np.testing.assert_allclose(osl[is_clear, 14:17], sheet.colors[j, i][is_clear], rtol=HALF)


def test_a_hit_point_has_the_flakes_under_the_footprint_of_its_sample(sheet):
    rng = np.random.default_rng(5)
    given = Inputs()
    texels = random_texels(rng, 0.2, 400)
    texels[:100] = 0  # the UVs have no derivatives
    texels, samples, bounce = give_view(given, texels, rng.integers(1, 300, ROWS), np.zeros(ROWS))
    uv = given.floats("float across, float up", rng.uniform(0, 1, (ROWS, 2)))
    body = """
      lay_flakes(map);
      Hit hit = map_hit(map, point(across, up, 0));
      add_flakes(view, map, hit);
      map.flakes.are_there = 0;
      Hit covered = map_hit(map, point(across, up, 0));
      add_flakes(view, map, covered);
    """
    osl = given.evaluate(("lobe.h",), VIEW + sheet.declared, body, (
        "hit.flakes.coverage", *each("hit.flakes.mean"), "covered.flakes.coverage", *each("covered.flakes.mean"),
        *SURFACE), rotation=TURNED)
    np.testing.assert_array_equal(osl[:, 4:8], 1)
    hit = uv * SIZE
    _, footprint = lobe.round_footprint(surface_of(osl), texels, samples, bounce)
    axes = np.where(np.arange(ROWS)[:, None, None] < 100, 0.0, footprint.axes())[:COMPARED]
    coverage, mean, is_clear, level = twin.flakes_around(
        sheet.presence, sheet.colors, hit[:COMPARED], axes, bake.level_count(*SIZE))
    i, j = np.floor(hit[:100]).astype(int).T
    np.testing.assert_array_equal(coverage[:100], sheet.presence[j, i])
    assert is_clear.mean() > 0.9 and level.max() > 4
    np.testing.assert_allclose(osl[:COMPARED][is_clear, 0], coverage[is_clear], rtol=2 * HALF, atol=EPSILON)
    known = is_clear & (coverage > 0)
    np.testing.assert_allclose(osl[:COMPARED][known, 1:4], mean[known], rtol=3 * HALF)
