"""osl/checker.h against its numpy twin; tests/nodes/test_checker.py compares shares with brute force."""

import re

import numpy as np

from glint_addon.paths import shader_file
from tests.helpers.osl_functions import FAST_MATH, MARGIN, ROUNDING, ROWS, Inputs, each, unit
from tests.reference import checker

HEADERS = ("checker.h",)
COUNT = 300  # footprints whose series of thousands of terms numpy sums
SERIES = 5e-5  # float32 sums of thousands of waves whose phases are up to 63 coordinates


def test_the_colour_of_points_and_their_distance_from_an_edge():
    rng = np.random.default_rng(1)
    given = Inputs()
    points = given.vectors("point x", rng.uniform(-20, 20, (ROWS, 3)))
    osl = given.evaluate(HEADERS, "", "", ("checker_is_first(x)", *(f"edge_distance(x[{k}])" for k in range(3))))
    distance = checker.edge_distance(points[..., None])
    np.testing.assert_allclose(osl[:, 1:], distance, rtol=0, atol=20 * ROUNDING)
    clear = (distance > MARGIN).all(axis=1)
    np.testing.assert_array_equal(osl[clear, 0] != 0, checker.checker_is_first(points)[clear])
    assert clear.mean() > 0.98


def test_small_footprints_are_averaged_over_slices_of_the_normal_distribution():
    rng = np.random.default_rng(2)
    given = Inputs()
    points = given.vectors("point x", rng.uniform(-5, 5, (ROWS, 3)))
    axes = rng.uniform(0, 0.5, (ROWS, 1, 1)) * rng.normal(size=(ROWS, 2, 3))
    axes = given.vectors("vector first, vector second", axes)
    number = given.ints("int i", rng.integers(0, 64, ROWS)).astype(int)
    slices = checker.normal_slices()
    table = ", ".join(f"{value:.7g}" for value in slices[32:])
    osl = given.evaluate(HEADERS, f"float upper[32] = {{ {table} }};", "",
                         ("normal_slice(upper, i)", "checker_points_share(x, first, second)"))
    np.testing.assert_allclose(osl[:, 0], slices[number], rtol=1e-6, atol=1e-7)
    every = checker.checker_points(points, *axes.transpose(1, 0, 2))
    # The header's slices have four digits.
    clear = (checker.edge_distance(every) > 3e-4).all(axis=1)
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(osl[clear, 1], checker.checker_is_first(every).mean(axis=1)[clear])
    assert len(np.unique(osl[:, 1])) > 20


def test_the_slices_of_the_header_are_those_of_the_normal_distribution():
    source = shader_file("checker.h").read_text(encoding="utf-8")
    (text,) = re.findall(r"float upper\[32\] = \{([^}]*)\};", source)
    np.testing.assert_allclose([float(value) for value in text.split(",")], checker.normal_slices()[32:], atol=1e-4)


def test_odd_numbers_and_sums_of_damped_waves():
    rng = np.random.default_rng(3)
    given = Inputs()
    least = given.floats("float least", np.where(np.arange(ROWS) % 4, rng.uniform(-70, 70, ROWS), np.arange(ROWS) % 99))
    phase, x = given.floats("float phase, float at", rng.uniform(-9, 9, (ROWS, 2))).T
    middle = given.floats("float p, float q", 2 * rng.normal(size=(ROWS, 2)))
    step = given.floats("float a, float b", unit(rng.normal(size=(ROWS, 2))) * 10.0 ** rng.uniform(-1.1, 1, (ROWS, 1)))
    use_sine = given.ints("int use_sine", rng.integers(0, 2, ROWS)) != 0
    osl = given.evaluate(HEADERS, "", "", ("odd_from(least)", "damped_wave(phase, p, q, at, a, b, use_sine)"))
    np.testing.assert_array_equal(osl[:, 0], checker.odd_from(least))
    expected, margin = checker.damped_wave(phase, middle, x, step, use_sine)
    clear = margin > MARGIN
    assert clear.mean() > 0.98 and (expected == 0).mean() < 0.6 and np.abs(expected).max() > 0.5
    # Phases of up to 63 x are sums in float32.
    np.testing.assert_allclose(osl[clear, 1], expected[clear], rtol=0, atol=2 * FAST_MATH)


def test_the_mean_of_three_square_waves_is_that_of_their_series():
    rng = np.random.default_rng(4)
    given = Inputs()
    points = given.vectors("point x", rng.uniform(-5, 5, (ROWS, 3)))
    axes = rng.normal(size=(ROWS, 2, 3)) * rng.uniform(0.3, 2.0, (ROWS, 1, 1))
    axes[:60, :, 2] *= 0.01  # varies too little to blur more than one edge
    axes[20:40, :, 1] *= 0.01
    axes = given.vectors("vector first, vector second", axes)
    osl = given.evaluate(HEADERS, "", "", ("checker_wave_mean(x, first, second)",))[:, 0]
    rows = zip(points[:COUNT], axes[:COUNT, 0], axes[:COUNT, 1], strict=True)
    expected = np.array([checker.checker_wave_mean(*row) for row in rows])
    assert np.abs(expected[:60]).max() > 0.3 and np.abs(expected[60:]).max() > 0.3
    np.testing.assert_allclose(osl[:COUNT], expected, rtol=0, atol=SERIES)


def test_the_footprint_of_a_pixel_on_the_surface():
    rng = np.random.default_rng(5)
    given = Inputs()
    turn = np.linalg.qr(rng.normal(size=(ROWS, 3, 3)))[0]
    steps = given.vectors("vector dpdx, vector dpdy", turn[:, :2] * 10.0 ** rng.uniform(-3, 0, (ROWS, 1, 1)))
    across = rng.uniform(-5, 5, (ROWS, 2, 1))
    view = unit(turn[:, 2] + (across * turn[:, :2]).sum(axis=1))
    view, normal = given.vectors("vector view, vector up", np.stack([view, turn[:, 2]], axis=1)).transpose(1, 0, 2)
    std = given.floats("float std", rng.uniform(0.1, 1, ROWS))
    body = "surface_footprint(dpdx, dpdy, view, up, std, first, second);"
    osl = given.evaluate(HEADERS, "vector first, second;", body, each("first", "second"))
    expected = np.concatenate(checker.surface_footprint(*steps.transpose(1, 0, 2), view, normal, std), axis=1)
    size = np.linalg.norm(expected, axis=1)
    cosine = np.abs(np.einsum("nk,nk->n", view, normal))
    assert (np.abs(osl - expected).max(1) < ROUNDING * size / cosine).all()
