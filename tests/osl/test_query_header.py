"""osl/query.h against its numpy twin."""

import numpy as np
import pytest

from glint_addon.bake import table as bake
from tests.helpers.osl_functions import ROUNDING, ROWS, Inputs, assert_flags_agree
from tests.osl.queries import declared_map, declared_query, give_hints, normals_near, random_hints
from tests.reference import map as normal_map
from tests.reference import query

HEADERS = ("query.h",)
CORNERS = "patch.n00, patch.n10, patch.n01, patch.n11"


def test_small_thin_and_wide_footprints_are_queried_in_their_own_ways():
    rng = np.random.default_rng(1)
    given = Inputs()
    sizes = given.floats("f.long_axis, f.short_axis, f.area", 10.0 ** rng.uniform(-1, (1, 0.5, 4), (ROWS, 3)))
    visits = given.ints("int visits", rng.integers(1, 4097, ROWS))
    osl = given.evaluate(HEADERS, "Footprint f;", "", ("query_mode(f, visits)",))
    expected = query.query_mode(*sizes.T, visits)
    np.testing.assert_array_equal(osl[:, 0], expected)
    assert set(expected) == {query.MODE_SINGLE, query.MODE_POINTS, query.MODE_ALL, query.MODE_SUBSET}


def test_the_first_hint_whose_region_holds_a_normal_selects_it_and_balls_are_not_skipped():
    rng = np.random.default_rng(7)
    given = Inputs()
    first, second = random_hints(rng, ROWS), random_hints(rng, ROWS)
    second.forms = first.forms + 0.1 * rng.normal(size=(ROWS, 3, 3))
    first, second = hints = give_hints(given, [first, second])
    near = normals_near(rng, first, 1.0)
    near[::10] *= -1  # behind the horizon
    n = given.vectors("vector n", near)
    offset = given.floats("float du, float dv", rng.normal(size=(ROWS, 2)))
    ball = given.floats("float ball", rng.uniform(0, 0.5, ROWS))
    body = """
      float p1 = 0, p2 = 0;
      int found = selecting_hint(query, n, du, dv, p1, p2);
    """
    osl = given.evaluate(HEADERS, declared_query(hints), body, (
        "found", "p1", "p2", "hint_reaches_ball(query, 0, n, ball, du, dv)",
        "hint_reaches_ball(query, 1, n, ball, du, dv)",
    ))
    found, slopes, margin = query.selecting_hint(hints, n, *offset.T)
    clear = margin > 1e-4
    assert clear.mean() > 0.98 and min((found == k).mean() for k in (-1, 0, 1)) > 0.05
    np.testing.assert_array_equal(osl[clear, 0], found[clear])
    along = np.array([np.einsum("nk,nk->n", hint.forms[:, 2], n) for hint in hints])[np.maximum(found, 0), range(ROWS)]
    tolerance = ROUNDING * (1 + np.abs(slopes).max(1)) / np.abs(along)
    assert (np.abs(osl[:, 1:3] - slopes).max(1) < tolerance)[clear].all()
    for number, hint in enumerate(hints):
        assert_flags_agree(osl[:, 3 + number], *query.hint_reaches_ball(hint, n, ball, *offset.T))


def test_the_covariance_of_the_slopes_of_a_part_of_a_patch():
    rng = np.random.default_rng(8)
    given = Inputs()
    hint = random_hints(rng, ROWS)
    (hint,) = give_hints(given, [hint])
    centre = normals_near(rng, hint, 1.0)
    patch = centre[:, None] + 0.15 * rng.normal(size=(ROWS, 4, 3)) * np.linalg.norm(centre, axis=1)[:, None, None]
    patch = given.vectors(CORNERS, patch)
    a, b = given.floats("part.a, part.b", rng.uniform(0, 1, (ROWS, 2))).T
    spread = given.floats("part.first_a, part.first_b, part.second_a, part.second_b", rng.normal(size=(ROWS, 4)))
    declarations = declared_query([hint]) + "Patch patch; PatchPart part;"
    low = hint.forms[:, 2][:, None] + 0.6 * rng.normal(size=(ROWS, 4, 3))
    low = given.vectors(CORNERS.replace("patch", "low"), low)
    declarations += "Patch low;"
    osl = given.evaluate(HEADERS, declarations, "SlopeLobe lobe; spread_over_part(hint0, patch, part, lobe);",
                         ("lobe.c11", "lobe.c12", "lobe.c22", "patch_is_above(query, 0, low)"))
    assert_flags_agree(osl[:, 3], *query.patch_is_above(hint, low))
    osl = osl[:, :3]
    n = normal_map.patch_normal(patch, a, b)
    along = np.einsum("nk,nk->n", hint.forms[:, 2], n)
    seen = along > 0.05  # nearer the horizon slopes have no size to be compared by
    assert seen.mean() > 0.95
    slope = query.hint_slope(hint, n, a, b)[1]
    covariance = query.spread_over_part(hint, patch, a, b, spread[:, :2], spread[:, 2:])
    differences = 1e-5  # the twin differentiates by steps of 1e-5
    size = np.abs(covariance).max(1) + 1e-3
    relative = np.abs(osl - covariance).max(1) / size
    assert (relative < differences + 64 * ROUNDING * (1 + np.abs(slope).max(1)) / along**2)[seen].all()


SIZE = (11, 7)  # texels, neither a power of two: the padded table has other things beyond the edge


@pytest.mark.parametrize("is_linear", [False, True])
@pytest.mark.parametrize("mode", [query.MODE_POINTS, query.MODE_ALL])
def test_the_hit_point_is_selected_as_its_element_is(tmp_path, is_linear, mode):
    rng = np.random.default_rng(9)
    width, height = SIZE
    normals = np.append(0.15 * rng.normal(size=(height, width, 2)), np.ones((height, width, 1)), 2).astype(np.float32)
    file, _ = bake.bake_table(normals, tmp_path, interpolation="LINEAR" if is_linear else "CLOSEST")
    given = Inputs()
    alpha = given.floats("facet.alpha", rng.uniform(0.01, 0.3, ROWS))
    strength = given.floats("map.strength", rng.uniform(0.2, 2.0, ROWS))
    hint = random_hints(rng, ROWS, radius=(0.1, 0.4))
    hint.forms = np.linalg.qr(rng.normal(size=(ROWS, 3, 3)) + 6 * np.diag([1, 1, 3]))[0] * [[-1], [-1], [-1]]
    hint.forms *= np.sign(hint.forms[:, 2:, 2:])
    (hint,) = give_hints(given, [hint])
    uv = given.floats("float across, float up", rng.uniform(-2, 2, (ROWS, 2)))
    body = f"""
      Hit hit = map_hit(map, point(across, up, 0));
      int selected = hit_is_selected(query, map, hit, {mode});
    """
    declarations = declared_map(file, normals, is_linear=is_linear) + declared_query([hint])
    given.statements.append("  query.facet = facet; query.facet.distribution = \"beckmann\";")
    osl = given.evaluate(HEADERS, declarations + "Facet facet;", body, ("selected", "hit.u", "hit.v"))
    hit = normal_map.map_hit(normals, strength, is_linear, uv)
    selected, margin = query.hit_is_selected([hint], normals, strength, alpha, hit, is_linear=is_linear, mode=mode)
    # The hit itself may lie in another part of its patch by rounding.
    assert_flags_agree(osl[:, 0], selected, margin)
