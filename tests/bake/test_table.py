"""The glint table: what Python writes is what OSL reads, exactly; its bounds bound; its file is whole or not there."""

import os
import re
import threading

import bpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glint_addon import paths
from glint_addon.bake import float_image, table
from glint_addon.bake.openimageio import oiio
from glint_addon.errors import TableError
from tests.helpers.osl_functions import ROWS, evaluate
from tests.reference import table as twin

seeds = st.integers(0, 2**32 - 1)
INTERPOLATIONS = ("LINEAR", "CLOSEST")
ROUNDING = 16 * 2.0**-23  # float32: of the few operations behind bounds of normals no longer than two


def random_normals(height, width, seed=1):
    """Normals as decoded from a float map: any length up to 1.7, all float32 digits used."""
    return np.random.default_rng(seed).uniform(-1, 1, (height, width, 3)).astype(np.float32)


def read_table(path):
    """RGBA float32 pixels of an image file, row 0 at the bottom."""
    source = oiio.ImageInput.open(str(path))
    pixels = source.read_image(oiio.FLOAT)
    source.close()
    return pixels[::-1]


def test_the_constants_are_those_of_the_shader():
    source = paths.shader_file("table.h").read_text(encoding="utf-8")
    defined = dict(re.findall(r"#define (\w+) ([\d.]+)", source))
    assert float(defined["TABLE_MAGIC"]) == table.MAGIC


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 127, 128, 129, 8192])
def test_sides_are_padded_to_the_next_power_of_two(size):
    padded = table.padded_size(size)
    assert padded & (padded - 1) == 0 and size <= padded < 2 * size or padded == size == 1


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_the_file_holds_the_pixels_of_the_table_to_the_last_bit(tmp_path, interpolation):
    normals = random_normals(5, 12)
    path, written = table.bake_table(normals, tmp_path / "tables", interpolation=interpolation)
    assert written
    pixels = read_table(path)
    np.testing.assert_array_equal(pixels, table.table_pixels(normals, interpolation))
    assert pixels.shape == (8, 16, 4)
    np.testing.assert_array_equal(pixels[:5, :12, :3], normals)
    assert pixels[0, 0, 3] == table.MAGIC
    assert (pixels[..., 3] != 0).sum() == (5 * 12 if interpolation == "LINEAR" else 1)


FETCH_BODY = """
  int width = {width}; int height = {height};
  float inverse_width = 1.0 / padded_size(width);
  float inverse_height = 1.0 / padded_size(height);
  color texel = table_texel("{path}", inverse_width, inverse_height, (int)in[0], (int)in[1]);
  out[0] = texel[0]; out[1] = texel[1]; out[2] = texel[2];
  out[3] = table_is_intact("{path}", inverse_width, inverse_height);
  out[4] = patch_has_bounds(width, height, (int)in[0], (int)in[1]);
  float radius;
  color centre = patch_bounds("{path}", inverse_width, inverse_height, (int)in[0], (int)in[1], radius);
  out[5] = centre[0]; out[6] = centre[1]; out[7] = centre[2]; out[8] = radius;
"""


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize(("height", "width"), [(31, 33), (33, 31), (1, 700), (1000, 1), (16, 64), (2, 2)])
def test_the_shader_reads_every_texel_of_a_table_exactly(tmp_path, height, width, interpolation):
    normals = random_normals(height, width)
    path, _ = table.bake_table(normals, tmp_path, interpolation=interpolation)
    j, i = (index.ravel() for index in np.indices((height, width)))
    assert len(i) <= ROWS
    body = FETCH_BODY.format(width=width, height=height, path=path.as_posix())
    osl = evaluate(("table.h",), body, np.stack([i, j], 1), 9)
    np.testing.assert_array_equal(osl[:, :3], normals[j, i])
    assert (osl[:, 3] == 1).all()
    pixels = table.table_pixels(normals, interpolation)
    np.testing.assert_array_equal(twin.table_texel(pixels, i, j), normals[j, i])
    bounded = twin.patch_has_bounds(width, height, i, j)
    np.testing.assert_array_equal(osl[:, 4] != 0, bounded)
    if interpolation == "LINEAR":
        i, j = i[bounded], j[bounded]
        centre, radius = twin.patch_bounds(pixels, i, j)
        assert len(i) == max((width - 1) * (height - 1) - 1, 0)
        np.testing.assert_allclose(osl[bounded, 5:8], centre, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(osl[bounded, 8], radius, rtol=0, atol=ROUNDING)
        assert (osl[bounded, 8] >= table.patch_radii(normals)[j, i] - ROUNDING).all()


INTACT_BODY = 'out[0] = table_is_intact("{path}", 1.0 / 32, 1.0 / 32);'


@pytest.mark.parametrize("damage", ["missing", "text", "cut", "shrunk", "other image"])
def test_the_shader_notices_a_table_that_is_not_whole(tmp_path, damage):
    path, _ = table.bake_table(random_normals(32, 32), tmp_path, interpolation="CLOSEST")
    if damage == "missing":
        path.unlink()
    elif damage == "text":
        path.write_text("not a table", encoding="utf-8")
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:300])
    else:
        pixels = table.table_pixels(random_normals(32, 32), "CLOSEST")
        # Blender shrinks by averaging; another image has no magic.
        small = pixels.reshape(16, 2, 16, 2, 4).mean(axis=(1, 3)) if damage == "shrunk" else np.ones_like(pixels)
        float_image.write_image(str(path), small)
    osl = evaluate(("table.h",), INTACT_BODY.format(path=path.as_posix()), np.zeros((ROWS, 1)), 1)
    assert (osl == 0).all()


def test_the_shader_finds_a_whole_table_intact(tmp_path):
    path, _ = table.bake_table(random_normals(32, 32), tmp_path, interpolation="CLOSEST")
    osl = evaluate(("table.h",), INTACT_BODY.format(path=path.as_posix()), np.zeros((ROWS, 1)), 1)
    assert (osl == 1).all()


@settings(max_examples=100, deadline=None, derandomize=True)
@given(seeds, st.integers(1, 7), st.integers(1, 7))
def test_patch_bounds_hold_every_bilinear_normal_of_the_patch(seed, height, width):
    normals = random_normals(height, width, seed)
    j, i = np.indices((height, width))
    bounded = twin.patch_has_bounds(width, height, i, j)
    assert bounded.sum() == max((width - 1) * (height - 1) - 1, 0)
    j, i = j[bounded], i[bounded]
    centre, radius = twin.patch_bounds(table.table_pixels(normals, "LINEAR"), i, j)
    exact = normals.astype(float)
    for a, b in (*np.random.default_rng(seed).random((20, 2)), (0, 0), (1, 0), (0, 1), (1, 1)):
        between = (1 - b) * ((1 - a) * exact[j, i] + a * exact[j, i + 1])
        between += b * ((1 - a) * exact[j + 1, i] + a * exact[j + 1, i + 1])
        assert (np.linalg.norm(between - centre, axis=-1) <= radius + ROUNDING).all()


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seeds, st.integers(1, 7), st.integers(1, 7))
def test_a_texel_tells_the_largest_of_its_patches_and_no_more(seed, height, width):
    normals = random_normals(height, width, seed)
    corners = np.stack([np.roll(normals, (-dv, -du), (0, 1)) for dv in (0, 1) for du in (0, 1)])  # the map repeats
    farthest = np.linalg.norm(corners - corners.mean(0), axis=-1).max(0)
    np.testing.assert_allclose(table.patch_radii(normals), farthest, rtol=0, atol=ROUNDING)
    largest = np.max([np.roll(farthest, (dv, du), (0, 1)) for dv in (0, 1) for du in (0, 1)], axis=0)
    alpha = table.table_pixels(normals, "LINEAR")[:height, :width, 3]
    np.testing.assert_allclose(alpha.ravel()[1:], largest.ravel()[1:], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("height", [1, 33, 70])
def test_rows_made_a_few_at_a_time_are_those_of_the_whole_table(height, interpolation):
    normals = random_normals(height, 5)
    whole = table.table_pixels(normals, interpolation)
    for step in (1, 32):
        rows = [table.table_rows(normals, interpolation, low, min(low + step, len(whole)))
                for low in range(0, len(whole), step)]
        np.testing.assert_array_equal(np.concatenate(rows), whole)


def test_the_name_follows_from_the_content_alone(tmp_path):
    normals = random_normals(4, 6)
    name = table.table_name(normals, "LINEAR")
    assert table.table_name(normals.copy(order="F"), "LINEAR") == name
    others = [
        table.table_name(normals, "CLOSEST"),
        table.table_name(normals.reshape(6, 4, 3), "LINEAR"),
        table.table_name(np.nextafter(normals, 2), "LINEAR"),
    ]
    assert len({name, *others}) == 4
    assert re.fullmatch(r"glint_[0-9a-f]{24}\.exr", name)


def test_a_change_of_layout_changes_every_name(monkeypatch):
    normals = random_normals(4, 6)
    name = table.table_name(normals, "LINEAR")
    monkeypatch.setattr(table, "VERSION", table.VERSION + 1)
    assert table.table_name(normals, "LINEAR") != name


def test_a_table_is_written_once(tmp_path):
    normals = random_normals(4, 6)
    path, written = table.bake_table(normals, tmp_path)
    stamp = path.stat().st_mtime_ns
    assert (path, False) == table.bake_table(normals, tmp_path)
    assert written and path.stat().st_mtime_ns == stamp and len(list(tmp_path.iterdir())) == 1


def test_an_empty_file_of_that_name_is_no_table(tmp_path):
    normals = random_normals(4, 6)
    path = tmp_path / table.table_name(normals, "LINEAR")
    path.touch()
    assert table.bake_table(normals, tmp_path) == (path, True)
    assert path.stat().st_size > 0


def test_a_table_that_cannot_be_finished_leaves_nothing(tmp_path, monkeypatch):
    def fail(path, pixels, **settings):
        path_written.append(path)
        raise OSError(28, "No space left on device")

    path_written = []
    monkeypatch.setattr(float_image, "write_image", fail)
    with pytest.raises(TableError, match=r"No space left on device.*free some disk space\.$"):
        table.bake_table(random_normals(4, 6), tmp_path)
    assert path_written and not list(tmp_path.iterdir())


def test_readers_never_see_half_a_table(tmp_path, monkeypatch):
    seen = []
    write = float_image.write_image

    def watched(path, pixels, **settings):
        seen.extend(file for file in tmp_path.glob("glint_*"))
        write(path, pixels, **settings)
        seen.extend(file for file in tmp_path.glob("glint_*"))

    monkeypatch.setattr(float_image, "write_image", watched)
    table.bake_table(random_normals(4, 6), tmp_path)
    assert not seen and len(list(tmp_path.iterdir())) == 1


def test_two_bakes_at_once_agree(tmp_path):
    normals = random_normals(64, 64)
    results = []
    threads = [threading.Thread(target=lambda: results.append(table.bake_table(normals, tmp_path))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    (path,) = {path for path, _ in results}
    assert len(results) == 4 and list(tmp_path.iterdir()) == [path]
    np.testing.assert_array_equal(read_table(path), table.table_pixels(normals, "LINEAR"))


def test_a_folder_that_cannot_be_made_is_refused_in_words(tmp_path):
    # A file where the folder should be; permissions would not stop an administrator.
    (tmp_path / "tables").touch()
    with pytest.raises(TableError, match=r"cannot be written to .*tables \(.+\): save the \.blend file in a folder"):
        table.bake_table(random_normals(4, 6), tmp_path / "tables")


def test_a_read_only_folder_is_refused_in_words(tmp_path, monkeypatch):
    def refuse(*arguments, **settings):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(table.Path, "touch", refuse)
    with pytest.raises(TableError, match="Permission denied"):
        table.bake_table(random_normals(4, 6), tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="file modes are POSIX")
def test_other_users_may_read_a_table_as_any_file_made_here(tmp_path):
    path, _ = table.bake_table(random_normals(4, 6), tmp_path)
    other = tmp_path / "other"
    other.touch()
    assert path.stat().st_mode == other.stat().st_mode


def test_blender_reads_the_table_as_it_was_written(tmp_path):
    normals = random_normals(4, 8)
    path, _ = table.bake_table(normals, tmp_path)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    np.testing.assert_array_equal(pixels.reshape(4, 8, 4)[..., :3], table.table_pixels(normals, "LINEAR")[..., :3])
