"""osl/tiles.h, and what osl/map.h makes of it, against their numpy twin."""

import numpy as np
import pytest

from glint_addon.bake import table as bake
from tests.helpers.osl_functions import ROWS, Inputs
from tests.osl.queries import declared_map
from tests.reference import tiles

SIZE = (11, 7)  # texels
FARTHEST = 100_000  # tiles from the origin


def random_tiles(rng):
    """Tiles (n, 2), many of them near the origin and around the places where the arrangement begins anew."""
    tile = rng.integers(-FARTHEST, FARTHEST, (ROWS, 2))
    tile[:400] = rng.integers(-4, 5, (400, 2))
    tile[400:600] = tiles.PRIME * rng.integers(-3, 4, (200, 2)) + rng.integers(-1, 2, (200, 2))
    return tile


def test_the_cut_of_a_tile_follows_from_its_number():
    rng = np.random.default_rng(1)
    given = Inputs()
    tile = given.ints("int column, int row", random_tiles(rng)).astype(int)
    t = given.ints("int t", rng.integers(0, tiles.PRIME, ROWS)).astype(int)
    i, size = given.ints("int i, int size", rng.integers([-5000, 1], [5000, 300], (ROWS, 2))).astype(int).T
    body = "int cut_u, cut_v; tile_cut(column, row, 2048, 300, cut_u, cut_v);"
    osl = given.evaluate(("tiles.h",), "", body, ("cut_u", "cut_v", "stirred(t)", "tile_of(i, size)"))
    np.testing.assert_array_equal(osl[:, :2], tiles.tile_cut(tile, (2048, 300)))
    np.testing.assert_array_equal(osl[:, 2], tiles.stirred(t))
    np.testing.assert_array_equal(osl[:, 3], i // size)


def test_stirring_is_a_permutation():
    assert len(np.unique(tiles.stirred(np.arange(tiles.PRIME)))) == tiles.PRIME


def test_cuts_have_no_pattern():
    """The positions of the cuts of 64 x 64 tiles, as phases: no wave in them is stronger than chance makes one."""
    number = np.stack(np.meshgrid(np.arange(-32, 32), np.arange(-32, 32)), axis=-1)
    cuts = tiles.tile_cut(number, (2048, 2048))
    assert len(np.unique(cuts.reshape(-1, 2), axis=0)) == 64**2
    one, other = np.moveaxis(np.exp(2j * np.pi * cuts / 2048), -1, 0)
    for phases in (one, other, one * other, one * np.conj(other)):
        waves = np.abs(np.fft.fft2(phases)) / 64
        # The largest of 4096 exponentially distributed squares exceeds this once in a thousand times.
        assert waves.max() ** 2 < np.log(4096 * 1000)


def test_an_arrangement_written_out_has_a_cut_in_each_tile():
    texels = np.arange(SIZE[0] * SIZE[1]).reshape(SIZE[1], SIZE[0], 1)
    large = tiles.shuffled(texels, (4, 3))
    assert large.shape == (21, 44, 1)
    for column, row in ((0, 0), (3, 1), (2, 2)):
        cut_u, cut_v = tiles.tile_cut((column, row), SIZE)
        assert large[row * SIZE[1], column * SIZE[0], 0] == texels[cut_v % SIZE[1], cut_u % SIZE[0], 0]


@pytest.mark.parametrize("variation", [0, 1])
def test_texels_around_the_hit_point_are_those_of_their_own_tiles(tmp_path, variation):
    rng = np.random.default_rng(2)
    normals = rng.uniform(-1, 1, (SIZE[1], SIZE[0], 3)).astype(np.float32)
    file = bake.bake_table(normals, tmp_path, interpolation="CLOSEST")[0]
    given = Inputs()
    tile = given.ints("int tile_u, int tile_v", rng.integers(-40, 40, (ROWS, 2))).astype(int)
    # In the middle of texels, where no rounding decides.
    texel = given.ints("int i, int j", rng.integers(0, SIZE, (ROWS, 2))).astype(int)
    away = given.ints("int right, int up", rng.integers(-30, 31, (ROWS, 2))).astype(int)
    body = f"""
      map.variation = {variation};
      Hit hit = map_hit(map, point(tile_u + (i + 0.5) / map.width, tile_v + (j + 0.5) / map.height, 0));
      int own_i, own_j, other_i, other_j, shift_u, shift_v;
      map_texel(map, (int)hit.i, (int)hit.j, own_i, own_j);
      map_texel(map, (int)hit.i + right, (int)hit.j + up, other_i, other_j);
      tile_shift(map, (int)hit.i + right, (int)hit.j + up, shift_u, shift_v);
    """
    osl = given.evaluate(("map.h",), declared_map(file, normals, is_linear=False), body, (
        "hit.column", "hit.row", "own_i", "own_j", "other_i", "other_j", "shift_u", "shift_v", "map.cut_u", "map.cut_v",
        "map.tile_u", "map.tile_v", "hit.u", "hit.v"))
    cut = tiles.tile_cut(tile, SIZE) * variation
    np.testing.assert_array_equal(osl[:, :2], (texel + cut) % SIZE)
    np.testing.assert_array_equal(osl[:, 2:4], osl[:, :2])
    other = tile * SIZE + texel + away
    other_cut = tiles.tile_cut(other // SIZE, SIZE) * variation
    np.testing.assert_array_equal(osl[:, 4:6], (other + other_cut) % SIZE)
    np.testing.assert_array_equal(osl[:, 6:8], cut - other_cut)
    np.testing.assert_array_equal(osl[:, 8:10], cut)
    np.testing.assert_array_equal(osl[:, 10:12], tile)
    np.testing.assert_allclose(osl[:, 12:], cut + texel + 0.5, atol=1e-4)
