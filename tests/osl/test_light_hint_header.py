"""osl/light_hint.h and osl/normal_frame.h against their numpy twins, and frames against Blender's Normal Map node."""

import numpy as np
import pytest

from tests.helpers import cycles
from tests.helpers.osl_functions import (
    EPSILON,
    FAST_ASIN,
    MARGIN,
    ROUNDING,
    ROWS,
    Inputs,
    assert_flags_agree,
    each,
    unit,
)
from tests.helpers.osl_plane import SIDE
from tests.reference import footprint, light_hint

HEADERS = ("light_hint.h",)
TURNED = (0.2, 0.3, 0.4)
BASIS = "frame.tangent, frame.bitangent, frame.upright"
CHANGES = ("frame.tangent_dx, frame.tangent_dy, frame.bitangent_dx, frame.bitangent_dy, frame.upright_dx, "
           "frame.upright_dy")
FORMS = ("hint.f1", "hint.f2", "hint.f3")
TURNS = ("hint.turn_u1", "hint.turn_v1", "hint.turn_u2", "hint.turn_v2")


def split(values, *sizes):
    """Columns of `values` in pieces: (n,) for size 1, else (n, size)."""
    pieces = np.split(values, np.cumsum(sizes)[:-1], axis=1)
    return [piece[:, 0] if size == 1 else piece for piece, size in zip(pieces, sizes, strict=True)]


def give_hints_arguments(rng, given):
    """Random arguments of half_vector: light, shape, region, frame, footprint and the turn of the view."""
    rotation = np.linalg.qr(rng.normal(size=(ROWS, 3, 3)))[0]
    basis = given.vectors(BASIS, rotation + 0.2 * rng.normal(size=(ROWS, 3, 3)))  # objects may be sheared
    change = given.vectors(CHANGES, 0.01 * rng.normal(size=(ROWS, 6, 3)))
    steps = given.vectors("frame.dpdx, frame.dpdy", np.tile([[0.01, 0, 0], [0, 0.01, 0]], (ROWS, 1, 1)))
    to_steps = given.floats("f.xu, f.xv, f.yu, f.yv", rng.normal(size=(ROWS, 4)))
    is_local = rng.random(ROWS) < 0.5
    above = unit(rng.normal(size=(ROWS, 3)) + [0, 0, 0.7])
    light = np.where(is_local[:, None], above * rng.uniform(0.3, 5, (ROWS, 1)), above)
    light = given.vectors("vector light", light)
    kind = np.where(rng.random(ROWS) < 0.05, 0.0, np.where(is_local, light_hint.HINT_LOCAL, light_hint.HINT_SUN))
    shape = given.vectors("vector shape", np.stack([kind, rng.uniform(0, 0.15, ROWS), np.zeros(ROWS)], axis=1))
    region = given.floats("float region", rng.uniform(0.001, 0.3, ROWS))
    view_turn = given.floats("float view_turn", rng.uniform(0, 2, ROWS))
    axes = given.floats("f.ux, f.uy, f.vx, f.vy", 5 * rng.normal(size=(ROWS, 4)))
    frame = light_hint.NormalFrame(*np.concatenate([basis, steps, change], axis=1).transpose(1, 0, 2))
    return light, shape, region, frame, footprint.Footprint(*axes.T, *to_steps.T, None, None, None), view_turn


def test_the_half_vector_of_suns_and_local_lights():
    rng = np.random.default_rng(6)
    given = Inputs()
    light, shape, region, frame, area, view_turn = give_hints_arguments(rng, given)
    body = """
      int valid = half_vector(light, shape, region, frame, f, view_turn, hint);
      if (valid) { turn_over(f, hint); }
    """
    fields = (*each("hint.h", "hint.t1", "hint.t2", *FORMS), *TURNS, "hint.radius", "hint.patch_turn", "hint.turn",
              "hint.reach", "hint.ball_growth")
    osl = given.evaluate(HEADERS, "NormalFrame frame; Footprint f; HalfVector hint;", body, (
        "valid", *(f"valid ? {field} : 0" for field in fields), *each("P", "I", "Ng"),
    ), rotation=TURNED)
    valid, h, t, forms, turns, radius, patch_turn, turn, reach, growth, position, view, normal = split(
        osl, 1, 3, 6, 9, 4, 1, 1, 1, 1, 1, 3, 3, 3
    )
    expected, twin = light_hint.half_vector(light, shape, region, frame, area, view_turn, position, view, normal)
    twin = light_hint.turn_over(area, twin)
    # Both answers occur; at most a few rows lie within rounding of the horizon or of the largest region.
    assert 0.2 < expected.mean() < 0.95 and (expected != (valid != 0)).sum() <= 2

    both = expected & (valid != 0)
    both &= np.abs(np.abs(twin.h[:, 2]) - 0.9) > MARGIN  # where OSL and the twin may choose different axes
    length = np.linalg.norm(view + np.where(shape[:, :1] == 2, unit(light - position), light), axis=1)
    # The half vector of nearly opposite directions is the difference of nearly equal numbers.
    tolerance = ROUNDING / np.minimum(length, 1.0) / np.sqrt(1 - twin.h[:, 2] ** 2).clip(0.1, 1)
    assert (np.abs(h - twin.h).max(1) < tolerance)[both].all()
    for value, other in ((t, twin.axes), (forms, twin.forms)):
        assert (np.abs(value - other.reshape(ROWS, -1)).max(1) < 4 * tolerance)[both].all()
    size = np.abs(twin.turns).max((1, 2)) + 1e-3
    turned = 16 * tolerance * size / np.minimum(length, 1.0)
    assert (np.abs(turns - twin.turns.reshape(ROWS, 4)).max(1) < turned)[both].all()
    assert (np.abs(radius - twin.radius) < (FAST_ASIN + tolerance) / length)[both].all()
    texels = np.abs([area.ux, area.uy, area.vx, area.vy]).sum(axis=0) + 2
    assert (np.abs(turn - twin.turn) < turned * texels)[both].all()
    assert (np.abs(reach - twin.reach) < turned * texels)[both].all()
    assert (np.abs(patch_turn - twin.patch_turn) < 2 * turned)[both].all()
    # The radius and the reach are multiplied by a third form that is about a unit vector.
    bound = 2 * ((FAST_ASIN + 8 * tolerance) / length + turned * texels)
    assert (np.abs(growth - twin.ball_growth) < bound)[both].all()


def test_the_axes_around_any_direction_and_the_largest_of_their_forms():
    rng = np.random.default_rng(15)
    given = Inputs()
    basis = given.vectors(BASIS, rng.normal(size=(ROWS, 3, 3)))
    h = given.vectors("hint.h", unit(rng.normal(size=(ROWS, 3))))
    osl = given.evaluate(HEADERS, "NormalFrame frame; HalfVector hint;", "slope_axes(frame, hint);", (
        *each("hint.t1", "hint.t2", *FORMS), "forms_norm(hint.f1, hint.f2)",
    ))
    still = np.zeros((8, ROWS, 3))
    axes, forms = light_hint.slope_axes(light_hint.NormalFrame(*basis.transpose(1, 0, 2), *still), h)
    clear = np.abs(np.abs(h[:, 2]) - 0.9) > 4 * EPSILON
    assert clear.mean() > 0.99 and 0.03 < (np.abs(h[:, 2]) > 0.9).mean() < 0.3
    size = np.linalg.norm(basis, axis=(1, 2))
    tolerance = ROUNDING * size[clear]
    assert (np.abs(osl[clear, :6] - axes.reshape(ROWS, 6)[clear]).max(1) < ROUNDING).all()
    assert (np.abs(osl[clear, 6:15] - forms.reshape(ROWS, 9)[clear]).max(1) < tolerance).all()
    # Squares are added, so forms of very different lengths keep the longer one.
    assert (np.abs(osl[clear, 15] - light_hint.forms_norm(forms)[clear]) < tolerance).all()


def test_where_a_light_with_a_cone_shines():
    rng = np.random.default_rng(16)
    kind = rng.choice([light_hint.HINT_SUN, light_hint.HINT_LOCAL], ROWS, p=[0.1, 0.9])
    cone = rng.choice([0.0, np.pi / 2, np.nan], ROWS, p=[0.1, 0.3, 0.6])
    cone = np.where(np.isnan(cone), rng.uniform(0.01, 1.5, ROWS), cone)
    given = Inputs()
    shape = given.vectors("vector shape", np.stack([kind, rng.uniform(0, 1, ROWS), cone], axis=1))
    light = given.vectors("vector light", rng.normal(size=(ROWS, 3)))
    axis = given.vectors("vector axis", unit(rng.normal(size=(ROWS, 3))))
    osl = given.evaluate(HEADERS, "", "", ("shines_here(light, shape, axis)", *each("P")), rotation=TURNED)
    assert_flags_agree(osl[:, 0], *light_hint.shines_here(light, shape, axis, osl[:, 1:]))
    # A flat lamp shines on its whole front, however near, and nowhere else.
    front = np.einsum("nk,nk->n", light - osl[:, 1:], axis)
    flat = (shape[:, 0] == light_hint.HINT_LOCAL) & (shape[:, 2] > light_hint.FLAT_CONE) & (np.abs(front) > ROUNDING)
    np.testing.assert_array_equal(osl[flat, 0] != 0, front[flat] > 0)


def test_whether_a_map_or_a_patch_reaches_a_hint():
    rng = np.random.default_rng(7)
    given = Inputs()
    frames = np.linalg.qr(rng.normal(size=(ROWS, 3, 3)))[0] + 0.05 * rng.normal(size=(ROWS, 3, 3))
    forms = given.vectors(", ".join(FORMS), frames * np.where(frames[:, 2:, 2:] < 0, -1.0, 1.0))
    radius = given.floats("hint.radius", rng.uniform(0.02, 0.5, ROWS))
    reach = given.floats("hint.reach", rng.uniform(0, 0.1, ROWS))
    rates = [given.floats(f"hint.turn_{name}", 0.05 * rng.normal(size=ROWS)) for name in ("u1", "v1", "u2", "v2")]
    offset = [given.floats(f"float offset_{name}", 5 * rng.normal(size=ROWS)) for name in "uv"]
    low = rng.normal(size=(ROWS, 2)) * 0.5
    boxes = np.stack([low, low + rng.uniform(0, 0.6, (ROWS, 2))], axis=1)
    boxes = given.vectors("vector low, vector high", np.append(boxes, np.zeros((ROWS, 2, 1)), axis=2))
    middle = np.append(low, np.ones((ROWS, 1)), axis=1)[:, None]
    patch = given.vectors("vector n0, vector n1, vector n2, vector n3", middle + 0.2 * rng.normal(size=(ROWS, 4, 3)))
    body = """
      vector corners[4] = { n0, n1, n2, n3 };
      int reached = hull_reaches_hint(hint, corners, offset_u, offset_v, hint.radius);
    """
    osl = given.evaluate(HEADERS, "HalfVector hint;", body, ("map_reaches_hint(hint, low, high)", "reached"))
    hint = light_hint.HalfVector(None, None, forms, None, radius, None, reach=reach)
    assert_flags_agree(osl[:, 0], *light_hint.map_reaches_hint(hint, boxes[:, 0, :2], boxes[:, 1, :2]))
    turn = np.stack([rates[0] * offset[0] + rates[1] * offset[1], rates[2] * offset[0] + rates[3] * offset[1]], axis=1)
    assert_flags_agree(osl[:, 1], *light_hint.hull_reaches_hint(hint, patch.transpose(1, 0, 2), turn, radius))


# --- normal_frame.h ---

FRAME = """
  NormalFrame frame;
  int found = normal_frame("geom:tangent", "geom:tangent_sign", frame);
  vector world = normalize(frame_to_world(frame, 2.0 * vector(UV) - 1.0));
"""


def flat(scene, width, *, material):
    return cycles.add_plane(scene, width, material=material)


def curved(scene, width, *, material):
    """A smooth sheet that fills the view with one flat square, whose normals turn towards flaps beyond its edges; the
    object is scaled unevenly."""
    h = width / 2
    square = [(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)]
    outer = [(-h, -2 * h, 0.4), (h, -2 * h, -0.5), (2 * h, -h, 0.1), (2 * h, h, 0.5), (h, 2 * h, 0.3),
             (-h, 2 * h, -0.2), (-2 * h, h, -0.3), (-2 * h, -h, 0.2)]
    faces = [(0, 1, 2, 3), (4, 5, 1, 0), (1, 6, 7, 2), (3, 2, 8, 9), (11, 0, 3, 10)]
    scale = np.array([1.5, 0.7, 2.0])
    places = np.array(square + outer)
    uvs = [places[corner, :2] / width + 0.5 for face in faces for corner in face]
    thing = cycles.add_mesh(scene, places / scale, faces, uvs=uvs, material=material, smooth=True)
    thing.scale = scale
    return thing


@pytest.mark.parametrize("shape", [flat, curved])
def test_a_frame_takes_normals_to_where_blenders_normal_map_node_takes_them(shape):
    given = Inputs()
    given.floats("float unused", np.zeros(ROWS))
    osl = given.evaluate(("normal_frame.h",), "", FRAME, (
        "found", *each("world", "Mapped", "P", "frame.dpdx", "frame.dpdy", *BASIS.split(", "), *CHANGES.split(", ")),
    ), rotation=TURNED, shape=shape)
    found, world, mapped, position, steps, basis, changes = split(osl, 1, 3, 3, 3, 6, 9, 18)
    assert (found == 1).all()
    np.testing.assert_allclose(world, mapped, rtol=0, atol=ROUNDING)

    # The derivatives, against differences from pixel to pixel within one triangle, away from its edges.
    grid = np.arange(1, SIDE - 1)
    rows, columns = (index.ravel() for index in np.meshgrid(grid, grid, indexing="ij"))
    kept = np.abs(rows - columns) > 2
    middle = (rows * SIDE + columns)[kept]
    differences = [(np.concatenate([basis, position], axis=1)[middle + step]
                    - np.concatenate([basis, position], axis=1)[middle - step]) / 2 for step in (1, SIDE)]
    along = np.stack([difference[:, 9:] for difference in differences], axis=-1)  # (n, 3, pixel axis)
    turned = np.stack([difference[:, :9] for difference in differences], axis=-1).reshape(-1, 3, 3, 2)
    share = np.linalg.pinv(along) @ steps.reshape(ROWS, 2, 3)[middle].transpose(0, 2, 1)
    expected = np.einsum("nbkp,nps->nbsk", turned, share)
    found = changes.reshape(ROWS, 3, 2, 3)[middle]
    size = np.abs(expected).max()
    assert size > 1e-3 if shape is curved else size < 1e-5
    # Differences of the second order, and rounding of float32 over a pixel's difference.
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.02 * size + ROUNDING)


def test_without_tangents_of_the_uv_map_there_is_no_frame():
    given = Inputs()
    given.floats("float unused", np.zeros(ROWS))
    body = 'NormalFrame frame; int found = normal_frame("None.tangent", "None.tangent_sign", frame);'
    assert (given.evaluate(("normal_frame.h",), "", body, ("found",)) == 0).all()
