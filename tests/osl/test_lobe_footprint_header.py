"""Footprints and hints of osl/lobe.h, and osl/edge.h, against twins that are composed of those of other headers."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from glint_addon.paths import shader_file
from tests.helpers.osl_functions import MARGIN, ROUNDING, ROWS, Inputs, unit
from tests.helpers.osl_plane import SIDE
from tests.osl.shading import (
    BASIS,
    SURFACE,
    TURNED,
    VIEW,
    give_view,
    random_texels,
    rotation_matrix,
    surface,
    surface_of,
)
from tests.reference import edge, light_hint, lobe, pixel_grid, query
from tests.reference import footprint as footprints

HEADERS = ("lobe.h", "edge.h")
FIELDS = tuple(f"f.{name}" for name in footprints.FIELDS)
CHANGES = ("frame.dpdx, frame.dpdy, frame.tangent_dx, frame.tangent_dy, frame.bitangent_dx, frame.bitangent_dy, "
           "frame.upright_dx, frame.upright_dy")
LIGHTS = 3  # that are given; there may be eight


def assert_footprints(osl, twin, tolerance):
    """Columns of `osl` are the fields of a footprint, relative to the largest of each kind."""
    for columns in (slice(0, 4), slice(4, 8), slice(8, 9), slice(9, 11)):
        expected = np.stack([getattr(twin, name) for name in footprints.FIELDS], axis=1)[:, columns]
        error = np.abs(osl[:, columns] - expected).max(1) / np.abs(expected).max(1)
        assert (error < tolerance).all()


def test_round_footprints_of_camera_rays_and_of_diffuse_bounces_and_the_edges_that_they_meet():
    rng = np.random.default_rng(1)
    given = Inputs()
    texels = random_texels(rng, 0.05, 20)
    texels[:20] = 0
    bounce = np.where(rng.random(ROWS) < 0.5, 0.0, 10.0 ** rng.uniform(-2, 1, ROWS))
    texels, samples, bounce = give_view(given, texels, rng.integers(1, 300, ROWS), bounce)
    uv = given.floats("float across, float up", rng.uniform(-0.1, 1.1, (ROWS, 2)))
    declarations = VIEW + "Map map; map.width = 40; map.height = 60;"
    body = """
      int valid = round_footprint(view, f);
      int meets = meets_edge(map, point(across, up, 0), view.samples, texels);
    """
    osl = given.evaluate(HEADERS, declarations, body,
                         ("valid", "meets", *(f"valid ? {name} : 0" for name in FIELDS), *SURFACE), rotation=TURNED)
    seen = surface_of(osl)
    valid, twin = lobe.round_footprint(seen, texels, samples, bounce)
    np.testing.assert_array_equal(osl[:, 0] != 0, valid)
    assert not valid[:20].any() and valid[20:].all()
    assert_footprints(osl[20:, 2:13], twin.at(slice(20, None)), 8 * ROUNDING)
    camera = lobe.round_footprint(seen, texels, samples, np.zeros(ROWS))
    meets, margin = edge.meets_edge((40, 60), uv, *camera)
    clear = np.abs(margin) > MARGIN
    assert clear.mean() > 0.98 and 0.1 < meets.mean() < 0.9
    np.testing.assert_array_equal(osl[clear, 1] != 0, meets[clear])


def grid_footprints(seen, texels, radius):
    """Footprints of `radius` (n,) pixels along the axes of the pixels, which are 1 / SIDE wide on the plane."""
    turn = rotation_matrix()
    pixels = np.stack([turn[:, 0], turn[:, 1]], axis=1) / SIDE
    steps = np.stack([seen.dpdx, seen.dpdy], axis=2)
    surface = np.linalg.pinv(steps) @ pixels * radius[:, None, None]
    return footprints.surface_footprint(surface, texels)[1]


def grid_is_used(known, own, widest, visits):
    """Where footprints `own` (round) and `widest` let the grid decide, and where rounding cannot change that."""
    used = known & (lobe.query_modes(own, visits) != query.MODE_SINGLE)
    used &= np.isin(lobe.query_modes(widest, visits), (query.MODE_ALL, query.MODE_POINTS))
    numbers = (own.long_axis / 0.5, widest.long_axis / 0.5, widest.short_axis / 1.0, widest.area / visits)
    return used, (np.abs(np.stack(numbers) - 1) > 4 * PIXELS).all(axis=0)


PIXELS = 5e-3  # how well the raster's derivatives are known: see test_pixel_grid.py


def test_footprints_on_the_pixel_grid_are_used_where_several_elements_are_visited_whole_or_by_points():
    rng = np.random.default_rng(2)
    given = Inputs()
    texels, samples, bounce = give_view(given, random_texels(rng, 0.1, 60), 2.0 ** rng.integers(0, 10, ROWS),
                                        np.zeros(ROWS))
    given.ints("view.on_grid", np.arange(ROWS) % 8 > 0)
    declarations = VIEW + "PixelGrid grid; Map map; map.visits = 300; map.counts.first = 0; map.counts.levels = 0;"
    body = "Footprint own; round_footprint(view, own); int used = grid_footprint(view, map, own, grid, f);"
    osl = given.evaluate(HEADERS, declarations, body,
                         ("used", *(f"used ? {name} : 0" for name in FIELDS), "used ? grid.radius_x : 0", *SURFACE),
                         rotation=TURNED)
    seen = surface_of(osl)
    known, grid = pixel_grid.pixel_grid(np.full((ROWS, 2), pixel_grid.GRID_MIDDLE), samples)
    widest = grid_footprints(seen, texels, grid.widest)
    own = lobe.round_footprint(seen, texels, samples, bounce)[1]
    wanted, clear = grid_is_used(known & (np.arange(ROWS) % 8 > 0), own, widest, 300)
    assert (lobe.query_modes(own, 300) == query.MODE_SINGLE)[lobe.query_modes(widest, 300) != query.MODE_SINGLE].any()
    assert clear.mean() > 0.9 and 0.2 < wanted.mean() < 0.8
    np.testing.assert_array_equal(osl[clear, 0] != 0, wanted[clear])
    both = clear & wanted
    assert_footprints(osl[both, 1:12], widest.at(both), 4 * PIXELS)
    np.testing.assert_allclose(osl[both, 12], grid.radius[both, 0], rtol=1e-4)


def random_lights(rng, up):
    """Places and shapes (ROWS, LIGHTS, 3) of lights that mostly stand above surfaces with the normals `up`."""
    kind = rng.choice([0.0, light_hint.HINT_SUN, light_hint.HINT_LOCAL], (ROWS, LIGHTS), p=[0.1, 0.5, 0.4])
    direction = unit(rng.normal(size=(ROWS, LIGHTS, 3)) + 1.5 * up[:, None])
    place = np.where(kind[..., None] == light_hint.HINT_LOCAL, rng.uniform(1, 5, (ROWS, LIGHTS, 1)), 1.0) * direction
    return place, np.stack([kind, rng.uniform(0, 0.1, (ROWS, LIGHTS)), np.zeros((ROWS, LIGHTS))], axis=2)


def give_lights(given, places, shapes):
    given.statements.append("for (int k = 0; k < HINT_COUNT; ++k) { lights.place[k] = 0; lights.shape[k] = 0; }")
    # Lights may stand at any place of the list.
    names = [(f"lights.place[{2 * k + 1}]", f"lights.shape[{2 * k + 1}]") for k in range(LIGHTS)]
    places = given.vectors(", ".join(place for place, _ in names), places)
    return places, given.vectors(", ".join(shape for _, shape in names), shapes)


def give_frame(given, rng, size):
    """A frame that is not flat, as OSL gets it; size: of its changes."""
    basis = given.vectors(BASIS, np.linalg.qr(rng.normal(size=(ROWS, 3, 3)))[0])
    changes = size * rng.normal(size=(ROWS, 8, 3)) * np.exp(rng.uniform(-3, 3, (ROWS, 1, 1)))
    changes = given.vectors(CHANGES, changes)
    return light_hint.NormalFrame(*np.concatenate([basis, changes], axis=1).transpose(1, 0, 2))


BOUNDS = (np.array([-0.3, -0.1]), np.array([0.1, 0.2]))
BOUNDED = "Map map; map.strength = 0.7; map.low = vector(-0.3, -0.1, 0); map.high = vector(0.1, 0.2, 0);"
HINTS = ("radius", "turn", "reach", "ball_growth")


def rows_agree(osl, hints, expected):
    """Rows whose number of hints is that of the twin: nearly all; there the hints are the twin's, in order."""
    number = lobe.used(hints)
    agree = osl[:, 0] == number
    assert (~agree & expected).sum() <= 4, "a few lie within rounding of the horizon or of the largest region"
    assert len(np.unique(number)) == LIGHTS + 1
    values = np.stack([[getattr(hint, name) for name in HINTS] for hint in hints]).transpose(2, 0, 1)  # (n, hint, name)
    order = np.argsort([hint.radius <= 0 for hint in hints], axis=0, kind="stable").T
    values = np.take_along_axis(values, order[:, :, None], axis=1)
    kept = np.arange(LIGHTS) < number[:, None]
    found = osl[:, 1:].reshape(ROWS, LIGHTS, len(HINTS))
    error = np.abs(found - values) / (1e-2 + np.abs(values))
    assert (error.max(axis=2) < 2e-3)[kept & (agree & expected)[:, None]].all()
    return agree & expected


def shown_hints(count):
    """Results for `rows_agree`, of the OSL number `count`."""
    return (count, *(f"{k} < {count} ? query.hints[{k}].{name} : 0" for k in range(LIGHTS) for name in HINTS))


def test_the_hints_of_a_query_those_that_the_map_reaches_and_how_small_its_footprint_must_be():
    rng = np.random.default_rng(3)
    given = Inputs()
    alpha = given.floats("facet.alpha", rng.uniform(0.01, 0.15, ROWS))
    texels, samples, bounce = give_view(given, random_texels(rng, 0.3, 30), rng.choice([1.0, 16.0], ROWS),
                                        np.where(rng.random(ROWS) < 0.3, rng.uniform(0.5, 5, ROWS), 0.0))
    places, shapes = give_lights(given, *random_lights(rng, surface().normal))
    frame = give_frame(given, rng, 0.003)
    own = given.floats(", ".join(FIELDS), np.concatenate([
        20 * rng.normal(size=(ROWS, 4)), rng.normal(size=(ROWS, 4)), 10.0 ** rng.uniform(2, 5, (ROWS, 1)),
        rng.uniform(1, 9, (ROWS, 2)),
    ], axis=1))
    body = """
      query.facet = facet; query.footprint = f;
      add_hints(lights, frame, view, query);
      int added = query.hint_count;
      keep_reached(map, query);
      float scale = footprint_scale(query, view.samples, LARGEST_FOOTPRINT_TURN);
    """
    declarations = VIEW + "Facet facet; facet.distribution = \"ggx\"; Lights lights; NormalFrame frame;" + BOUNDED
    osl = given.evaluate(HEADERS, declarations, body, (*shown_hints("query.hint_count"), "scale", "added", *SURFACE),
                         rotation=TURNED)
    seen = surface_of(osl)
    seen.view_turn = np.where(bounce > 0, 1 / np.where(bounce > 0, bounce, 1), seen.view_turn)
    footprint = footprints.Footprint(*own.T)
    added = lobe.add_hints(places, shapes, alpha, frame, seen, footprint)
    assert (osl[:, -17] != lobe.used(added)).sum() <= 4
    hints, margin = lobe.keep_reached(added, footprint, *BOUNDS, 0.7)
    assert 0.3 < (lobe.used(hints) < lobe.used(added)).mean() < 0.95
    agree = rows_agree(osl[:, :13], hints, (margin > MARGIN) & (osl[:, -17] == lobe.used(added)))
    assert agree.mean() > 0.95
    scale = lobe.footprint_scale(hints, footprint.area, samples)
    np.testing.assert_allclose(osl[agree, 13], scale[agree], rtol=5e-3)
    assert 0.2 < (scale[agree] < 1).mean() < 0.9 and len(np.unique(np.round(scale, 2))) > 20


def fitted_on_grid(hints, seen, texels, samples, own, fitted):
    """What the answer `fitted` of the twin's fit_footprint becomes where the pixel grid decides, and where it does."""
    footprint, round_hints, margin = fitted
    known, grid = pixel_grid.pixel_grid(np.full((ROWS, 2), pixel_grid.GRID_MIDDLE), samples)
    widest = grid_footprints(seen, texels, grid.widest)
    is_used, is_clear = grid_is_used(known, own, widest, 4096)
    wide_hints, wide_margin = lobe.keep_reached(hints, widest, *BOUNDS, 0.7)
    scale = lobe.footprint_scale(wide_hints, widest.area, samples, pixel_grid.GRID_TURN)
    scale = np.where(lobe.used(wide_hints) > 0, scale, 1.0)
    is_grid = is_used & (scale == 1.0)
    turn = np.max([hint.turn for hint in wide_hints], axis=0)
    clear = is_clear & (np.abs(np.stack([turn, turn / pixel_grid.GRID_TURN]) - 1) > 4 * PIXELS).all(axis=0)
    margin = np.where(clear, np.minimum(margin, wide_margin), 0.0)
    narrow = grid_footprints(seen, texels, grid.radius[:, 0])
    footprint = footprints.Footprint(*(
        np.where(is_grid, getattr(narrow, name), getattr(footprint, name)) for name in footprints.FIELDS))
    # The hints' bounds are those of the widest footprint.
    round_hints = [
        replace(one, radius=np.where(is_grid, two.radius, one.radius), turn=np.where(is_grid, two.turn, one.turn),
                reach=np.where(is_grid, two.reach, one.reach),
                ball_growth=np.where(is_grid, two.ball_growth, one.ball_growth))
        for one, two in zip(round_hints, wide_hints, strict=True)
    ]
    return (footprint, round_hints, margin), is_grid


@pytest.mark.parametrize("on_grid", [0, 1])
def test_a_footprint_is_fitted_to_what_its_hints_allow(on_grid):
    rng = np.random.default_rng(4)
    given = Inputs()
    alpha = given.floats("facet.alpha", rng.uniform(0.01, 0.15, ROWS))
    texels, samples, bounce = give_view(given, random_texels(rng, 0.3, 60), rng.choice([1.0, 16.0], ROWS),
                                        np.zeros(ROWS), on_grid=on_grid)
    places, shapes = give_lights(given, *random_lights(rng, surface().normal))
    frame = give_frame(given, rng, 0.1)
    body = """
      query.facet = facet;
      round_footprint(view, f);
      query.footprint = f;
      float total = fit_footprint(lights, frame, view, map, query);
      f = query.footprint;
    """
    declarations = VIEW + "Facet facet; facet.distribution = \"ggx\"; Lights lights; NormalFrame frame;" + BOUNDED
    declarations += "map.visits = 4096; map.counts.first = 0; map.counts.levels = 0;"
    osl = given.evaluate(HEADERS, declarations, body, (*shown_hints("query.hint_count"), *FIELDS, "total", *SURFACE),
                         rotation=TURNED)
    seen = surface_of(osl)
    _, own = lobe.round_footprint(seen, texels, samples, bounce)
    hints = lobe.add_hints(places, shapes, alpha, frame, seen, own)
    footprint, round_hints, margin = lobe.fit_footprint(hints, own, samples, *BOUNDS, 0.7)
    is_grid = np.zeros(ROWS, bool)
    if on_grid:
        (footprint, round_hints, margin), is_grid = fitted_on_grid(
            hints, seen, texels, samples, own, (footprint, round_hints, margin))
        assert 0.1 < is_grid.mean() < 0.9
    np.testing.assert_array_equal(osl[:, 24], np.ones(ROWS))  # of a pixel's only sample, which lies in its middle
    found = osl[:, :13].copy()
    if on_grid:
        # Turns follow the widths of the pixels on the surface, which are known less well.
        found[:, 1:] = np.where(is_grid[:, None], np.nan_to_num(found[:, 1:]), found[:, 1:])
    agree = rows_agree(found, round_hints, (margin > MARGIN * (20 if on_grid else 1)))
    assert agree.mean() > (0.8 if on_grid else 0.95)
    assert_footprints(osl[agree, 13:24], footprint.at(agree), 4 * PIXELS if on_grid else 5e-3)
    assert on_grid or 0.1 < (footprint.area < 0.98 * own.area).mean() < 0.9


def test_the_constants_of_the_lobe_are_those_of_the_twin():
    headers = ("counts_cells.h", "light_hint.h", "query.h")
    text = "".join(shader_file(name).read_text(encoding="utf-8") for name in headers)
    defined = {name: float(value) for name, value in re.findall(r"^#define (\w+) ([\d.e-]+)$", text, re.MULTILINE)}
    for name in ("SPARE_TURN", "FAR_TURN", "LARGEST_FOOTPRINT_TURN", "LARGEST_VISIT"):
        assert defined[name] == getattr(lobe, name)
