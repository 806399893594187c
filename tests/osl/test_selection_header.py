"""osl/selection.h, osl/facet.h and osl/counters.h against their numpy twins."""

import re

import numpy as np

from glint_addon.paths import shader_file
from tests.helpers.osl_functions import FAST_MATH, ROWS, Inputs, evaluate
from tests.reference import facet, light_hint, query, selection

FACET = "Facet facet; facet.distribution = is_ggx ? \"ggx\" : \"beckmann\"; facet.alpha = alpha;"
LOBE = ("weight", "p1", "p2", "c11", "c12", "c22")


def test_what_a_facet_shows_of_its_slopes():
    rng = np.random.default_rng(8)
    given = Inputs()
    is_ggx = given.ints("int is_ggx", rng.integers(0, 2, ROWS)) != 0
    alpha, radius = given.floats("float alpha, float region", 10.0 ** rng.uniform(-3, 0, (ROWS, 2))).T
    square, width = given.floats("float square, float width", 10.0 ** rng.uniform(-4, 0, (ROWS, 2))).T
    osl = given.evaluate(("facet.h",), "", FACET, (
        "facet_is_ggx(facet)", "facet_gain(facet, region)", "facet_lobe(facet, square, width)",
    ))
    np.testing.assert_array_equal(osl[:, 0] != 0, is_ggx)
    np.testing.assert_allclose(osl[:, 1], facet.facet_gain(is_ggx, alpha, radius), rtol=1e-6)
    # Beckmann's exponential loses digits with its argument, and is then nothing.
    expected = facet.facet_lobe(is_ggx, square, width)
    tolerance = FAST_MATH * (1 + np.minimum(square / width, 80))
    assert (np.abs(osl[:, 2] - expected) <= tolerance * expected + 1e-30).all()


def test_a_sample_begins_with_one_closure_and_no_costs():
    body = """
      SampleCosts costs = no_costs();
      out[0] = costs.fetches; out[1] = costs.visited; out[2] = costs.closures; out[3] = costs.mode;
      out[4] = costs.left; out[5] = costs.hints;
    """
    osl = evaluate(("counters.h",), body, np.zeros((1, 1)), 6)
    np.testing.assert_array_equal(osl, [[0, 0, 1, 0, 0, 0]])


def test_the_numbers_of_modes_are_those_of_the_twin():
    header = shader_file("counters.h").read_text(encoding="utf-8")
    defined = {name: int(value) for name, value in re.findall(r"^#define (MODE_\w+) (\d)$", header, re.MULTILINE)}
    twin = {name: value for name, value in vars(query).items() if name.startswith("MODE_")}
    assert len(twin) == 4 and twin.items() <= defined.items()


ELEMENTS = 7  # given; each is repeated with scaled slopes until there are more than reservoirs
LIMITS = (1, 7, 24, 60)  # closures of a sample that are asked for
KEPT = 5  # numbers shown of each reservoir; one of them is made of all of the element's lobe, one of its place
MIXED = (1.0, 2.0, 3.0, 50.0, 70.0, 110.0)  # so that each number of an element weighs about as much
SELECTION_BODY = """
  Selection s = new_selection(limit + 1, 1, facet);
  s.random = chance;
  for (int k = 0; k < 7 * repeats; ++k) {
    int e = 6 * (k % 7);
    float scale = 1.0 - (k / 7) / 16.0;
    SlopeLobe lobe = { given[e], scale * given[e + 1], scale * given[e + 2], given[e + 3], given[e + 4], given[e + 5],
                       k, 0.5 * k };
    select_element(s, k % 2, k % 2 ? radius1 : radius0, lobe);
  }
  float shown[120];
  for (int k = 0; k < min(s.count, s.limit); ++k) {
    SlopeLobe lobe = s.lobe[k];
    float mixed = lobe.weight + 2 * lobe.p1 + 3 * lobe.p2 + 50 * lobe.c11 + 70 * lobe.c12 + 110 * lobe.c22;
    float numbers[5] = { s.sum[k], s.importance[k], s.hint[k], mixed, lobe.place1 + lobe.place2 };
    for (int n = 0; n < 5; ++n) { shown[5 * k + n] = numbers[n]; }
  }
"""


def test_each_reservoir_keeps_one_of_its_elements_with_odds_of_its_importance():
    rng = np.random.default_rng(9)
    elements = rng.normal(size=(ROWS, ELEMENTS, 6)) * 0.1
    elements[..., 0] = rng.uniform(0, 1, (ROWS, ELEMENTS))
    elements[..., 3:] = 0.01 * rng.uniform(0, 1, (ROWS, ELEMENTS, 3))
    given = Inputs()
    alpha = given.floats("float alpha", rng.uniform(0.01, 0.1, ROWS))
    radius = light_hint.REGION * alpha[:, None] + rng.uniform(0, 0.1, (ROWS, 2))
    radius = given.floats("float radius0, float radius1", radius)
    random = given.floats("float chance", rng.uniform(0, 1, ROWS))
    numbers = np.stack([rng.integers(1, 17, ROWS), rng.choice(LIMITS, ROWS), rng.integers(0, 2, ROWS)], axis=1)
    repeats, limit, is_ggx = given.ints("int repeats, int limit, int is_ggx", numbers).astype(int).T
    elements = given.floats(", ".join(f"given[{k}]" for k in range(6 * ELEMENTS)), elements)
    osl = given.evaluate(("selection.h",), f"float given[{6 * ELEMENTS}];", FACET + SELECTION_BODY, (
        "s.count", "s.limit", "s.is_merged", *(f"shown[{k}]" for k in range(KEPT * selection.CLOSURE_BUDGET)),
    ))

    clear = []
    for row in range(ROWS):
        k = np.arange(ELEMENTS * repeats[row])
        lobes = elements[row, k % ELEMENTS].copy()
        lobes[:, 1:3] *= (1 - (k // ELEMENTS) / 16)[:, None]
        importance = selection.element_importance(
            is_ggx[row], alpha[row], radius[row, k % 2], lobes[:, 0], lobes[:, 1:3], lobes[:, 3:])
        size = min(limit[row], selection.CLOSURE_BUDGET)
        kept, sums, sure = selection.reservoirs(importance, size, random[row])
        assert tuple(osl[row, :3]) == (len(k), size, 0)
        found = osl[row, 3:].reshape(-1, KEPT)[:len(kept)]
        np.testing.assert_allclose(found[:, 0], sums, rtol=1e-4)
        wanted = np.stack([importance[kept], kept % 2, lobes[kept] @ MIXED, 1.5 * kept], axis=1)
        np.testing.assert_allclose(found[sure, 1:], wanted[sure], rtol=1e-4, atol=1e-5)
        clear += [*sure]
    assert np.mean(clear) > 0.98


def test_the_importance_of_an_element_and_elements_of_none():
    rng = np.random.default_rng(10)
    given = Inputs()
    is_ggx = given.ints("int is_ggx", rng.integers(0, 2, ROWS)) != 0
    alpha = given.floats("float alpha", rng.uniform(0.01, 0.3, ROWS))
    region = given.floats("float region", light_hint.REGION * alpha + rng.uniform(0, 0.1, ROWS))
    lobes = 0.1 * rng.normal(size=(ROWS, 6))
    lobes[:, 0] = np.maximum(lobes[:, 0], 0.0)
    lobes[:, 3:] *= 0.1  # covariances of cells may be negative
    lobes = given.floats(", ".join(f"lobe.{name}" for name in LOBE), lobes)
    body = "Selection s = new_selection(25, 1, facet); select_element(s, 0, region, lobe);"
    osl = given.evaluate(("selection.h",), "SlopeLobe lobe;", FACET + body,
                         ("element_importance(facet, region, lobe)", "s.count"))
    expected = selection.element_importance(is_ggx, alpha, region, lobes[:, 0], lobes[:, 1:3], lobes[:, 3:])
    np.testing.assert_allclose(osl[:, 0], expected, rtol=1e-4)
    np.testing.assert_array_equal(osl[:, 1], expected > 0)
    assert 0.3 < (expected > 0).mean() < 0.7


def test_the_lobes_of_a_material_share_its_closures():
    given = Inputs()
    lobes = given.ints("int lobes", np.resize(np.arange(1, 33), ROWS))
    closures = given.ints("int closures", np.repeat([8, 16, 64], -(-ROWS // 3))[:ROWS])
    body = "Facet facet; Selection s = new_selection(closures, lobes, facet);"
    limit = given.evaluate(("selection.h",), "", body, ("s.limit",))[:, 0]
    # Each lobe has a remainder too.
    room = closures >= 2 * lobes
    assert (lobes * (limit + 1) <= closures)[room].all() and (limit[~room] == 1).all()
    assert limit[lobes * closures == 8].max() == 7 and limit.max() == selection.CLOSURE_BUDGET
    assert (limit == np.clip(closures // lobes - 1, 1, selection.CLOSURE_BUDGET)).all()
