"""Points of a lattice: cells of the wanted width and spread, nearest points that are the nearest, bit-exact wrap."""

import numpy as np
import pytest

from glint_addon.generate.lattice import Lattice, nearest, offsets, random_lattice, rows_of, topmost


def lattice_of(columns=16, spread=0.25, seed=3) -> Lattice:
    return random_lattice(columns, spread, np.random.default_rng(seed))


def points(lattice):
    """Places of all points (n, 2) in widths."""
    rows, columns = lattice.shape
    row, column = np.divmod(np.arange(lattice.count), columns)
    u = column + 0.5 * (row % 2) + lattice.x.ravel()
    return np.stack([u, (row + lattice.y.ravel()) * lattice.height], axis=-1)


def powers(lattice, resolution):
    """Squared distance minus weight of every point to every texel's centre, (r, r, n), the shortest way around."""
    rows, columns = lattice.shape
    centre = (np.arange(resolution) + 0.5) / resolution * columns
    u = centre[None, :, None] - points(lattice)[:, 0]
    v = centre[:, None, None] - points(lattice)[:, 1]
    u, v = (values - columns * np.round(values / columns) for values in (u, v))
    return u**2 + v**2 - lattice.weight.ravel()


@pytest.mark.parametrize("spread", [0.0, 0.1, 0.3])
def test_the_nearest_point_is_found_among_all(spread):
    lattice = lattice_of(8, spread)
    power = powers(lattice, 64)
    found = np.take_along_axis(power, nearest(lattice, 64)[..., None], axis=-1)[..., 0]
    # Only places around are searched: farther points are nearer at few texels, and by little.
    assert (found > power.min(axis=-1) + 1e-5).mean() < 0.002


def test_moving_all_points_by_a_column_moves_the_map_bit_for_bit():
    lattice = lattice_of(16)
    moved = Lattice(*(np.roll(values, 1, axis=1) for values in (lattice.x, lattice.y, lattice.weight)))
    number, after = nearest(lattice, 128), nearest(moved, 128)
    row, column = np.divmod(number, 16)
    assert (np.roll(row * 16 + (column + 1) % 16, 8, axis=1) == after).all()


@pytest.mark.parametrize("spread", [0.0, 0.1, 0.2, 0.3, 0.4])
def test_widths_of_cells_spread_as_wanted(spread):
    lattice = lattice_of(48, spread)
    texels = np.bincount(nearest(lattice, 1024).ravel(), minlength=lattice.count)
    widths = np.sqrt(texels[texels > 0])
    assert widths.std() / widths.mean() == pytest.approx(spread, abs=0.03)  # texels at edges and 2,600 cells
    assert (texels == 0).mean() < 0.12


def test_cells_are_nearly_regular_hexagons():
    for columns in (2, 3, 10, 101):
        assert rows_of(columns) % 2 == 0
        assert columns < 6 or 0.75 < columns / rows_of(columns) < 1.0  # sqrt(3) / 2, as near as whole numbers come


def test_offsets_lead_from_the_point_to_the_texel():
    lattice = lattice_of(8, 0.3)
    number = nearest(lattice, 64)
    away = offsets(lattice, number)
    power = np.take_along_axis(powers(lattice, 64), number[..., None], axis=-1)[..., 0]
    np.testing.assert_allclose((away**2).sum(axis=-1) - lattice.weight.ravel()[number], power, atol=1e-5)
    assert away[..., 0].min() < -0.4 and away[..., 0].max() > 0.4


def test_the_topmost_disc_is_of_the_lowest_row_and_rightmost_in_it():
    lattice = lattice_of(8, 0.1)
    found = topmost(lattice, 64, 0.7)
    distance = np.sqrt(powers(lattice, 64) + lattice.weight.ravel())
    assert ((found == -1) == (distance >= 0.7).all(axis=-1)).all() and (found == -1).any()
    rows, columns = lattice.shape
    for row, column in ((5, 9), (31, 40), (63, 0)):
        covering = np.flatnonzero(distance[row, column] < 0.7)
        at = (row + 0.5) / 64 * rows
        # Rows count from the texel, the shortest way around.
        down = [((number // columns - at + rows / 2) % rows) for number in covering]
        lowest = covering[np.array(down) < min(down) + 0.5]
        right = [(points(lattice)[number, 0] - (column + 0.5) / 64 * columns + columns / 2) % columns
                 for number in lowest]
        assert found[row, column] == lowest[int(np.argmax(right))]
