"""osl/image_texture.h against its numpy twin; tests/bake/test_pyramid.py compares the layout of the atlas."""

import numpy as np
import pytest

from glint_addon.bake import pyramid
from tests.helpers.osl_functions import FAST_MATH, ROWS, Inputs, each, evaluate
from tests.reference import image_texture

HEADERS = ("image_texture.h",)
SIZE = (21, 13)  # texels
SETTINGS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 0, 1), (0, 0, 1)]  # encoded, unassociate, clamp_v
# The atlas's sides are no powers of two, so places in it are rounded: by 1e-6 of 50 texels.
PLACES = 1e-4


def baked(rng, folder, encoded):
    """A random image with alpha, half of it transparent; the levels of its pyramid, and their file."""
    image = rng.random((SIZE[1], SIZE[0], 4)).astype(np.float32)
    image[:, : SIZE[0] // 3, 3] = 0
    image[..., :3] *= image[..., 3:]
    file, _ = pyramid.bake_pyramid(image, folder, encoded=bool(encoded), associated=True)
    return pyramid.levels(image, encoded=bool(encoded), associated=True), file


def test_the_transfer_curve():
    given = Inputs()
    values = given.floats("float value", np.linspace(-0.2, 1.5, ROWS))
    osl = given.evaluate(HEADERS, "", "", ("srgb_decoded(value)",))
    np.testing.assert_allclose(osl[:, 0], image_texture.srgb_decoded(np.maximum(values, 0)), rtol=FAST_MATH, atol=1e-7)


def test_an_atlas_is_whole_where_it_exists_and_has_its_own_size(tmp_path):
    _, file = baked(np.random.default_rng(1), tmp_path, 0)
    lines = []
    for k, (name, width, height) in enumerate([(file, *SIZE), (tmp_path / "none.exr", *SIZE), (file, 10, 7)]):
        lines.append(f"Pyramid p{k} = image_pyramid({width}, {height}, 0, 0, 0);")
        lines.append(f'out[{k}] = pyramid_is_whole("{name.as_posix()}", p{k});')
    osl = evaluate(HEADERS, "\n".join(lines), np.zeros((ROWS, 1)), 3)
    np.testing.assert_array_equal(osl, np.tile([1, 0, 0], (ROWS, 1)))


@pytest.mark.parametrize(("encoded", "unassociate", "clamp_v"), SETTINGS)
def test_levels_and_elliptic_means_of_an_image(tmp_path, encoded, unassociate, clamp_v):
    rng = np.random.default_rng(2)
    levels, file = baked(rng, tmp_path, encoded)
    given = Inputs()
    uv = given.floats("float across, float up", rng.uniform(-1, 2, (ROWS, 2)))
    level = given.ints("int level", rng.integers(0, len(levels), ROWS)).astype(int)
    long_uv = given.floats("float long_u, float long_v", 0.2 * rng.normal(size=(ROWS, 2)))
    stds = 10.0 ** rng.uniform((-0.3, -1), (1.2, 0), (ROWS, 2))
    stds[:, 1] *= stds[:, 0]
    long_std, short_std = given.floats("float long_std, float short_std", stds).T
    body = f"""
      string file = "{file.as_posix()}";
      Pyramid pyramid = image_pyramid({SIZE[0]}, {SIZE[1]}, {encoded}, {unassociate}, {clamp_v});
      float one, mean;
      color at = level_color(file, pyramid, level, level_row(pyramid, level), across, up, one);
      Gaussian over = {{ across, up, long_u, long_v, long_std, short_std }};
      color filtered = filtered_color(file, pyramid, over, mean);
    """
    osl = given.evaluate(HEADERS, "", body, (*each("at"), "one", *each("filtered"), "mean"))
    settings = {"encoded": encoded, "unassociate": bool(unassociate), "clamp_v": clamp_v}
    every = np.stack([image_texture.level_color(levels, k, uv, **settings) for k in range(len(levels))])
    np.testing.assert_allclose(osl[:, :4], every[level, np.arange(ROWS)], rtol=0, atol=PLACES)
    expected, exact = image_texture.filtered_color(levels, uv, long_uv, long_std, short_std, **settings)
    clear = np.abs(exact - np.round(exact)) > 1e-3
    assert clear.mean() > 0.97 and len(np.unique(np.ceil(exact))) > 5
    np.testing.assert_allclose(osl[clear, 4:], expected[clear], rtol=0, atol=PLACES)
