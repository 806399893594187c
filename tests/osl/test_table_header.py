"""osl/table.h against its numpy twin; tests/bake/test_table.py reads whole tables with it."""

import numpy as np

from glint_addon.bake import float_image
from glint_addon.bake import table as bake
from tests.helpers.osl_functions import EPSILON, ROUNDING, ROWS, Inputs, each, evaluate
from tests.reference import table


def test_padded_size_is_that_of_the_bake_for_every_size_to_8192():
    sizes = np.arange(1, 8193).reshape(ROWS, 8)
    osl = evaluate(("table.h",), "for (int k = 0; k < 8; ++k) out[k] = padded_size(in[k]);", sizes, 8)
    expected = np.array([[bake.padded_size(int(size)) for size in row] for row in sizes])
    np.testing.assert_array_equal(osl, expected)
    np.testing.assert_array_equal(table.padded_size(sizes), expected)


def test_wrapped_is_the_modulo_of_negative_integers_too():
    rng = np.random.default_rng(1)
    i = np.concatenate([rng.integers(-(2**22), 2**22, ROWS - 12), np.arange(-6, 6)])
    size = np.concatenate([rng.integers(1, 5000, ROWS - 12), np.full(12, 3)])
    given = Inputs()
    given.ints("int i, int size", np.stack([i, size], axis=1))
    osl = given.evaluate(("table.h",), "", "", ("wrapped(i, size)",))
    np.testing.assert_array_equal(osl[:, 0], table.wrapped(i, size))


def test_strength_scales_slopes_as_in_the_normal_map_node():
    rng = np.random.default_rng(2)
    given = Inputs()
    n = given.vectors("vector n", rng.uniform(-1, 1, (ROWS, 3)))
    strength = given.floats("float strength", rng.uniform(-1, 3, ROWS))
    bounds = np.sort(rng.normal(size=(ROWS, 2, 2)), axis=1)
    bounds = given.vectors("vector low, vector high", np.append(bounds, np.zeros((ROWS, 2, 1)), axis=2))[..., :2]
    osl = given.evaluate(
        ("table.h",), "", "vector scaled = strengthened(n, strength); strengthened_bounds(strength, low, high);",
        (*each("scaled"), "low[0]", "low[1]", "high[0]", "high[1]"),
    )
    np.testing.assert_allclose(osl[:, :3], table.strengthened(n, strength), rtol=0, atol=4 * EPSILON * 3)
    expected = [table.strengthened_bounds(*box, s) for box, s in zip(bounds, strength, strict=True)]
    np.testing.assert_allclose(osl[:, 3:].reshape(ROWS, 2, 2), expected, rtol=EPSILON, atol=0)


def test_lists_are_laid_out_as_the_bake_lays_them_out():
    rng = np.random.default_rng(3)
    texels = np.concatenate([2 ** rng.uniform(0, 23, ROWS - 66), np.repeat(2 ** np.arange(22), 3)]).astype(int)
    texels[-66:] += np.tile([-1, 0, 1], 22)
    texels = np.maximum(texels, 1)
    given = Inputs()
    given.ints("int texels", texels)
    osl = given.evaluate(("table.h",), "int logarithm; float across, up;", "list_shape(texels, logarithm, across, up);",
                         ("logarithm", "across", "up"))
    width, height = np.array([float_image.list_shape(int(count)) for count in texels]).T
    np.testing.assert_array_equal(osl, np.stack([np.log2(width), 1 / width, 1 / height], axis=1))
    assert height.max() > 1


def test_places_between_texels_are_interpolated(tmp_path):
    rng = np.random.default_rng(4)
    width, height = 13, 6
    normals = rng.normal(size=(height, width, 3)).astype(np.float32)
    file, _ = bake.bake_table(normals, tmp_path)
    given = Inputs()
    x, y = given.floats("float x, float y", rng.uniform(0.5, (width - 0.5, height - 0.5), (ROWS, 2))).T
    sides = f"1.0 / padded_size({width}), 1.0 / padded_size({height})"
    body = f'vector between = table_between("{file.as_posix()}", {sides}, x, y);'
    osl = given.evaluate(("table.h",), "", body, each("between"))
    np.testing.assert_allclose(osl, table.table_between(normals, x, y), rtol=0, atol=ROUNDING)
