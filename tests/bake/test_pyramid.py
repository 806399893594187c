"""The mip pyramid: means are kept, the layout is what the shader computes, files appear whole or not at all."""

import numpy as np
import pytest

from glint_addon.bake import pyramid
from glint_addon.bake.openimageio import oiio
from glint_addon.errors import MapError, TableError
from tests.helpers.osl_functions import evaluate
from tests.reference import image_texture as reference

SIZES = [(1, 1), (8, 8), (7, 5), (1, 6), (64, 3), (33, 31), (128, 64)]
MEANS = 1e-5  # float32 sums of up to 8192 values, in several steps
QUADRATURE = 2e-3  # sixteen points a texel, against 64 x 64


def random_image(width, height, *, alpha=False, seed=0):
    pixels = np.random.default_rng(seed).random((height, width, 4)).astype(np.float32)
    if not alpha:
        pixels[..., 3] = 1
    return pixels


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_every_level_has_the_mean_of_the_image(width, height):
    image = random_image(width, height, alpha=True)
    pyramid_levels = pyramid.levels(image, encoded=False, associated=True)
    assert [level.shape[1::-1] for level in pyramid_levels] == pyramid.level_sizes(width, height)
    for level in pyramid_levels[1:]:
        assert level.dtype == np.float32
        # Each texel of a level stands for the same area, whatever the sides.
        np.testing.assert_allclose(level.mean(axis=(0, 1)), image.mean(axis=(0, 1)), atol=MEANS)


def test_even_sides_are_halved_to_plain_means_of_four():
    image = random_image(8, 6)
    means = image.reshape(3, 2, 4, 2, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(pyramid.halved(image), means, atol=1e-6)


def test_odd_sides_share_their_middle_texel():
    row = np.arange(3, dtype=np.float32).reshape(1, 3, 1) * np.ones(4, np.float32)
    # Texels of width 1.5: (0 + 1/2) / 1.5 and (1/2 + 2) / 1.5.
    np.testing.assert_allclose(pyramid.halved(row)[0, :, 0], [0.5 / 1.5, 2.5 / 1.5], rtol=1e-6)


@pytest.mark.parametrize("with_alpha", [False, True])
def test_the_means_of_an_encoded_image_are_those_of_the_decoded_interpolated_signal(with_alpha):
    image = random_image(6, 5, alpha=with_alpha)
    if with_alpha:
        image[..., 3] = 0.2 + 0.8 * image[..., 3]
        image[..., :3] *= image[..., 3:]
    means = pyramid.texel_means(image, associated=True)

    fine = (np.arange(64) + 0.5) / 64
    for row, column in [(0, 0), (2, 3), (4, 5)]:
        u, v = np.meshgrid((column + fine) / 6, (row + fine) / 5)
        shown = reference.bilinear(image.astype(float), np.stack([u, v], axis=-1))
        linear = reference.srgb_decoded(shown[..., :3] / shown[..., 3:]) * shown[..., 3:]
        expected = np.append(linear.mean(axis=(0, 1)), shown[..., 3].mean())
        np.testing.assert_allclose(means[row, column], expected, atol=QUADRATURE)
        assert np.abs(expected[:3] - image[row, column, :3]).max() > 10 * QUADRATURE


def test_the_encoding_and_its_inverse_are_the_standards():
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(pyramid.srgb_decoded(values), reference.srgb_decoded(values), atol=1e-6)
    np.testing.assert_allclose(pyramid.srgb_encoded(pyramid.srgb_decoded(values)), values, atol=1e-5)
    np.testing.assert_array_equal(pyramid.srgb_decoded([-0.5, 0.0]), 0)


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_levels_lie_apart_inside_the_atlas_with_wrapped_borders(width, height):
    image = random_image(width, height)
    levels = pyramid.levels(image, encoded=False, associated=False)
    atlas = pyramid.atlas(levels)
    assert atlas.shape[1::-1] == pyramid.atlas_size(width, height)
    taken = np.zeros(atlas.shape[:2], int)
    for level, (x, y) in zip(levels, pyramid.level_corners(width, height), strict=True):
        h, w = level.shape[:2]
        np.testing.assert_array_equal(atlas[y : y + h, x : x + w], level)
        np.testing.assert_array_equal(atlas[y - 1, x : x + w], level[-1])
        np.testing.assert_array_equal(atlas[y + h, x : x + w], level[0])
        np.testing.assert_array_equal(atlas[y : y + h, x - 1], level[:, -1])
        np.testing.assert_array_equal(atlas[y : y + h, x + w], level[:, 0])
        taken[y - 1 : y + h + 1, x - 1 : x + w + 1] += 1
    assert taken.max() == 1 and taken[0, -1] == 0
    assert atlas[0, -1, 3] == pyramid.MAGIC and (atlas[..., 3] == pyramid.MAGIC).sum() == 1


def test_the_magic_number_is_exact_in_half_floats():
    assert float(np.float16(pyramid.MAGIC)) == pyramid.MAGIC


def test_the_shader_computes_the_same_layout():
    sizes = [(w, h) for w in (1, 2, 3, 7, 64, 100, 1023, 4096) for h in (1, 2, 5, 33, 512, 16384)]
    body = """
      Pyramid pyramid = image_pyramid((int)in[0], (int)in[1], 0, 0, 0);
      out[0] = pyramid.level_count;
      out[1] = pyramid.atlas_width;
      out[2] = pyramid.atlas_height;
      for (int level = 0; level < 15; ++level) {
        out[3 + level] = level_side(pyramid.width, level);
        out[18 + level] = level_side(pyramid.height, level);
        out[33 + level] = level_row(pyramid, level);
      }
      out[48] = PYRAMID_MAGIC;
      out[49] = PYRAMID_BORDER;
    """
    osl = evaluate(("image_texture.h",), body, sizes, 50)
    for (width, height), values in zip(sizes, osl, strict=True):
        level_sizes, corners = pyramid.level_sizes(width, height), pyramid.level_corners(width, height)
        count = len(level_sizes)
        assert values[0] == count and tuple(values[1:3]) == pyramid.atlas_size(width, height)
        np.testing.assert_array_equal(np.stack([values[3 : 3 + count], values[18 : 18 + count]], axis=1), level_sizes)
        np.testing.assert_array_equal(values[33 : 33 + count], [y for _, y in corners])
        # The header's columns: level 0 at the border, all others right of level 0 and its border.
        assert [x for x, _ in corners] == [1] + [width + 3] * (count - 1)
    assert tuple(osl[0, 48:]) == (pyramid.MAGIC, pyramid.BORDER)


@pytest.mark.parametrize(("half", "error"), [(True, 2**-11), (False, 0)])
def test_the_file_holds_the_atlas_and_is_written_once(tmp_path, half, error):
    image = random_image(12, 7)
    path, written = pyramid.bake_pyramid(image, tmp_path / "new", encoded=False, associated=False, half=half)
    assert written and [file.name for file in path.parent.iterdir()] == [path.name]
    expected = pyramid.atlas(pyramid.levels(image, encoded=False, associated=False))
    stored = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)[::-1]
    np.testing.assert_allclose(stored, expected, rtol=error)
    assert pyramid.bake_pyramid(image, path.parent, encoded=False, associated=False, half=half) == (path, False)


def test_another_image_or_another_meaning_has_another_name():
    image = random_image(4, 4)
    names = {
        pyramid.pyramid_name(pixels, encoded=encoded, associated=associated, half=half)
        for pixels in (image, image[:, ::-1], image.reshape(2, 8, 4))
        for encoded in (True, False)
        for associated in (True, False)
        for half in (True, False)
    }
    assert len(names) == 3 * 8


def test_values_that_are_not_finite_count_as_zero_as_in_cycles(tmp_path):
    image = random_image(4, 4)
    image[1, 2, 0] = np.nan
    path, _ = pyramid.bake_pyramid(image, tmp_path, encoded=False, associated=False)
    stored = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)[::-1]
    assert np.isfinite(stored).all() and (stored[2, 3] == 0).all()


@pytest.mark.parametrize("shape", [(0, 4, 4), (4, 4, 3), (4, 4), (1, pyramid.LARGEST_SIDE + 1, 4)])
def test_what_is_no_image_is_refused(tmp_path, shape):
    with pytest.raises(MapError, match='Image "stone"'):
        pyramid.bake_pyramid(np.zeros(shape, np.float32), tmp_path, encoded=False, associated=False, name="stone")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(TableError, match="cannot be written"):
        pyramid.bake_pyramid(random_image(2, 2), tmp_path / "file" / "x", encoded=False, associated=False)
