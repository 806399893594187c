"""osl/closures.h and the closure of osl/facet.h against their numpy twins: rendered under a sun, nothing is random."""

import numpy as np
import pytest

from glint_addon.bake import flakes, table
from glint_addon.bake.slope_counts import slope_box
from tests.helpers.osl_functions import ROUNDING, ROWS, Inputs, evaluate, unit
from tests.osl.queries import declared_map
from tests.reference import closures, light_hint
from tests.reference import facet as facet_twin
from tests.reference import flakes as colors_twin

HEADERS = ("closures.h",)
TURNED = (0.2, 0.3, 0.4)
FACET = """Facet facet; facet.distribution = is_ggx ? "ggx" : "beckmann"; facet.alpha = alpha;
           facet.surface = SURFACE_TINT; facet.tint = color(1.0);"""
LOBE = ("weight", "p1", "p2", "c11", "c12", "c22")
# A closure is an exponential of the slopes' squares over alpha's, whose rounding it amplifies; masking adds more.
CLOSURE = 2e-3
SUN = np.array([0.6, -0.1, 1.0])  # near the plane's normal


def seen():
    """The view and the normal (ROWS, 3) at each pixel of the plane that is rendered."""
    return np.split(evaluate(HEADERS, "for (int k = 0; k < 3; ++k) { out[k] = I[k]; out[3 + k] = Ng[k]; }",
                             np.zeros((ROWS, 1)), 6, rotation=TURNED).astype(float), 2, axis=1)


def given_facet(rng):
    given = Inputs()
    is_ggx = given.ints("int is_ggx", rng.integers(0, 2, ROWS)) != 0
    return given, is_ggx, given.floats("float alpha", rng.uniform(0.1, 0.5, ROWS))


def half_vectors(given, rng, name, h):
    """Give OSL's hint `name` directions h (ROWS, 3), rounded, axes across them, and a region."""
    first = unit(np.cross(h, rng.normal(size=h.shape)))
    axes = np.stack([h, first, np.cross(h, first)], axis=1)
    axes = given.vectors(f"{name}.h, {name}.t1, {name}.t2", axes)
    radius = given.floats(f"{name}.radius", rng.uniform(0.1, 0.8, ROWS))
    return light_hint.HalfVector(axes[:, 0], axes[:, 1:], None, None, radius, None)


def tilts(rng):
    """Slopes (ROWS, 2) of normals that mirror every view upwards: Cycles bends others."""
    slopes = 0.2 * rng.normal(size=(ROWS, 2))
    return slopes * np.minimum(0.4 / np.linalg.norm(slopes, axis=1, keepdims=True), 1)


def tilted(rng, up):
    """Unit normals (ROWS, 3) around `up`, in all directions."""
    first = unit(np.cross(up, rng.normal(size=up.shape)))
    return unit(up + tilts(rng)[:, :1] * first)


def random_lobes(rng, *, spread=0.2):
    """Weights, slopes and covariances (ROWS, 6), of which some are those of no spread, and some have a negative one."""
    axes = spread * rng.normal(size=(ROWS, 2, 2)) * rng.choice([0.0, 0.02, 1.0], (ROWS, 1, 1))
    covariance = axes @ axes.transpose(0, 2, 1) - 1e-3 * np.eye(2) * (rng.random((ROWS, 1, 1)) < 0.3)
    entries = covariance.reshape(ROWS, 4)[:, [0, 1, 3]]
    return np.concatenate([rng.uniform(0.1, 1, (ROWS, 1)), tilts(rng), entries], axis=1)


def give_lobe(given, name, lobes):
    return given.floats(", ".join(f"{name}.{field}" for field in LOBE), lobes)


def assert_shown(picture, expected):
    """Closures reflect what they should, relative to their own size, and some of the largest."""
    assert (expected > 0.1 * expected.max()).mean() > 0.1
    np.testing.assert_allclose(picture, expected, rtol=CLOSURE, atol=CLOSURE * 1e-2 * expected.max())


def test_a_facet_is_a_microfacet_of_its_distribution_without_fresnel():
    rng = np.random.default_rng(1)
    view, up = seen()
    given, is_ggx, alpha = given_facet(rng)
    n = given.vectors("vector n", tilted(rng, up))
    body = FACET + "Result = facet_closure(facet, color(0.8), normal(n));"
    picture = given.reflected(HEADERS, "", body, SUN, rotation=TURNED)
    light = np.broadcast_to(unit(SUN), n.shape)
    assert_shown(picture, 0.8 * closures.facet_closure(is_ggx, alpha, unit(n), view, light))


def f82_tint(cosine, given):
    return facet_twin.f82_tint(cosine, np.minimum(given["tint"] * given["factor"], 1), given["edge"])


def conductor(cosine, given):
    return facet_twin.conductor(cosine, given["n"], given["k"])


def dielectric(cosine, given):
    """Real Fresnel reflectance between its value head-on, which is tinted, and 1."""
    head_on = facet_twin.conductor(1.0, given["n"], 0.0)
    share = (facet_twin.conductor(cosine, given["n"], 0.0) - head_on) / (1 - head_on)
    return head_on * given["tint"] * given["factor"] * (1 - share) + share


@pytest.mark.parametrize(("surface", "reflectance"), [
    ("METAL", f82_tint), ("CONDUCTOR", conductor), ("DIELECTRIC", dielectric)])
def test_a_facet_reflects_as_its_kind_of_surface(surface, reflectance):
    rng = np.random.default_rng(7)
    view, _ = seen()
    light = np.broadcast_to(unit(SUN), view.shape)
    given = Inputs()
    n = given.vectors("vector n", unit(view + light))
    low, high = np.array([[0.1, 0.5, 0.2, 1.1, 0.0], [0.9, 1.5, 1.0, 3.0, 4.0]])
    names = ("tint", "factor", "edge", "n", "k")
    columns = given.floats(", ".join(f"float given_{name}" for name in names), rng.uniform(low, high, (ROWS, 5)))
    body = f"""
      Facet facet; facet.distribution = "ggx"; facet.alpha = 0.3; facet.surface = SURFACE_{surface};
      facet.tint = color(given_tint); facet.edge_tint = color(given_edge); facet.ior = vector(given_n);
      facet.extinction = vector(given_k);
      Result = surface_closure(facet, 0.6, color(given_factor), normal(n), vector(0), 0.3, 0.3);"""
    picture = given.reflected(HEADERS, "", body, SUN, rotation=TURNED)
    bare = closures.facet_closure(np.ones(ROWS, bool), np.full(ROWS, 0.3), unit(n), view, light)
    cosine = np.einsum("nk,nk->n", unit(view + light), light)
    assert_shown(picture, 0.6 * bare * reflectance(cosine, dict(zip(names, columns.T, strict=True))))


def test_an_element_is_a_microfacet_as_wide_as_its_covariance_makes_it():
    rng = np.random.default_rng(2)
    view, up = seen()
    light = np.broadcast_to(unit(SUN), view.shape)
    given, is_ggx, alpha = given_facet(rng)
    hint = half_vectors(given, rng, "hint", unit(view + light))
    lobe = give_lobe(given, "lobe", random_lobes(rng))
    body = FACET + "Result = glint_closure(facet, 0.7, color(0.4), hint, lobe);"
    picture = given.reflected(HEADERS, "HalfVector hint; SlopeLobe lobe;", body, SUN, rotation=TURNED)
    assert_shown(picture, 0.7 * 0.4 * closures.glint_closure(is_ggx, alpha, hint, lobe, view, light))


def test_merged_cells_reflect_as_those_of_their_facets_that_mirror_the_light():
    rng = np.random.default_rng(3)
    view, _ = seen()
    given, _, alpha = given_facet(rng)
    hint = half_vectors(given, rng, "hint", unit(view + rng.normal(size=(ROWS, 3))))
    lobe = give_lobe(given, "lobe", random_lobes(rng))
    osl = given.evaluate(HEADERS, "HalfVector hint; SlopeLobe lobe;", "", ("merged_reflection(hint, alpha, lobe)",),
                         rotation=TURNED)[:, 0]
    expected = closures.merged_reflection(hint, alpha, lobe, view)
    # Quotients of cosines: near the horizon these are differences of nearly equal numbers.
    tolerance = 8 * ROUNDING * np.maximum(expected, 1 / expected) * (1 + expected)
    slope_cosine = np.abs(closures.dot(closures.element_normal(hint, lobe), view))
    clear = slope_cosine > 0.02
    assert clear.mean() > 0.9 and 0.1 < (np.abs(expected - 1) > 0.01).mean() < 0.9
    assert (np.abs(osl - expected) < tolerance / slope_cosine)[clear].all()


def test_small_weights_are_kept_by_roulette_and_keep_their_mean():
    rng = np.random.default_rng(4)
    given = Inputs()
    share = rng.choice([0.2, 0.7, 1.5], ROWS)
    weights = given.floats("float w", share * closures.LEAST_WEIGHT)
    given.floats("float first, float second", rng.uniform(0, 100, (ROWS, 2)))
    osl = given.evaluate(HEADERS, "", "", [f"roulette(w, first, second, {k})" for k in range(12)])
    large = share > 1
    np.testing.assert_array_equal(osl[large], np.tile(weights[large, None], 12))
    small = osl[~large]
    assert (np.isin(small, [0.0, np.float32(closures.LEAST_WEIGHT)])).all()
    for value in (0.2, 0.7):
        drawn = osl[share == value] > 0
        # Five standard errors of a mean, over closures and over samples alike.
        error = 5 * np.sqrt(value * (1 - value) / drawn.size)
        assert abs(drawn.mean() - value) < error
        assert np.abs(drawn.mean(axis=0) - value).max() < error * np.sqrt(12)
        assert (drawn != drawn[:, :1]).any(), "closures of a sample are drawn one by one"


CLOSURES = 24  # reservoirs: Cycles must keep them all
SELECTION = """
  HalfVector hints[2] = { hint0, hint1 };
  query.hints[0] = hint0; query.hints[1] = hint1; query.facet = facet; query.u = 3.5; query.v = 7.25;
  query.hint_count = 2;
  Selection s = new_selection(25, 1, facet);
  s.count = count; s.is_merged = merged;
  SlopeLobe lobes[3];
  lobes[0] = lobe0; lobes[1] = lobe1; lobes[2] = lobe2;
  for (int k = 0; k < 3; ++k) { lobes[k].place1 = places[2 * k]; lobes[k].place2 = places[2 * k + 1]; }
  for (int k = 0; k < 24; ++k) {
    s.sum[k] = 1.0 + k; s.importance[k] = 2.0; s.lobe[k] = lobes[k % 3]; s.hint[k] = k % 2;
  }
"""
DECLARED = "HalfVector hint0, hint1; SlopeLobe lobe0, lobe1, lobe2; Query query; Hit hit; float places[6];"
SIDE = 16  # texels of a map of flakes
MEAN = 0.7  # colour of the flakes around the hit
HALF = 2.0**-11  # rounding of a 16-bit float


def flakes_map(folder):
    """Flakes in a map (height, width, 3), their colours, and OSL statements that declare that map."""
    rng = np.random.default_rng(6)
    normals = np.dstack([rng.normal(0, 0.2, (SIDE, SIDE, 2)), np.ones((SIDE, SIDE))]).astype(np.float32)
    colors = rng.uniform(0.1, 1, (SIDE, SIDE, 3)).astype(np.float32)
    file, _ = table.bake_table(normals, folder, interpolation="CLOSEST")
    path, _ = flakes.bake_flakes(normals, colors, folder)
    return normals, colors, declared_map(file, normals, is_linear=False, has_flakes=True) + f"""
      map.flakes.table = "{path.as_posix()}"; map.flakes.have_colors = 1; lay_flakes(map);
      hit.column = 3; hit.row = 5; hit.flakes.mean = {MEAN};
    """


def element_colors(normals, colors, merged, places):
    """Red of the colours (rows, 3) of three elements: of their texels, or where they are merged of their slopes."""
    single = colors[places[..., 1].astype(int), places[..., 0].astype(int), 0]
    hit = np.tile([3.5, 5.5], (3 * ROWS, 1))
    mean = np.full((3 * ROWS, 3), MEAN)
    many = colors_twin.merged_color(normals, colors, slope_box(normals), mean, hit, places.reshape(-1, 2))
    return np.where(merged[:, None], many[:, 0].reshape(ROWS, 3), single)


@pytest.mark.parametrize("are_colored", [False, True])
def test_a_selection_is_the_sum_of_its_closures_and_of_the_remainder(tmp_path, are_colored):
    rng = np.random.default_rng(5)
    view, up = seen()
    light = np.broadcast_to(unit(SUN), view.shape)
    given, is_ggx, alpha = given_facet(rng)
    h = unit(view + light)
    hints = [half_vectors(given, rng, f"hint{k}", unit(h + 0.1 * k * up)) for k in range(2)]
    lobes = [give_lobe(given, f"lobe{k}", random_lobes(rng, spread=0.1)) for k in range(3)]
    n = given.vectors("vector n", tilted(rng, up))
    numbers = np.stack([rng.integers(0, 31, ROWS), rng.integers(0, 2, ROWS)], axis=1)
    count, merged = given.ints("int count, int merged", numbers).astype(int).T
    total = given.floats("float total", np.where(rng.random(ROWS) < 0.1, 0.0, rng.uniform(50, 100, ROWS)))
    places = np.where(merged[:, None, None], rng.normal(0.5, 0.2, (ROWS, 3, 2)), rng.integers(0, SIDE, (ROWS, 3, 2)))
    places = given.floats(", ".join(f"places[{k}]" for k in range(6)), places)
    normals, colors, declared = flakes_map(tmp_path)
    tints = element_colors(normals, colors, merged, places) if are_colored else np.ones((ROWS, 3))
    body = FACET + SELECTION + f"map.flakes.have_colors = {int(are_colored)}; map.costs = no_costs();"
    call = "selection_closures(query, map, hit, s, total, facet_closure(facet, color(1.0), normal(n)))"
    declared = DECLARED + declared
    picture = given.reflected(HEADERS, declared, f"{body} Result = {call};", SUN, rotation=TURNED)

    expected = closures.facet_closure(is_ggx, alpha, unit(n), view, light)
    made = np.where(total > 0, np.minimum(count, CLOSURES), 0)
    for k in range(CLOSURES):
        hint, lobe = hints[k % 2], lobes[k % 3]
        weight = lobe[:, 0] * (1 + k) / 2 / np.where(total > 0, total, 1.0)
        weight *= np.where(merged, closures.merged_reflection(hint, alpha, lobe, view), 1.0)
        value = tints[:, k % 3] * weight * closures.glint_closure(is_ggx, alpha, hint, lobe, view, light)
        expected += np.where(k < made, value, 0.0)
    assert (made == CLOSURES).mean() > 0.1
    assert_shown(picture, expected)
    body += f"closure color sum = {call};"
    osl = given.evaluate(HEADERS, declared, body, ("map.costs.closures",), rotation=TURNED)
    np.testing.assert_array_equal(osl[:, 0], 1 + made)
