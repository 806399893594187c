"""The counts table: every element counted once, in its block and below its corners; whole files, or none."""

import hashlib
import re

import numpy as np
import pytest

from glint_addon import paths
from glint_addon.bake import counts, float_image, slope_counts, table
from glint_addon.bake.normal_map import decoded_normals
from glint_addon.bake.openimageio import oiio
from glint_addon.errors import TableError
from tests.helpers.normals import random_normals
from tests.helpers.osl_functions import ROWS, evaluate

INTERPOLATIONS = ("CLOSEST", "LINEAR")
SIZES = [(100, 37), (37, 100), (1, 300), (200, 1), (1, 1), (128, 64), (131, 129)]  # width, height
BYTES_A_TEXEL = 16  # of the 40; the table of normals takes the rest
# The layout of a version. Where it changes, raise VERSION in glint_addon/bake/counts.py and put the new digest here: a
# table of the same version is read as it is.
LAYOUT = (7, "83fd1839e32282fb")
LEAST_REPORTS = 20  # of progress, in a bake of 1024^2 or more


def whole_range(normals, interpolation):
    """Sides of the first and the last level's blocks."""
    height, width = normals.shape[:2]
    every = counts.counts_levels(width, height, interpolation)
    return every[0], every[-1]


def baked(normals, interpolation, levels=None):
    """The texels (texels, 4) of a table in the order of their list, and the slope box."""
    box = counts.slope_box(normals)
    levels = levels or whole_range(normals, interpolation)
    return counts.counts_texels(normals, interpolation, levels, box).reshape(-1, 4), box


def level_tables(normals, interpolation, texels):
    """{block: (groups along v, groups along u, corners, corners, 4)}, found by the layout's own words."""
    height, width = normals.shape[:2]
    tables, start = {}, 0
    for block in counts.counts_levels(width, height, interpolation):
        side = counts.corners(block, interpolation)
        shape = (counts.groups(height, block), counts.groups(width, block), side, side, 4)
        count = shape[0] * shape[1]
        unit = plain_unit(width, height, block) if block <= 64 else 0
        stored = (count + 1) // 2 if unit else count
        level = texels[start : start + stored * side * side].reshape(-1, side, side, 4)
        if unit:
            assert (level == np.round(level)).all() and level.max() < 2**24
            level = unit * np.stack([level % 4096, level // 4096], axis=1).reshape(-1, side, side, 4)[:count]
        tables[block] = level.reshape(shape)
        start += stored * side * side
    assert (texels[start:-1] == 0).all()
    return tables


def plain_unit(width, height, block):
    """Elements that one step of a packed count stands for: the fullest block has 4095 steps."""
    sides = [np.diff(counts.block_edges(size, block)).max() for size in (width, height)]
    return int(sides[0]) * int(sides[1]) / 4095


def read_image(path):
    """RGBA float32 pixels of an image file, row 0 at the bottom."""
    source = oiio.ImageInput.open(str(path))
    pixels = source.read_image(oiio.FLOAT)
    source.close()
    return pixels[::-1]


def plain_samples(normals, interpolation, k):
    """(texel column, row, x, y, z) of every sample, one by one, in float32 as the bake rounds."""
    height, width = normals.shape[:2]
    for j in range(height):
        for i in range(width):
            if interpolation == "CLOSEST":
                yield i, j, *normals[j, i]
                continue
            right, upper = (i + 1) % width, (j + 1) % height
            for a in ((n + 0.5) / k for n in range(k)):
                low = np.float32(a) * (normals[j, right] - normals[j, i]) + normals[j, i]
                high = np.float32(a) * (normals[upper, right] - normals[upper, i]) + normals[upper, i]
                for b in ((n + 0.5) / k for n in range(k)):
                    yield i, j, *(np.float32(b) * (high - low) + low)


def plain_level(normals, interpolation, block, box):
    """One level of the table by a loop over the elements and the definition of a prefix sum."""
    height, width = normals.shape[:2]
    gu, gv = counts.groups(width, block), counts.groups(height, block)
    side = counts.corners(block, interpolation)
    k = {16: 6, 32: 6, 64: 4, 128: 4, 256: 3}.get(block, 2) if interpolation == "LINEAR" else 1
    scale = ((side - 1) / (box[1] - box[0])).astype(np.float32)
    offset = np.float32(1) - box[0] * scale
    histogram = np.zeros((gv, gu, side - 1, side - 1, 4))
    for i, j, x, y, z in plain_samples(normals, interpolation, k):
        if z <= 0:
            continue
        place = np.array([x / z, y / z], np.float32) * scale + offset - np.float32(1)
        u, v = np.floor(place).astype(int)
        if not (0 <= u < side - 1 and 0 <= v < side - 1):
            continue
        g = max(g for g in range(gu) if g * width // gu <= i)
        h = max(h for h in range(gv) if h * height // gv <= j)
        is_right = i >= (2 * g + 1) * width // (2 * gu)
        is_upper = j >= (2 * h + 1) * height // (2 * gv)
        histogram[h, g, v, u, is_right + 2 * is_upper] += 1
    below = np.zeros((gv, gu, side, side, 4))
    below[:, :, 1:, 1:] = histogram.cumsum(axis=2).cumsum(axis=3)
    return (below / k**2).astype(np.float32)


def test_the_corners_and_the_header_are_those_of_the_shader():
    source = paths.shader_file("counts_table.h").read_text(encoding="utf-8")
    assert float(re.search(r"^#define COUNTS_MAGIC (\S+)$", source, re.MULTILINE)[1]) == counts.MAGIC
    body = source[source.index("int level_corners") :].partition("\n}\n")[0]
    linear, closest = re.findall(r"return (block .*?);", body, re.DOTALL)
    for interpolation, expression in (("LINEAR", linear), ("CLOSEST", closest)):
        pairs = [(int(block), int(n)) for block, n in re.findall(r"block <= (\d+) \? (\d+)", expression)]
        pairs.append((counts.LARGEST_LISTED, int(expression.rpartition(":")[2])))
        assert dict(pairs) == counts.CORNERS[interpolation]


def layout_digest() -> str:
    """Short digest of the constants that say what is in a table, and where."""
    layout = (counts.FIRST_BLOCK, counts.CORNERS, counts.LARGEST_LISTED, counts.PACKED, counts.PACKED_STEP,
              counts.SUB_POINTS, counts.SUB_POINTS_ABOVE, slope_counts.OUTERMOST)
    return hashlib.sha256(repr(layout).encode()).hexdigest()[:16]


def test_another_layout_is_another_version():
    assert (counts.VERSION, layout_digest()) == LAYOUT


@pytest.mark.parametrize(("interpolation", "width", "height"), [("CLOSEST", 100, 37), ("LINEAR", 97, 21)])
def test_the_table_is_that_of_a_plain_loop(interpolation, width, height):
    normals = random_normals(width, height)
    texels, box = baked(normals, interpolation)
    for block, found in level_tables(normals, interpolation, texels).items():
        # A packed count is the nearest whole number of its steps.
        rounding = 0.5001 * plain_unit(width, height, block) if block <= 64 else 0.0
        np.testing.assert_allclose(found, plain_level(normals, interpolation, block, box), rtol=0, atol=rounding)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_every_element_in_the_box_is_counted_once_in_each_level(width, height, interpolation):
    # Between the box and these slopes nothing rounds away.
    slopes = np.random.default_rng(2).uniform(-0.5, 0.5, (height, width, 2))
    normals = np.concatenate([slopes, np.ones((height, width, 1))], axis=-1).astype(np.float32)
    box = (np.full(2, -1, np.float32), np.full(2, 1, np.float32))
    levels = whole_range(normals, interpolation)
    texels = counts.counts_texels(normals, interpolation, levels, box).reshape(-1, 4)
    for found in level_tables(normals, interpolation, texels).values():
        rounding = found[:, :, -1, -1].size * 0.5 * plain_unit(width, height, 64)
        assert abs(found[:, :, -1, -1].sum() - width * height) <= rounding
        assert (found[:, :, 0] == 0).all() and (found[:, :, :, 0] == 0).all()
        assert (np.diff(found, axis=2) >= 0).all() and (np.diff(found, axis=3) >= 0).all()


def test_counts_of_texels_are_whole():
    texels, _ = baked(random_normals(70, 50), "CLOSEST")
    assert (texels == np.round(texels)).all() and texels[:-1].max() > 1


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_each_group_and_block_counts_its_own_part_of_the_map(interpolation):
    width, height, block = 3 * 128, 2 * 128, 64
    box = (np.full(2, -1, np.float32), np.full(2, 1, np.float32))
    for u, v in ((0, 0), (5, 0), (0, 3), (4, 2)):  # blocks along u and v
        normals = np.tile(np.array([0, 0, -1], np.float32), (height, width, 1))  # below the horizon: not counted
        # One texel row and column more, so that patches of the block reach no other block's texels.
        rows, columns = np.arange(v * block, (v + 1) * block + 1), np.arange(u * block, (u + 1) * block + 1)
        normals[np.ix_(rows % height, columns % width)] = (0, 0, 1)
        texels = counts.counts_texels(normals, interpolation, whole_range(normals, interpolation), box).reshape(-1, 4)
        ends = level_tables(normals, interpolation, texels)[block][:, :, -1, -1]
        expected = np.zeros((2, 3, 4))
        expected[v // 2, u // 2, u % 2 + 2 * (v % 2)] = block * block
        inside = expected > 0
        assert (abs(ends[inside] - block * block) < 1e-3).all()
        assert (ends[~inside] < 4 * block).all()  # the row and column beyond, no more


def test_texels_lie_in_the_file_row_by_row_and_the_header_at_its_end(tmp_path):
    normals = random_normals(520, 390)
    path, _, low, high = counts.bake_counts(normals, tmp_path, interpolation="CLOSEST", levels=(128, 128))
    source = read_image(path)
    width, rows = counts.file_size(520, 390, "CLOSEST", (128, 128))
    assert source.shape == (rows, width, 4)
    np.testing.assert_array_equal(source[0, -1], [counts.MAGIC, 128, 1, 0])
    assert path.read_bytes().endswith(np.float32(counts.MAGIC).tobytes())
    level = plain_level(normals, "CLOSEST", 128, (low, high))
    gu = counts.groups(520, 128)
    for h, g, j, i in ((0, 0, 5, 119), (1, 1, 50, 40), (0, 1, 119, 119)):
        t = ((h * gu + g) * 120 + j) * 120 + i
        np.testing.assert_array_equal(source[rows - 1 - t // width, t % width], level[h, g, j, i])


def test_a_range_of_levels_holds_the_same_groups_as_the_whole():
    normals = random_normals(300, 200)
    texels, box = baked(normals, "LINEAR")
    whole = level_tables(normals, "LINEAR", texels)
    part = counts.counts_texels(normals, "LINEAR", (64, 128), box).reshape(-1, 4)
    np.testing.assert_array_equal(part[-1], [counts.MAGIC, 64, 2, 0])
    end = len(part) - 1 - np.argmax((part[-2::-1] != 0).any(axis=1))  # after the last texel that is not empty
    expected = texels[sum(counts.level_texels(300, 200, block, "LINEAR") for block in (16, 32)) : -1]
    np.testing.assert_array_equal(part[:end], expected[:end])
    assert (expected[end:] == 0).all() and set(whole) == {16, 32, 64, 128}


@pytest.mark.parametrize("levels", [(16, 64), (64, 96), (128, 64), (64, 512)])
def test_levels_that_the_map_has_not_are_refused_in_words(tmp_path, levels):
    normals = random_normals(300, 200)
    with pytest.raises(TableError, match=r"are no levels of a Closest map of 300 x 200: choose among 32, 64, 128\.$"):
        counts.bake_counts(normals, tmp_path, interpolation="CLOSEST", levels=levels)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("size", "interpolation", "expected"),
    [
        ((1024, 1024), "CLOSEST", (32, 64, 128, 256, 512)),
        ((1024, 1024), "LINEAR", (16, 32, 64, 128, 256, 512)),
        ((1, 1), "CLOSEST", (32,)),
        ((47, 47), "LINEAR", (16,)),
        ((96, 1), "LINEAR", (16, 32, 64)),
        ((4096, 16), "CLOSEST", (32, 64, 128, 256, 512, 1024, 2048)),
    ],
)
def test_levels_end_where_one_group_is_the_whole_map(size, interpolation, expected):
    assert counts.counts_levels(*size, interpolation) == expected


@pytest.mark.parametrize("size", [1, 2, 5, 63, 64, 100, 1000, 8191, 8192])
@pytest.mark.parametrize("block", [32, 64, 4096])
def test_blocks_cover_a_side_without_gap_or_overlap(size, block):
    edges = counts.block_edges(size, block)
    assert edges[0] == 0 and edges[-1] == size and (np.diff(edges) >= 0).all()
    assert np.ptp(np.diff(edges)) <= 1  # of one size, but for the remainder
    if size >= block:
        assert 0.5 * block <= np.diff(edges).min() and np.diff(edges).max() <= 1.5 * block


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("side", [256, 512, 1024, 2048, 4096, 8192, 16384])
def test_the_file_of_all_levels_takes_at_most_sixteen_bytes_a_texel(side, interpolation):
    every = counts.counts_levels(side, side, interpolation)
    width, height = counts.file_size(side, side, interpolation, (every[0], every[-1]))
    assert width & (width - 1) == 0 and height & (height - 1) == 0
    assert width * height * 16 <= BYTES_A_TEXEL * side * side


def test_the_file_is_one_row_and_never_wider_than_openexr_takes(tmp_path):
    for side in (64, 100, 700, 1000, 4096, 16384):
        every = counts.counts_levels(side, side, "LINEAR")
        width, height = counts.file_size(side, side, "LINEAR", (every[0], every[-1]))
        assert 16 <= width <= 2**20 and (height == 1 or width == 2**20)
        places = (np.array([0, width - 1], np.float32) + np.float32(0.5)) * np.float32(1 / width)
        assert (places * np.float32(width) - np.float32(0.5) == [0, width - 1]).all()
    width, height = float_image.list_shape(2**20 + 1)
    pixels = np.zeros((height, width, 4), np.float32)
    pixels[1, -1] = 1, 2, 3, 4
    float_image.write_whole(tmp_path / "wide.exr", pixels)
    np.testing.assert_array_equal(read_image(tmp_path / "wide.exr")[1, -1], [1, 2, 3, 4])


def test_the_box_leaves_out_the_outermost_ten_thousandth_on_each_side():
    normals = random_normals(512, 512)
    normals[..., 2] = 1
    low, high = counts.slope_box(normals)
    assert low.dtype == high.dtype == np.float32
    slopes = normals[..., :2].reshape(-1, 2)
    for axis in range(2):
        # The margin around the quantiles takes some of it in again.
        for outside in ((slopes[:, axis] < low[axis]).mean(), (slopes[:, axis] >= high[axis]).mean()):
            assert 0.00003 < outside <= 0.0001


def test_all_of_an_eight_bit_map_with_few_slopes_is_in_the_box():
    levels = np.array([120, 128, 140]) / 255
    rng = np.random.default_rng(3)
    colors = np.concatenate([rng.choice(levels, (64, 64, 2)), np.ones((64, 64, 1))], axis=-1)
    normals = decoded_normals(colors)
    texels, _ = baked(normals, "CLOSEST")
    assert level_tables(normals, "CLOSEST", texels)[32][..., -1, -1, :].sum() == pytest.approx(64 * 64, abs=0.5)


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_a_flat_map_has_a_box_around_its_one_slope(tilt):
    normals = np.tile(np.array([tilt, -tilt, 1], np.float32), (40, 40, 1))
    low, high = counts.slope_box(normals)
    # Float32 rounds the ends of the narrow box.
    assert (high - low >= 0.99 * slope_counts.LEAST_RANGE).all()
    assert low[0] < tilt < high[0] and low[1] < -tilt < high[1]
    texels, _ = baked(normals, "LINEAR")
    largest = counts.counts_levels(40, 40, "LINEAR")[-1]
    found = level_tables(normals, "LINEAR", texels)[largest]
    assert abs(found.max() - 400) < 1e-3  # a quarter of the map: all of a block


def test_horizontal_normals_are_not_counted_and_do_not_stretch_the_box():
    normals = random_normals(64, 64)
    normals[..., 2] = np.abs(normals[..., 2]) + 0.1
    box = counts.slope_box(normals)
    normals[0, :10] = (1, 0, 0), *9 * [(0.5, 0.5, -0.5)]
    normals[1, 0] = (1, 0, 1e-30)  # a slope of infinity in float32
    texels, widened = baked(normals, "CLOSEST")
    np.testing.assert_allclose(widened, box, rtol=0.1)
    inside = (normals[..., 2] > 0) & ((normals[..., :2] >= widened[0] * normals[..., 2:])
                                      & (normals[..., :2] < widened[1] * normals[..., 2:])).all(axis=-1)
    found = level_tables(normals, "CLOSEST", texels)[32][0, 0, -1, -1].sum()
    assert abs(found - inside.sum()) < 0.5 and inside.sum() <= 64 * 64 - 11


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_a_map_without_a_normal_above_the_horizon_has_empty_counts(interpolation):
    normals = np.tile(np.array([1, 0, 0], np.float32), (64, 64, 1))
    texels, (low, high) = baked(normals, interpolation)
    assert (low < high).all() and (texels[:-1] == 0).all()


def test_the_file_holds_the_pixels_and_the_box_to_the_last_bit(tmp_path):
    normals = random_normals(100, 37)
    path, written, low, high = counts.bake_counts(normals, tmp_path, interpolation="LINEAR", levels=(32, 64))
    assert written and re.fullmatch(r"glint_[0-9a-f]{24}_32_64\.exr", path.name)
    np.testing.assert_array_equal((low, high), counts.slope_box(normals))
    expected = counts.counts_texels(normals, "LINEAR", (32, 64), (low, high))
    np.testing.assert_array_equal(read_image(path), expected)


def test_counts_are_written_once_and_the_box_read_again(tmp_path):
    normals = random_normals(100, 37)
    path, _, low, high = counts.bake_counts(normals, tmp_path, interpolation="LINEAR", levels=(32, 32))
    stamp = path.stat().st_mtime_ns
    again, written, *box = counts.bake_counts(normals, tmp_path, interpolation="LINEAR", levels=(32, 32))
    assert again == path and not written and path.stat().st_mtime_ns == stamp
    np.testing.assert_array_equal(box, (low, high))
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("damage", ["empty", "text", "other image"])
def test_a_file_of_that_name_without_a_box_is_written_again(tmp_path, damage):
    normals = random_normals(100, 37)
    path, _, low, _ = counts.bake_counts(normals, tmp_path, interpolation="LINEAR", levels=(32, 32))
    whole = path.read_bytes()
    if damage == "other image":
        float_image.write_image(str(path), np.ones((4, 4, 4), np.float32))
    else:
        path.write_text("" if damage == "empty" else "no table", encoding="utf-8")
    _, written, again, _ = counts.bake_counts(normals, tmp_path, interpolation="LINEAR", levels=(32, 32))
    assert written and (again == low).all() and len(whole) == path.stat().st_size


def test_the_name_follows_from_the_content_and_the_levels(monkeypatch):
    normals = random_normals(100, 37)
    names = {
        counts.counts_name(normals, "LINEAR", (32, 64)),
        counts.counts_name(normals, "LINEAR", (64, 64)),
        counts.counts_name(normals, "CLOSEST", (64, 64)),
        counts.counts_name(np.nextafter(normals, 2), "LINEAR", (32, 64)),
        counts.counts_name(normals.reshape(100, 37, 3), "LINEAR", (32, 64)),
        table.table_name(normals, "LINEAR"),
    }
    assert counts.counts_name(normals.copy(order="F"), "LINEAR", (32, 64)) in names and len(names) == 6
    monkeypatch.setattr(counts, "VERSION", counts.VERSION + 1)
    assert counts.counts_name(normals, "LINEAR", (32, 64)) not in names


class CancelError(Exception):
    """What a user interface raises to end a bake."""


def bake(kind, normals, folder, interpolation, levels, progress):
    if kind == "table":
        return table.bake_table(normals, folder, interpolation=interpolation, progress=progress)
    return counts.bake_counts(normals, folder, interpolation=interpolation, levels=levels, progress=progress)


@pytest.mark.parametrize("kind", ["table", "counts"])
@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_progress_rises_to_one_in_many_steps_and_may_cancel_at_any(tmp_path, kind, interpolation):
    normals = random_normals(1024, 1024)
    parts = []
    first, last = whole_range(normals, interpolation)
    bake(kind, normals, tmp_path / "whole", interpolation, (first, last), parts.append)
    assert len(parts) >= LEAST_REPORTS and parts[-1] == 1
    assert (np.diff(parts) > 0).all() and np.diff([0, *parts]).max() <= 1 / LEAST_REPORTS

    # Early, and late, when the file is being written; one level, to be quick.
    for end in (0.1, 0.95):
        def cancel(part, end=end):
            if part >= end:
                raise CancelError

        with pytest.raises(CancelError):
            bake(kind, normals, tmp_path / "cut", interpolation, (last, last), cancel)
        assert not (tmp_path / "cut").exists() or not list((tmp_path / "cut").iterdir())


# --- the shader ---

HEADERS = ("table.h", "normal_frame.h", "footprint.h", "light_hint.h", "map.h", "selection.h", "query.h", "counts.h")
FETCH_BODY = """
  Counts counts;
  counts.table = "{file}"; counts.first = 32; counts.levels = {levels};
  Level level = counts_level(counts, 64, {width}, {height}, 0);
  float last;
  color texel = counts_texel(counts, level, 4096 * (int)in[0] + (int)in[1], last);
  out[0] = texel[0]; out[1] = texel[1]; out[2] = texel[2]; out[3] = last;
  out[4] = counts_are_intact(counts, level); out[5] = level.first;
"""


@pytest.mark.parametrize(("width", "height"), [(520, 390), (1600, 1200)])
def test_the_shader_reads_every_row_of_the_file_and_its_header(tmp_path, width, height):
    every = counts.counts_levels(width, height, "CLOSEST")
    columns, rows = counts.file_size(width, height, "CLOSEST", (every[0], every[-1]))
    assert (rows > 1) == (width > 1000)
    # The list's texel t is (t, 1, 2, 3): whole numbers that a float32 holds exactly.
    texels = np.empty((columns * rows, 4), np.float32)
    texels[:] = np.arange(len(texels))[:, None] * np.float32([1, 0, 0, 0]) + np.float32([0, 1, 2, 3])
    texels[-1, :3] = counts.MAGIC, every[0], len(every)
    float_image.write_whole(tmp_path / "counts.exr", texels.reshape(rows, columns, 4)[::-1])
    t = np.random.default_rng(1).integers(0, len(texels) - 1, ROWS)
    body = FETCH_BODY.format(file=(tmp_path / "counts.exr").as_posix(), width=width, height=height, levels=len(every))
    osl = evaluate(HEADERS, body, np.stack([t // 4096, t % 4096], axis=1), 6)
    np.testing.assert_array_equal(osl[:, :4], texels[t])
    assert (osl[:, 4] == 1).all() and (osl[:, 5] == counts.level_texels(width, height, 32, "CLOSEST")).all()


@pytest.mark.parametrize("lost", [0.0, 0.1, 0.5, 0.76, 0.9, 0.999])
def test_the_shader_notices_counts_whose_end_is_lost(tmp_path, lost):
    normals = random_normals(520, 390)
    path, _, _, _ = counts.bake_counts(normals, tmp_path, interpolation="CLOSEST", levels=(32, 64))
    body = FETCH_BODY.format(file=path.as_posix(), width=520, height=390, levels=2)
    assert (evaluate(HEADERS, body, np.zeros((ROWS, 2)), 6)[:, 4] == 1).all()
    data = path.read_bytes()
    # Another name: with Persistent Data Cycles keeps what it has read.
    path = path.with_name("damaged.exr")
    path.write_bytes(data[: int(lost * len(data))].ljust(len(data), b"\0"))
    body = FETCH_BODY.format(file=path.as_posix(), width=520, height=390, levels=2)
    assert (evaluate(HEADERS, body, np.zeros((ROWS, 2)), 6)[:, 4] == 0).all()
