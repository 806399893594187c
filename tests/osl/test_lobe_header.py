"""Elements and closures of osl/lobe.h against brute force: all elements of a tiny map, in numpy."""

from __future__ import annotations

import numpy as np
import pytest

from glint_addon.bake import table as bake
from tests.helpers.osl_functions import MARGIN, ROWS, Inputs, each, unit
from tests.osl.queries import declared_map
from tests.osl.shading import BASIS, TURNED, VIEW, give_view, random_texels, rotation_matrix, surface
from tests.reference import closures, light_hint, lobe, query, visits
from tests.reference import footprint as footprints
from tests.reference import map as normal_map

HEADERS = ("lobe.h",)
SIZE = (16, 16)
SUN = np.array([0.6, -0.1, 1.0])  # near the plane's normal
CLOSURE = 4e-3  # slopes turn by places in float32, and closures amplify that: see test_closures_header.py
FACET = """Facet facet; facet.distribution = is_ggx ? "ggx" : "beckmann"; facet.alpha = alpha;
           facet.surface = SURFACE_TINT; facet.tint = color(1.0);"""


class Stage:
    """A lit point of a map at each pixel of the plane: what OSL is given, and the twin's answer."""

    def __init__(self, rng, folder, is_linear, least, most, *, samples=1.0, visits=4096):
        self.is_linear, self.visits = is_linear, visits
        slopes = 0.15 * rng.normal(size=(SIZE[1], SIZE[0], 2))
        self.normals = np.append(slopes, np.ones((SIZE[1], SIZE[0], 1)), axis=2).astype(np.float32)
        file, _ = bake.bake_table(self.normals, folder, interpolation="LINEAR" if is_linear else "CLOSEST")
        self.given = given = Inputs()
        self.is_ggx = given.ints("int is_ggx", rng.integers(0, 2, ROWS)) != 0
        self.alpha = given.floats("float alpha", rng.uniform(0.1, 0.25, ROWS))
        texels, samples, bounce = give_view(given, random_texels(rng, least, most), np.full(ROWS, samples),
                                            np.zeros(ROWS))
        uv = given.floats("float across, float up", rng.uniform(-1, 2, (ROWS, 2)))
        turn = rotation_matrix()
        basis = given.vectors(BASIS, np.tile(turn.T, (ROWS, 1, 1)))
        light = given.vectors("lights.place[0]", np.tile(unit(SUN), (ROWS, 1)))[:, None]
        shape = given.vectors("lights.shape[0]", np.tile([light_hint.HINT_SUN, 0.02, 0.0], (ROWS, 1)))[:, None]
        self.declarations = VIEW + declared_map(file, self.normals, is_linear=is_linear, visits=visits) + """
          NormalFrame frame; Lights lights;
          for (int k = 0; k < HINT_COUNT; ++k) { lights.place[k] = 0; lights.shape[k] = 0; }
          frame.dpdx = Dx(P); frame.dpdy = Dy(P);
          frame.tangent_dx = 0; frame.tangent_dy = 0; frame.bitangent_dx = 0; frame.bitangent_dy = 0;
          frame.upright_dx = 0; frame.upright_dy = 0;
        """
        self.body = FACET + """
          Hit hit = map_hit(map, point(across, up, 0));
          map.costs = no_costs();
          Selection s = new_selection(25, 1, facet);
          closure color plain = facet_closure(facet, color(1.0), normal(normalize(frame_to_world(frame, hit.n))));
        """
        seen = self.seen = surface()
        still = np.zeros((6, ROWS, 3))
        frame = light_hint.NormalFrame(*basis.transpose(1, 0, 2), seen.dpdx, seen.dpdy, *still)
        self.to_world = lambda n: unit(np.einsum("nk,nkw->nw", n, basis))
        self.hit = normal_map.map_hit(self.normals, 1.0, is_linear, uv)
        _, own = lobe.round_footprint(seen, texels, samples, bounce)
        hints = lobe.add_hints(light, shape, self.alpha, frame, seen, own)
        assert (lobe.used(hints) == 1).all()
        self.footprint, (self.hint,), _ = lobe.fit_footprint(hints, own, samples, np.zeros(2), np.zeros(2), 1.0)
        self.light = np.broadcast_to(unit(SUN), (ROWS, 3))
        self.frame = frame

    def selected(self, mode, chance, sure=0.0):
        """Sum of weights (ROWS,), number of visits (ROWS,), Selected, whether the hit is (ROWS,), and unclear rows."""
        total, every = visits.visit_elements(self.footprint, self.hit.u, self.hit.v, chance[:, :2], mode, self.visits,
                                             self.is_linear, sure)
        visited = np.bincount(every.row, minlength=ROWS)
        one = np.ones(ROWS)
        if self.is_linear:
            found = visits.visit_patch([self.hint], self.normals, one, self.alpha, every, ROWS)
        else:
            found = visits.visit_texel([self.hint], self.normals, one, every, ROWS)
        is_selected, margin = query.hit_is_selected([self.hint], self.normals, 1.0, self.alpha, self.hit,
                                                    is_linear=self.is_linear, mode=mode)
        return total, visited, found, is_selected, found.unclear | (margin < MARGIN)

    def shown_element(self, which, slopes):
        """Light that elements reflect; which: (m,), the query of each; slopes: their lobes (m, 6)."""
        return closures.glint_closure(self.is_ggx[which], self.alpha[which], self.hint.at(which), slopes,
                                      self.seen.view[which], self.light[which])

    def shown_plain(self):
        n = self.to_world(self.hit.n)
        return closures.facet_closure(self.is_ggx, self.alpha, n, self.seen.view, self.light)


@pytest.mark.parametrize("is_linear", [False, True])
def test_elements_are_selected_in_the_way_that_the_footprint_asks_for(tmp_path, is_linear):
    rng = np.random.default_rng(7)
    stage = Stage(rng, tmp_path, is_linear, 1.0, 6.0, samples=16.0, visits=10)
    chance = stage.given.vectors("query.random", rng.random((ROWS, 3)))
    body = stage.body + """
      query.u = hit.u; query.v = hit.v; query.facet = facet;
      round_footprint(view, f);
      query.footprint = f;
      fit_footprint(lights, frame, view, map, query);
      int mode = query_mode(query.footprint, map.visits);
      int is_selected = 0;
      float total = select_elements(map, query, hit, view, mode, s, is_selected);
    """
    osl = stage.given.evaluate(HEADERS, stage.declarations, body, ("total", "s.count", "8 * mode + is_selected"),
                               rotation=TURNED)
    modes = lobe.query_modes(stage.footprint, stage.visits)
    sizes = np.stack([stage.footprint.short_axis, stage.footprint.area / stage.visits])
    clear = (np.abs(sizes - 1) > MARGIN).all(axis=0) & (modes != query.MODE_SINGLE)
    expected = np.zeros((ROWS, 3))
    for mode in (query.MODE_POINTS, query.MODE_ALL, query.MODE_SUBSET):
        rows = modes == mode
        total, _, found, is_selected, unclear = stage.selected(mode, chance, visits.SURE_WEIGHT if is_linear else 0.0)
        counts = np.bincount(found.row, minlength=ROWS)
        expected[rows] = np.stack([total, counts, 8 * mode + is_selected], axis=1)[rows]
        clear &= ~(rows & unclear)
        assert rows.mean() > 0.05
    assert clear.mean() > 0.6
    np.testing.assert_allclose(osl[clear, 0], expected[clear, 0], rtol=1e-4)
    np.testing.assert_array_equal(osl[clear, 1:], expected[clear, 1:])


def shown_patch(stage):
    """Light that the one closure of each patch under a small footprint reflects."""
    n = stage.to_world(stage.hit.n)
    axes, forms = light_hint.slope_axes(stage.frame, n)
    around = light_hint.HalfVector(n, axes, forms, stage.hint.turns, stage.hint.radius, None)
    patch = normal_map.map_patch(stage.normals, 1.0, stage.hit.i, stage.hit.j)
    deviations = np.sqrt(footprints.KERNEL_VARIANCE) * stage.footprint.axes().transpose(0, 2, 1)
    covariance = query.spread_over_part(around, patch, stage.hit.u - stage.hit.i, stage.hit.v - stage.hit.j,
                                        deviations[:, 0], deviations[:, 1])
    zero = np.zeros((ROWS, 2))
    slopes = np.concatenate([np.ones((ROWS, 1)), zero, covariance], axis=1)
    return closures.glint_closure(stage.is_ggx, stage.alpha, around, slopes, stage.seen.view, stage.light)


def assert_shown(picture, expected, clear):
    assert clear.mean() > 0.6 and (expected[clear] > 0.1 * expected.max()).mean() > 0.1
    np.testing.assert_allclose(picture[clear], expected[clear], rtol=CLOSURE, atol=CLOSURE * 1e-1 * expected.max())


def test_a_footprint_within_a_patch_is_one_closure(tmp_path):
    stage = Stage(np.random.default_rng(5), tmp_path, True, 0.1, 1.0)
    body = stage.body + """
      query.facet = facet; round_footprint(view, f); query.footprint = f; add_hints(lights, frame, view, query);
      Result = patch_closure(query, map, hit, frame);
    """
    picture = stage.given.reflected(HEADERS, stage.declarations, body, SUN, rotation=TURNED)
    expected = shown_patch(stage)
    assert (np.abs(expected / stage.shown_plain() - 1) > 0.05).mean() > 0.1, "the patch widens some of the facets"
    assert_shown(picture, expected, np.ones(ROWS, bool))


@pytest.mark.parametrize("is_linear", [False, True])
def test_what_the_lobe_of_a_point_selects_and_shows_is_what_brute_force_says(tmp_path, is_linear):
    """Slow: the whole lobe is compiled twice, for what it shows and for what it says."""
    stage = Stage(np.random.default_rng(6), tmp_path, is_linear, 0.2, 3.0)
    body = stage.body + "plain = glint_lobe(facet, map, frame, hit, view, lights, s, plain);"
    picture = stage.given.reflected(HEADERS, stage.declarations, body + "Result = plain;", SUN, rotation=TURNED)
    osl = stage.given.evaluate(HEADERS, stage.declarations, body + """
      vector chance = (vector)hashnoise(point(hit.u, hit.v, P[0] + 2.0 * P[1] + 3.0 * P[2]));
    """, (*each("chance"), "map.costs.visited", "map.costs.closures",
          "100 * map.costs.mode + 10 * map.costs.left + map.costs.hints"), rotation=TURNED)
    modes = lobe.query_modes(stage.footprint, 4096)
    sizes = np.stack([stage.footprint.long_axis / 0.5, stage.footprint.short_axis])
    expected, clear = np.zeros(ROWS), (np.abs(sizes - 1) > MARGIN).all(axis=0)
    visited, made, left = np.zeros(ROWS, int), np.zeros(ROWS, int), np.zeros(ROWS, int)
    for mode in (query.MODE_POINTS, query.MODE_ALL):
        rows = modes == mode
        total, visits_made, found, is_selected, unclear = stage.selected(mode, osl[:, :3])
        count = np.bincount(found.row, minlength=ROWS)
        weight = found.lobe[:, 0] / total[found.row]
        shown = np.bincount(found.row, weight * stage.shown_element(found.row, found.lobe), ROWS)
        shown += np.where(is_selected, 0.0, stage.shown_plain())
        expected[rows] = shown[rows]
        # Of more elements than reservoirs some are drawn, and so are those that hardly weigh anything.
        faint = np.bincount(found.row, weight < 1.01 * closures.LEAST_WEIGHT, ROWS) > 0
        clear &= ~(rows & (unclear | faint | (count > 24)))
        for values, new in ((visited, visits_made), (made, count + ~is_selected)):
            values[rows] = new[rows]
        assert rows.mean() > 0.1 and 0.05 < is_selected[rows].mean() < 0.95
    single = modes == query.MODE_SINGLE
    assert single.mean() > 0.05
    expected[single] = (shown_patch(stage) if is_linear else stage.shown_plain())[single]
    visited[single], made[single], left[single] = is_linear, 1, 7
    modes = np.where(single & ~np.array(is_linear), 0, modes)
    answers = np.stack([visited, made, 100 * modes + 10 * left + 1], axis=1)
    np.testing.assert_array_equal(osl[clear, 3:], answers[clear])
    assert_shown(picture, expected, clear)
