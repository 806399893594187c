"""Each function of osl/counts_table.h against its twin, and against what the baker wrote."""

import numpy as np
import pytest

from glint_addon.bake import counts as bake
from glint_addon.bake import float_image
from tests.helpers.normals import random_normals
from tests.helpers.osl_functions import EPSILON, ROWS, Inputs, assert_whole_agree, split
from tests.reference import counts_table as twin
from tests.reference.random_inputs import footprint_inputs, random_axes

HEADER = "counts_table.h"
LAYOUT = """
  int before = texels_before(counts, block, width, height, is_linear);
  Level level = counts_level(counts, block, width, height, is_linear);
"""
LAYOUT_RESULTS = (
    "level_corners(block, is_linear)", "level_groups(width, block)", "level_groups(height, block)", *split("before"),
    "level.block", "level.corners", "level.columns", "level.rows", *split("level.first"), "level.group_u",
    "level.group_v", "level.unit", "level.log_width", "level.inverse_width", "level.inverse_height",
)


@pytest.fixture(scope="module")
def layout():
    """The layout of random levels of random maps."""
    rng = np.random.default_rng(1)
    width, height = np.exp(rng.uniform(0, np.log(4096), (2, ROWS))).astype(int)
    is_linear = rng.integers(0, 2, ROWS)
    every = [bake.counts_levels(int(w), int(h), twin.interpolation(linear))
             for w, h, linear in zip(width, height, is_linear, strict=True)]
    start = np.array([rng.integers(0, len(levels)) for levels in every])
    levels = np.array([rng.integers(1, len(sides) - k + 1) for sides, k in zip(every, start, strict=True)])
    first = np.array([sides[k] for sides, k in zip(every, start, strict=True)])
    inputs = Inputs()
    counts = inputs.structure("Counts", "counts", first=first, levels=levels)
    arguments = [inputs.add(name, values) for name, values in (
        ("block", first << rng.integers(0, levels)), ("width", width), ("height", height), ("is_linear", is_linear),
    )]
    return inputs.call(HEADER, LAYOUT, LAYOUT_RESULTS), counts, arguments


def test_corners_of_a_level_are_those_of_the_baker(layout):
    osl, _, (block, _, _, is_linear) = layout
    assert_whole_agree(osl["level_corners(block, is_linear)"], twin.level_corners(block, is_linear), True)


def test_groups_along_a_side_are_those_of_the_baker(layout):
    osl, _, (block, width, height, _) = layout
    assert_whole_agree(osl["level_groups(width, block)"], twin.level_groups(width, block), True)
    assert_whole_agree(osl["level_groups(height, block)"], twin.level_groups(height, block), True)


def test_texels_before_a_level_are_those_of_the_baker(layout):
    osl, counts, arguments = layout
    expected = twin.texels_before(counts, *arguments)
    assert_whole_agree(osl.joined("before"), expected, True)
    assert expected.max() > 2**20, "no list is longer than a row of its file"


def test_a_level_is_that_of_the_baker(layout):
    osl, counts, arguments = layout
    expected = vars(twin.counts_level(counts, *arguments))
    np.testing.assert_array_equal(osl.joined("level.first"), expected.pop("first"))
    for field, values in expected.items():
        assert len(np.unique(values)) > 1, field
        # Quotients are rounded once, or by three operations where a unit is a quotient of a product.
        np.testing.assert_allclose(osl[f"level.{field}"], values, rtol=4 * EPSILON, atol=0, err_msg=field)


SIZE = (300, 200)
LEVELS = (32, 128)
SHAPE = (64, 16)  # of a file of several rows: width, height
TEXELS = """
  Counts whole;
  whole.table = "{whole}";
  whole.first = 32;
  whole.levels = 3;
  Level level = counts_level(whole, 64, {width}, {height}, 1);
  float fourth = 0;
  color found = counts_texel(whole, level, texel, fourth);
  counts.table = "{whole}";
  int is_whole = counts_are_intact(counts, level);
  counts.table = "{cut}";
  int is_cut = counts_are_intact(counts, level);
  counts.table = "/no/such/file.exr";
  int is_missing = counts_are_intact(counts, level);
  Level rows;
  rows.log_width = 6;
  rows.inverse_width = 1.0 / {columns};
  rows.inverse_height = 1.0 / {rows};
  counts.table = "{several}";
  color in_rows = counts_texel(counts, rows, texel_in_rows, fourth);
"""


@pytest.fixture(scope="module")
def texels(tmp_path_factory):
    """Random texels of files, and whether files with and without a header are taken for whole."""
    folder = tmp_path_factory.mktemp("counts")
    files = {name: folder / f"{name}.exr" for name in ("whole", "cut", "several")}
    rng = np.random.default_rng(2)
    normals = random_normals(*SIZE)
    pixels = bake.counts_texels(normals, "LINEAR", LEVELS, bake.slope_box(normals))
    float_image.write_whole(files["whole"], pixels)
    cut = pixels.copy()
    cut[0, -1] = 0  # the file's last texel
    float_image.write_whole(files["cut"], cut)
    several = np.arange(4 * SHAPE[0] * SHAPE[1], dtype=np.float32).reshape(SHAPE[1], SHAPE[0], 4)
    float_image.write_whole(files["several"], several)
    inputs = Inputs()
    # A third of the rows name what the file holds; the others name another first level, or other levels.
    first, levels = np.full(ROWS, 32), np.full(ROWS, 3)
    first[ROWS // 3 : 2 * ROWS // 3] = 16
    levels[2 * ROWS // 3 :] = rng.choice([1, 2, 4], ROWS - 2 * ROWS // 3)
    counts = inputs.structure("Counts", "counts", first=first, levels=levels)
    texel = inputs.add("texel", rng.integers(0, pixels.shape[0] * pixels.shape[1], ROWS))
    in_rows = inputs.add("texel_in_rows", rng.permutation(SHAPE[0] * SHAPE[1])[:ROWS])
    body = TEXELS.format(**{name: file.as_posix() for name, file in files.items()}, width=SIZE[0], height=SIZE[1],
                         columns=SHAPE[0], rows=SHAPE[1])
    osl = inputs.call(HEADER, body, ("found[0]", "found[1]", "found[2]", "fourth", "is_whole", "is_cut",
                                     "is_missing", "in_rows[0]", "in_rows[1]", "in_rows[2]"))
    # In the order of the file, whose rows lie from the top down.
    return osl, counts, (texel, pixels[::-1].reshape(-1, 4)), (in_rows, several[::-1].reshape(-1, 4))


def test_a_texel_of_the_list_is_what_the_baker_wrote(texels):
    osl, _, (texel, written), _ = texels
    expected = twin.counts_texel(written, texel)
    assert (expected > 0).mean() > 0.1
    np.testing.assert_array_equal(osl.stacked("found[0]", "found[1]", "found[2]"), expected[:, :3])


def test_a_texel_of_a_list_of_several_rows(texels):
    osl, _, _, (texel, written) = texels
    expected = twin.counts_texel(written, texel)
    np.testing.assert_array_equal(osl.stacked("in_rows[0]", "in_rows[1]", "in_rows[2]", "fourth"), expected)


def test_a_table_is_intact_only_if_its_header_is_the_one_named(texels):
    osl, counts, (_, written), _ = texels
    expected = twin.counts_are_intact(counts, written)
    assert 0.2 < expected.mean() < 0.5
    np.testing.assert_array_equal(osl["is_whole"] != 0, expected)
    np.testing.assert_array_equal(osl["is_cut"] != 0, twin.counts_are_intact(counts, np.zeros((1, 4))))
    np.testing.assert_array_equal(osl["is_missing"] != 0, twin.counts_are_intact(counts, None))


def test_the_blocks_of_a_footprint_are_as_wide_as_its_size_allows():
    rng = np.random.default_rng(3)
    inputs = Inputs()
    counts = inputs.structure("Counts", "counts", first=rng.choice([0, 16, 32, 64, 128], ROWS),
                              levels=rng.integers(1, 8, ROWS))
    footprint = footprint_inputs(inputs, random_axes(rng, largest=3.7, thin=1.5))
    names = ("FAR_SIDE", "FAR_SIDE_FIRST", "FAR_SIDE_SUBSET")
    widest = inputs.add("widest", rng.choice([twin.NUMBERS[name] for name in names], ROWS))
    osl = inputs.call(HEADER, "", ("far_block(counts, footprint, widest)",))["far_block(counts, footprint, widest)"]

    expected = twin.far_block(counts, footprint.axes, footprint.short_axis, widest)
    # A larger footprint has larger blocks, or the same: rounding decides where a little larger and smaller ones differ.
    sizes = [twin.far_block(counts, scale * footprint.axes, scale * footprint.short_axis, widest)
             for scale in (1 - 1e-5, 1 + 1e-5)]
    assert_whole_agree(osl, expected, sizes[0] == sizes[1])
    assert (expected == 0).mean() < 0.8 and len(np.unique(expected)) > 6
    is_level = [block == 0 or block in [first << k for k in range(levels)]
                for block, first, levels in zip(osl.astype(int), counts.first, counts.levels, strict=True)]
    assert np.all(is_level)
    assert not osl[counts.first == 0].any()
