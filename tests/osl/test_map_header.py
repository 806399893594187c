"""osl/map.h against its numpy twin."""

import numpy as np
import pytest

from glint_addon.bake import table as bake
from tests.helpers.osl_functions import EPSILON, MARGIN, ROUNDING, ROWS, Inputs, each
from tests.osl.queries import declared_map
from tests.reference import map as normal_map
from tests.reference import table

HEADERS = ("map.h",)
PATCH = ("patch.n00", "patch.n10", "patch.n01", "patch.n11")
SIZE = (11, 7)  # texels, neither a power of two: the padded table has other things beyond the edge


def test_normals_turns_and_parts_of_a_bilinear_patch():
    rng = np.random.default_rng(8)
    given = Inputs()
    centre = rng.normal(size=(ROWS, 1, 3))
    patch = centre + 0.15 * rng.normal(size=(ROWS, 4, 3)) * np.linalg.norm(centre, axis=-1, keepdims=True)
    patch = given.vectors(", ".join(PATCH), patch)
    a, b = given.floats("float a, float b", rng.uniform(0, 1, (ROWS, 2))).T
    alpha = given.floats("float alpha", rng.uniform(0.01, 0.3, ROWS))
    body = "vector n = patch_normal(patch, a, b);"
    osl = given.evaluate(HEADERS, "Patch patch;", body, (
        *each("n"), "square_turn(patch.n00, patch.n11)", "patch_columns(patch, alpha)", "patch_rows(patch, alpha)",
        "patch_parts(patch.n00, patch.n11, patch.n10, patch.n01, alpha)",
    ))
    size = np.linalg.norm(patch, axis=-1).max(1)
    assert (np.abs(osl[:, :3] - normal_map.patch_normal(patch, a, b)).max(1) < 8 * EPSILON * size).all()
    turn = normal_map.square_turn(patch[:, 0], patch[:, 3])
    # The difference of the normals cancels as far as these are alike.
    assert (np.abs(osl[:, 3] - turn) < ROUNDING * (turn + np.sqrt(turn))).all()
    diagonal = normal_map.patch_parts(*(patch[:, k] for k in (0, 3, 1, 2)), alpha)
    for column, (parts, exact) in zip(osl[:, 4:].T, (
        normal_map.patch_columns(patch, alpha), normal_map.patch_rows(patch, alpha), diagonal
    ), strict=True):
        clear = np.abs(exact - np.round(exact)) > MARGIN
        np.testing.assert_array_equal(column[clear], parts[clear])
        assert clear.mean() > 0.98 and len(np.unique(parts)) > 5


def baked(rng, folder, is_linear):
    """Random normals (height, width, 3) float32 and their table."""
    normals = rng.uniform(-1, 1, (SIZE[1], SIZE[0], 3)).astype(np.float32)
    return normals, bake.bake_table(normals, folder, interpolation="LINEAR" if is_linear else "CLOSEST")[0]


def test_texels_and_patches_of_the_map_repeat_have_strength_and_are_fetched_once(tmp_path):
    rng = np.random.default_rng(9)
    normals, file = baked(rng, tmp_path, True)
    given = Inputs()
    strength = given.floats("map.strength", np.where(rng.random(ROWS) < 0.3, 1.0, rng.uniform(-1, 3, ROWS)))
    i, j = given.ints("int i, int j", rng.integers(0, SIZE, (ROWS, 2))).astype(int).T
    body = """
      int intact = map_is_intact(map);
      vector unscaled = unscaled_normal(map, i, j);
      vector n = map_normal(map, i, j);
      int before = map.costs.fetches;
      Patch patch = map_patch(map, i, j);
      int first = map.costs.fetches;
      Patch next = map_patch(map, i + 1 < map.width ? i + 1 : 0, j);
      int second = map.costs.fetches;
      Patch above = map_patch(map, i, j + 1 < map.height ? j + 1 : 0);
      int third = map.costs.fetches;
    """
    osl = given.evaluate(HEADERS, declared_map(file, normals, is_linear=True), body, (
        "intact", "before", "first", "second", "third", *each("unscaled", "n", *PATCH),
        *each(*(name.replace("patch", "next") for name in PATCH)),
        *each(*(name.replace("patch", "above") for name in PATCH)),
    ))
    assert (osl[:, 0] == 1).all()
    # The right corners of a patch are kept for the next one in its row, and for no other.
    np.testing.assert_array_equal(osl[:, 1:5], np.tile([3, 7, 9, 13], (ROWS, 1)))
    np.testing.assert_array_equal(osl[:, 5:8], table.table_texel(normals, i, j))
    tolerance = 4 * EPSILON * 3
    np.testing.assert_allclose(osl[:, 8:11], normal_map.map_normal(normals, strength, i, j), rtol=0, atol=tolerance)
    for start, (du, dv) in ((11, (0, 0)), (23, (1, 0)), (35, (0, 1))):
        patch = normal_map.map_patch(normals, strength, i + du, j + dv).reshape(ROWS, 12)
        np.testing.assert_allclose(osl[:, start : start + 12], patch, rtol=0, atol=tolerance)


@pytest.mark.parametrize("is_linear", [False, True])
def test_the_map_at_uv_coordinates_repeats_and_is_interpolated_over_its_edges(tmp_path, is_linear):
    rng = np.random.default_rng(10)
    normals, file = baked(rng, tmp_path, is_linear)
    given = Inputs()
    strength = given.floats("map.strength", rng.uniform(-1, 3, ROWS))
    uv = given.floats("float across, float up", rng.uniform(-2, 2, (ROWS, 2)))
    osl = given.evaluate(HEADERS, declared_map(file, normals, is_linear=is_linear),
                         "Hit hit = map_hit(map, point(across, up, 0));",
                         ("hit.u", "hit.v", "hit.i", "hit.j", *each("hit.unscaled", "hit.n"), "map.costs.fetches"))
    hit = normal_map.map_hit(normals, strength, is_linear, uv)
    place = np.stack([hit.u, hit.v], axis=1)
    clear = (np.abs(place - np.round(place)) > MARGIN).all(axis=1)
    assert clear.mean() > 0.98
    rounding = 4 * EPSILON * max(SIZE)
    np.testing.assert_allclose(osl[clear, :2], place[clear], rtol=0, atol=rounding)
    np.testing.assert_array_equal(osl[clear, 2:4], np.stack([hit.i, hit.j], axis=1)[clear])
    # The interpolated normals change by up to 2 from texel to texel.
    tolerance = 2 * rounding + ROUNDING if is_linear else 0
    np.testing.assert_allclose(osl[clear, 4:7], hit.unscaled[clear], rtol=0, atol=tolerance)
    np.testing.assert_allclose(osl[clear, 7:10], hit.n[clear], rtol=0, atol=3 * tolerance + 4 * EPSILON * 3)
    inside = (hit.i >= 0) & (hit.j >= 0) & (hit.i + 1 < SIZE[0]) & (hit.j + 1 < SIZE[1])
    np.testing.assert_array_equal(osl[clear, 10], np.where(inside | (not is_linear), 1, 4)[clear])
    assert 0.2 < inside.mean() < 0.95


@pytest.mark.parametrize("has_flakes", [False, True])
def test_texels_that_are_no_flakes_have_no_normal_at_any_strength(tmp_path, has_flakes):
    rng = np.random.default_rng(11)
    normals, _ = baked(rng, tmp_path, False)
    normals[rng.random(normals.shape[:2]) < 0.4] = 0
    file, _ = bake.bake_table(normals, tmp_path, interpolation="CLOSEST")
    given = Inputs()
    strength = given.floats("map.strength", np.where(rng.random(ROWS) < 0.3, 1.0, rng.uniform(-1, 3, ROWS)))
    i, j = given.ints("int i, int j", rng.integers(0, SIZE, (ROWS, 2))).astype(int).T
    uv = given.floats("float across, float up", rng.uniform(-2, 2, (ROWS, 2)))
    osl = given.evaluate(HEADERS, declared_map(file, normals, is_linear=False, has_flakes=has_flakes),
                         "vector n = map_normal(map, i, j); Hit hit = map_hit(map, point(across, up, 0));",
                         (*each("n", "hit.n"), "is_flake(map, unscaled_normal(map, i, j))", "hit.is_flake"))
    place = uv * SIZE
    clear = (np.abs(place - np.round(place)) > MARGIN).all(axis=1)
    hit = normal_map.map_hit(normals, strength, False, uv, has_flakes)
    rounding = 4 * EPSILON * 3
    expected = normal_map.map_normal(normals, strength, i, j, has_flakes)
    np.testing.assert_allclose(osl[:, :3], expected, rtol=0, atol=rounding)
    np.testing.assert_allclose(osl[clear, 3:6], hit.n[clear], rtol=0, atol=rounding)
    known = normal_map.is_flake(normals[j, i], has_flakes)
    assert 0.3 < known.mean() < 0.7 or not has_flakes
    np.testing.assert_array_equal(osl[:, 6] != 0, known)
    np.testing.assert_array_equal(osl[clear, 7] != 0, hit.is_flake[clear])
    assert (expected[~known] == 0).all()
