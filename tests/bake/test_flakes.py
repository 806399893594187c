"""The flakes table: parts of area and mean colours that add up at every scale; maps of flakes in the other tables."""

import re

import numpy as np
import pytest

from glint_addon import paths
from glint_addon.bake import flakes, slope_counts, slope_index, table
from glint_addon.bake.normal_map import are_flakes, flake_normals, slope_bounds
from glint_addon.bake.openimageio import oiio
from glint_addon.errors import CancelledError, MapError
from tests.helpers.normals import random_normals

SIZES = [(100, 37), (1, 300), (1, 1), (300, 260), (131, 129)]  # width, height
HALF = 2.0**-11  # rounding of a 16-bit float
SMALLEST = 2.0**-24  # number that a 16-bit float holds
BYTES_A_TEXEL = {True: 16, False: 4}  # with colours and without, at a square map whose side is a power of two


def sheet(width, height, share=0.4, seed=1):
    """Normals of flakes, their colours, and which texels are flakes; colours depend on slope and place."""
    rng = np.random.default_rng(seed)
    presence = rng.random((height, width)) < share
    presence[0, 0] = True
    normals = flake_normals(random_normals(width, height), presence)
    colors = rng.random((height, width, 3)).astype(np.float32)
    colors[..., 0] += normals[..., 0] > 0
    colors[: height // 2, :, 1] *= 0.2
    return normals, colors, presence


def read_list(path):
    """Texels (texels, 4) of a table's file in the order of their list."""
    source = oiio.ImageInput.open(str(path))
    pixels = source.read_image(oiio.FLOAT)
    source.close()
    return pixels.reshape(-1, 4)


def split_list(texels, width, height, has_colors):
    """The ratios (or None) and the levels {level: (rows, columns, 4)} of a list, by the layout's own words."""
    start, ratios, levels = 0, None, {}
    if has_colors:
        shape = (flakes.regions(height), flakes.regions(width), flakes.BINS, flakes.BINS, 4)
        start = int(np.prod(shape[:4]))
        ratios = texels[:start].reshape(shape)
    level = 0 if has_colors else 1
    while level < 2 or levels[level - 1].shape[:2] != (1, 1):
        rows, columns = -(-height // 2**level), -(-width // 2**level)
        levels[level] = texels[start : start + rows * columns].reshape(rows, columns, 4)
        start += rows * columns
        level += 1
    assert (texels[start:-1] == 0).all() and start < len(texels)
    return ratios, levels


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("has_colors", [True, False])
def test_every_block_has_the_part_and_the_mean_colour_of_its_flakes(tmp_path, width, height, has_colors):
    normals, colors, presence = sheet(width, height)
    path, _ = flakes.bake_flakes(normals, colors if has_colors else None, tmp_path)
    texels = read_list(path)
    np.testing.assert_array_equal(texels[-1], [flakes.MAGIC, has_colors, 0, 0])
    _, levels = split_list(texels, width, height, has_colors)
    for level, found in levels.items():
        side = 2**level
        for j, i in np.ndindex(found.shape[:2]):
            part = np.s_[j * side : j * side + side, i * side : i * side + side]
            assert found[j, i, 3] == pytest.approx(presence[part].mean(), rel=HALF)
            if presence[part].any():
                mean = colors[part][presence[part]].mean(axis=0) if has_colors else 1
                np.testing.assert_allclose(found[j, i, :3], np.broadcast_to(mean, 3), rtol=2 * HALF, atol=SMALLEST)
            elif level + 1 in levels:
                np.testing.assert_array_equal(found[j, i, :3], levels[level + 1][j // 2, i // 2, :3])
    if has_colors:
        np.testing.assert_array_equal(levels[0][..., 3], presence)


def test_the_mean_over_hit_points_of_every_level_is_the_presence_of_the_map():
    width, height = 300, 260
    normals, _, presence = sheet(width, height)
    for level, found in enumerate(flakes.pyramid(normals, None)):
        side = 2**level
        shown = found[..., 3].astype(float).repeat(side, axis=0)[:height].repeat(side, axis=1)[:, :width]
        # Of many blocks roundings cancel.
        assert shown.mean() == pytest.approx(presence.mean(), rel=HALF)


def places_of(normals, box):
    """Bins (flakes, 2) of slopes as real numbers, NaN where a normal lies below the horizon."""
    upright = np.where(normals[:, 2:] > 0, normals[:, 2:], np.nan)
    return (normals[:, :2] / upright - box[0]) / (box[1] - box[0]) * flakes.BINS


def test_ratios_give_each_slope_of_each_region_its_mean_colour():
    """Where a region has no flake in a bin, the ratio is that of the smallest larger bin that has some."""
    width, height = 300, 260
    normals, colors, presence = sheet(width, height)
    normals[presence, 2] += 1.5
    ratios = flakes.slope_ratios(normals, colors)
    assert ratios.shape == (2, 2, flakes.BINS, flakes.BINS, 3)
    box = slope_counts.slope_box(normals)
    sizes = []
    for v, u in np.ndindex(2, 2):
        part = np.ix_([j for j in range(height) if j * 2 // height == v],
                      [i for i in range(width) if i * 2 // width == u])
        shown = colors[part][presence[part]]
        places = places_of(normals[part][presence[part]], box)
        for bin_v, bin_u in np.ndindex(flakes.BINS // 5, flakes.BINS // 3):
            own = np.array([3 * bin_u, 5 * bin_v])
            side, inside = 1, np.zeros(len(places), bool)
            while not inside.any():
                low = own // side * side
                inside = ((places >= low) & (places < low + side)).all(axis=1)
                sizes.append(side)
                side *= 2
            mean = shown[inside].mean(axis=0) / shown.mean(axis=0)
            np.testing.assert_allclose(ratios[v, u, own[1], own[0]], mean, rtol=1e-4)
    assert sizes.count(1) > sizes.count(2) > sizes.count(4) > 0


def test_populations_in_separate_places_keep_their_colours_at_every_slope():
    presence = np.ones((256, 256), bool)
    rng = np.random.default_rng(4)
    is_left = np.arange(256) < 128
    slopes = rng.normal(0, 1, (256, 256, 2)) * np.where(is_left, 0.1, 0.2)[:, None]
    normals = flake_normals(np.dstack([slopes, presence]).astype(np.float32), presence)
    colors = np.where(is_left[:, None], np.float32([0.9, 0.4, 0.1]), np.float32([0.1, 0.3, 0.9]))
    ratios = flakes.slope_ratios(normals, np.broadcast_to(colors, normals.shape))
    np.testing.assert_allclose(ratios, 1, rtol=1e-5)


def test_black_channels_and_colours_that_no_half_float_holds():
    normals, colors, _ = sheet(20, 10)
    colors[..., 2] = 0
    colors[0, 0] = np.nan, 1, 1
    colors[0, 1], normals[0, 1] = (1e9, -1, 0), (0, 0, 1)
    texels = flakes.flakes_texels(normals, colors)[::-1].reshape(-1, 4).astype(np.float32)
    assert np.isfinite(texels).all()
    ratios, levels = split_list(texels, 20, 10, True)
    assert (ratios[..., 2] == 1).all()
    np.testing.assert_array_equal(levels[0][0, :2, :3], [[0, 0, 0], [flakes.LARGEST, 0, 0]])


@pytest.mark.parametrize("has_colors", [True, False])
@pytest.mark.parametrize("side", [256, 1024, 8192])
def test_the_table_takes_few_bytes_a_texel(side, has_colors):
    width, height = flakes.list_shape(flakes.table_texels(side, side, has_colors))
    assert width * height * 8 <= BYTES_A_TEXEL[has_colors] * side * side


def test_a_map_of_flakes_has_no_other_normals_and_at_least_one_flake():
    normals = random_normals(5, 3)
    presence = np.zeros((3, 5), bool)
    with pytest.raises(MapError, match='Presence image "mask" has no flake'):
        flake_normals(normals, presence, name="mask")
    with pytest.raises(MapError, match="has 4 x 3 pixels, and its normal map 5 x 3"):
        flake_normals(normals, presence[:, :4])
    presence[1, 2] = True
    kept = flake_normals(normals, presence)
    np.testing.assert_array_equal(are_flakes(kept), presence)
    np.testing.assert_array_equal(kept[1, 2], normals[1, 2])
    np.testing.assert_array_equal(flake_normals(normals, np.ones((3, 5), bool)), normals)


def test_colours_of_another_size_are_refused(tmp_path):
    normals, colors, _ = sheet(20, 10)
    with pytest.raises(MapError, match='Image "paint" of the flakes\' colours has 20 x 9 pixels'):
        flakes.bake_flakes(normals, colors[:9], tmp_path, name="paint")


def test_bounds_and_box_of_slopes_are_those_of_the_flakes():
    normals, _, presence = sheet(60, 40)
    normals[presence, 2] = np.abs(normals[presence, 2]) + 0.1
    alone = normals[presence][None]
    for box in (slope_bounds, slope_counts.slope_box):
        np.testing.assert_array_equal(box(normals), box(alone))
    normals[20, 30] = 0, 1, -1
    assert np.isinf(slope_bounds(normals)).all()


def test_counts_count_flakes_alone():
    normals, _, presence = sheet(64, 64)
    normals[presence, 2] = np.abs(normals[presence, 2]) + 0.5
    edges = np.array([0, 32, 64])
    box = slope_bounds(normals)
    box = box[0] - 0.01, box[1] + 0.01
    counted = slope_counts.group_counts(normals, edges, edges, 9, 0, box, lambda samples: None)
    np.testing.assert_array_equal(counted[-1, -1], [presence[v : v + 32, u : u + 32].sum() for v in (0, 32) for u in
                                                    (0, 32)])


def test_the_index_lists_flakes_alone_and_says_how_many_texels_are_none():
    width, height = 100, 37
    normals, _, presence = sheet(width, height)
    records = slope_index.index_texels(normals).reshape(-1, 4)
    seen = np.zeros((height, width), int)
    for block in range(8):
        record = records[block * slope_index.RECORD : (block + 1) * slope_index.RECORD]
        column, row = 32 * (block % 4), 32 * (block // 4)
        part = presence[row : row + 32, column : column + 32]
        assert record[1, 0] == 1 + (~part).sum()
        pairs = record[slope_index.FIRST_ELEMENT :].reshape(-1).astype(int)
        codes = np.stack([pairs % 1024, pairs // 1024], axis=1).reshape(-1)[: part.sum()]
        seen[row + codes // 32, column + codes % 32] += 1
        assert record[1, 2] <= part.sum()
    np.testing.assert_array_equal(seen, presence)


def test_the_table_of_normals_keeps_zeros_where_no_flake_is():
    normals, _, presence = sheet(16, 16)
    pixels = table.table_pixels(normals, "CLOSEST")
    np.testing.assert_array_equal(pixels[..., :3].any(axis=-1), presence)


def test_it_is_written_once_by_content_and_a_cancelled_bake_leaves_nothing(tmp_path):
    normals, colors, _ = sheet(64, 64)

    def cancel(part):
        raise CancelledError("Cancelled.")

    with pytest.raises(CancelledError):
        flakes.bake_flakes(normals, colors, tmp_path, progress=cancel)
    assert not list(tmp_path.iterdir())
    parts = []
    path, written = flakes.bake_flakes(normals, colors, tmp_path, progress=parts.append)
    assert written and parts == sorted(parts) and parts[-1] == 1.0
    assert flakes.bake_flakes(normals, colors, tmp_path) == (path, False)
    others = [(normals, None), (normals, colors * 0.5), (sheet(64, 64, seed=2)[0], colors)]
    assert len({path, *(flakes.bake_flakes(*other, tmp_path)[0] for other in others)}) == 4


def test_the_layout_is_that_of_the_shader():
    text = paths.shader_file("flakes.h").read_text(encoding="utf-8")
    defined = dict(re.findall(r"#define FLAKES_(\w+) ([\d.]+)", text))
    for name in ("MAGIC", "BINS", "REGION", "MOST_REGIONS"):
        assert float(defined[name]) == getattr(flakes, name)
