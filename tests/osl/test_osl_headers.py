"""Each function of osl/*.h against its numpy twin in tests/reference, on a thousand random inputs in one render.

OSL computes in float32 from the very inputs the twin gets, so what may differ is rounding, and OSL's fast elementary
functions. A yes or no is compared where the twin's own margin is larger than that.
"""

import re

import numpy as np

from glint_addon.bake import table as bake
from glint_addon.paths import shader_file
from tests.helpers.osl_functions import ROWS, evaluate
from tests.reference import footprint, light_hint, selection, table
from tests.reference import map as normal_map

EPSILON = 2.0**-23  # float32 rounding of one operation
ROUNDING = 64 * EPSILON  # of some thirty operations on numbers of equal size, some of which cancel partly
FAST_MATH = 2e-5  # OSL's pow and sincos: a few float32 roundings of their argument's own size
FAST_ASIN = 1e-4  # OSL's asin: documented to be exact to 5e-5 radians
MARGIN = 1e-4  # of a condition, relative to the numbers compared: rounding must not decide it

HINT_HEADERS = ("normal_frame.h", "footprint.h", "light_hint.h")
MAP_HEADERS = ("table.h", *HINT_HEADERS, "map.h")


def read(values, sizes):
    """Columns of `values` cut into pieces: (n,) for size 1, else (n, size)."""
    pieces, start = [], 0
    for size in sizes:
        pieces.append(values[:, start] if size == 1 else values[:, start : start + size])
        start += size
    return pieces


def packed(*arrays):
    """float32 columns of (n,) and (n, k) arrays, and the arrays as float64 after that rounding."""
    columns = [np.asarray(array, np.float32).reshape(len(array), -1) for array in arrays]
    rounded = [column.astype(float).reshape(np.shape(array)) for column, array in zip(columns, arrays, strict=True)]
    return np.concatenate(columns, axis=1), rounded


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def assert_flags_agree(osl, twin, margin):
    """Yes or no is the same where the twin's margin leaves no doubt: nearly everywhere; and both answers occur."""
    clear = np.abs(margin) > MARGIN
    assert clear.mean() > 0.98
    assert 0.03 < twin.mean() < 0.99, "the inputs do not exercise both answers"
    np.testing.assert_array_equal(osl[clear] != 0, twin[clear])


# --- table.h ---


def test_padded_size_is_that_of_the_bake_for_every_size_to_8192():
    sizes = np.arange(1, 8193).reshape(ROWS, 8)
    osl = evaluate(("table.h",), "for (int k = 0; k < 8; ++k) out[k] = padded_size(in[k]);", sizes, 8)
    expected = np.array([[bake.padded_size(int(size)) for size in row] for row in sizes])
    np.testing.assert_array_equal(osl, expected)
    np.testing.assert_array_equal(table.padded_size(sizes), expected)


def test_wrapped_is_the_modulo_of_negative_integers_too():
    rng = np.random.default_rng(1)
    i = np.concatenate([rng.integers(-(2**22), 2**22, ROWS - 12), np.arange(-6, 6)])
    size = np.concatenate([rng.integers(1, 5000, ROWS - 12), np.full(12, 3)])
    osl = evaluate(("table.h",), "out[0] = wrapped((int)in[0], (int)in[1]);", np.stack([i, size], 1), 1)
    np.testing.assert_array_equal(osl[:, 0], table.wrapped(i, size))


def test_strength_scales_slopes_as_in_the_normal_map_node():
    rng = np.random.default_rng(2)
    bounds = np.sort(rng.normal(size=(ROWS, 2, 2)), axis=1)
    inputs, (n, strength, bounds) = packed(rng.uniform(-1, 1, (ROWS, 3)), rng.uniform(-1, 3, ROWS), bounds)
    osl = evaluate(
        ("table.h",), "vector n = strengthened(vector(in[0], in[1], in[2]), in[3]);"
        "vector low = vector(in[4], in[5], 0); vector high = vector(in[6], in[7], 0);"
        "strengthened_bounds(in[3], low, high); out[3] = low[0]; out[4] = low[1]; out[5] = high[0]; out[6] = high[1];"
        "out[0] = n[0]; out[1] = n[1]; out[2] = n[2];", inputs, 7,
    )
    np.testing.assert_allclose(osl[:, :3], table.strengthened(n, strength), rtol=0, atol=4 * EPSILON * 3)
    expected = [table.strengthened_bounds(*box, s) for box, s in zip(bounds, strength, strict=True)]
    np.testing.assert_allclose(osl[:, 3:].reshape(ROWS, 2, 2), expected, rtol=EPSILON, atol=0)


# --- footprint.h ---

FOOTPRINT_BODY = """
  Footprint f;
  Matrix2 surface = cone_on_surface(vector(in[0], in[1], in[2]), vector(in[3], in[4], in[5]),
                                    vector(in[6], in[7], in[8]), vector(in[9], in[10], in[11]), in[12]);
  Matrix2 texels = { in[13], in[14], in[15], in[16] };
  out[0] = surface_footprint(surface, texels, f);
  if (out[0] != 0) {
    out[1] = f.ux; out[2] = f.uy; out[3] = f.vx; out[4] = f.vy;
    out[5] = f.xu; out[6] = f.xv; out[7] = f.yu; out[8] = f.yv;
    out[9] = f.area; out[10] = f.long_axis; out[11] = f.short_axis;
  }
"""


def cones(rng, count, least_cosine):
    """Random ray cones: arguments of the twin's ray_footprint; cosines of view and normal from `least_cosine` to 1."""
    normal = unit(rng.normal(size=(count, 3)))
    first = unit(np.cross(normal, rng.normal(size=(count, 3))))
    second = np.cross(normal, first)
    cosine = least_cosine ** rng.uniform(0, 1, count)
    angle = rng.uniform(0, 2 * np.pi, count)
    across = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    view = cosine[:, None] * normal + np.sqrt(1 - cosine**2)[:, None] * across
    cone = 10.0 ** rng.uniform(-5, 0, count)
    jacobian = rng.normal(size=(count, 2, 2)) * 10.0 ** rng.uniform(-2, 3, (count, 1, 1))
    return (cone[:, None] * first, cone[:, None] * second, view, normal, rng.uniform(0.2, 1.1, count),
            jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 1, 0], jacobian[:, 1, 1])


def test_the_footprint_of_a_ray_cone():
    rng = np.random.default_rng(3)
    inputs, arguments = packed(*cones(rng, ROWS, 0.01))
    jacobian = inputs[:, 13:].reshape(-1, 2, 2).astype(float)
    inputs[:20, 13:] = 0  # no UV derivatives: no footprint
    for column, argument in zip(range(13, 17), arguments[5:], strict=True):
        argument[:20] = inputs[:20, column]
    osl = evaluate(("footprint.h",), FOOTPRINT_BODY, inputs, 12).astype(float)
    valid, twin = footprint.ray_footprint(*arguments)
    np.testing.assert_array_equal(osl[:, 0] != 0, valid)
    assert not valid[:20].any() and valid[20:].all()

    # The determinant cancels by the condition of the UVs, the cosine by its own smallness.
    expected = np.stack([getattr(twin, name) for name in footprint.FIELDS], axis=1)[valid]
    values = osl[valid, 1:]
    cosine = np.abs(np.einsum("nk,nk->n", arguments[2], arguments[3]))[valid]
    tolerance = ROUNDING * np.linalg.cond(jacobian[valid]) / cosine
    sizes = (np.abs(expected[:, :4]).max(1), np.abs(expected[:, 4:8]).max(1))
    for block, size in enumerate(sizes):
        error = np.abs(values - expected)[:, 4 * block : 4 * block + 4].max(1) / size
        assert (error < tolerance).all()
    assert (np.abs(values[:, 8] / expected[:, 8] - 1) < tolerance).all()
    # The semi-axes of a near circle are the square root of a difference of nearly nothing.
    assert (np.abs(values[:, 9:] / expected[:, 9:] - 1).max(1) < np.sqrt(EPSILON) + tolerance).all()


def test_the_footprint_stays_finite_to_89_99_degrees_and_beyond():
    rng = np.random.default_rng(4)
    arguments = list(cones(rng, ROWS, 0.1))
    normal, first = arguments[3], unit(arguments[0])
    cosine = np.concatenate([np.full(ROWS // 2, np.cos(np.radians(89.99))), np.zeros(ROWS - ROWS // 2)])
    arguments[2] = cosine[:, None] * normal + np.sqrt(1 - cosine**2)[:, None] * first
    arguments[5:] = [np.full(ROWS, value) for value in (1.0, 0.0, 0.0, 1.0)]
    osl = evaluate(("footprint.h",), FOOTPRINT_BODY, packed(*arguments)[0], 12)
    assert np.isfinite(osl).all() and (osl[:, 0] != 0).all()
    stretch = osl[:, 10] / osl[:, 11]
    # At 89.99 degrees the stretch is 1 / cosine = 5730; where float32 has lost the cosine it ends at 1 / LEAST_COSINE.
    assert (np.abs(stretch[: ROWS // 2] / 5730 - 1) < 0.01).all()
    assert (stretch[ROWS // 2 :] < 1.01 / footprint.LEAST_COSINE).all()


def test_the_constants_of_the_footprint_are_those_of_the_twin():
    header = shader_file("footprint.h").read_text(encoding="utf-8")
    defined = {name: float(value) for name, value in re.findall(r"^#define (\w+) ([\d.e-]+)$", header, re.MULTILINE)}
    twin = {name: value for name, value in vars(footprint).items() if name.isupper() and isinstance(value, float)}
    assert len(twin) == 5 and twin.items() <= defined.items()


def test_the_index_divides_by_the_integral_of_the_kernel():
    """Its elements are those near a half vector alone, so it cannot sum the weights of all."""
    source = shader_file("slope_index.h").read_text(encoding="utf-8")
    (divisor,) = re.findall(r"^  return footprint\.area / ([\d.]+);$", source, re.MULTILINE)
    t = (np.arange(1000) + 0.5) / 1000  # radius^2, which is uniform over the disk
    assert abs(footprint.footprint_kernel(t).mean() * float(divisor) - 1.0) < 1e-6


def test_the_ellipse_of_a_footprint_is_inverted_however_thin_it_is():
    rng = np.random.default_rng(12)
    turn = rng.uniform(0, 2 * np.pi, ROWS)
    thin = 10.0 ** rng.uniform(-3.5, 0, ROWS)  # short axis over long
    across = np.stack([-np.sin(turn), np.cos(turn)], axis=1) * thin[:, None]
    axes = np.stack([np.stack([np.cos(turn), np.sin(turn)], axis=1), across], axis=2)
    axes *= 10.0 ** rng.uniform(0, 3, ROWS)[:, None, None]
    wide = rng.uniform(0, 100, (ROWS, 2)) * rng.integers(0, 2, (ROWS, 1))
    inputs, (axes, wide, place) = packed(axes, wide, rng.uniform(-1, 1, (ROWS, 2)))
    osl = evaluate(
        ("footprint.h",), "Footprint f; f.ux = in[0]; f.uy = in[1]; f.vx = in[2]; f.vy = in[3];"
        "Ellipse e = footprint_ellipse(f, in[4], in[5]); out[0] = e.reach_u; out[1] = e.reach_v;"
        "out[2] = ellipse_square(e, in[6], in[7]);", inputs, 3,
    )
    form, reach = footprint.footprint_ellipse(axes, wide)
    np.testing.assert_allclose(osl[:, :2], reach, rtol=FAST_MATH)
    expected = np.einsum("ni,nij,nj->n", place, form, place)
    # The form's entries cancel along a thin ellipse's long axis, and so do the axes' own digits in its area.
    largest = (np.abs(form) * np.abs(place[:, :, None] * place[:, None])).sum(axis=(1, 2))
    assert (np.abs(osl[:, 2] - expected) < 8 * EPSILON / thin * largest).all()


def test_kernel_radius_and_samples_of_the_footprint():
    rng = np.random.default_rng(5)
    inputs, (t, samples, a, b) = packed(
        rng.uniform(0, 2, ROWS), rng.uniform(0, 3000, ROWS), rng.uniform(0, 1, ROWS), rng.uniform(0, 1, ROWS)
    )
    osl = evaluate(
        ("footprint.h",), "float x; float y; footprint_sample(in[2], in[3], x, y); out[0] = footprint_kernel(in[0]);"
        "out[1] = footprint_radius(in[1]); out[2] = x; out[3] = y;", inputs, 4,
    )
    np.testing.assert_allclose(osl[:, 0], footprint.footprint_kernel(t), rtol=0, atol=4 * EPSILON)
    np.testing.assert_allclose(osl[:, 1], footprint.footprint_radius(samples), rtol=FAST_MATH)
    x, y = footprint.footprint_sample(a, b)
    # r is the square root of a small number near the centre, where its error is that number's divided by 2 r.
    tolerance = FAST_MATH * (1 + 1 / np.maximum(np.hypot(x, y), np.sqrt(FAST_MATH)))
    assert (np.abs(osl[:, 2] - x) < tolerance).all() and (np.abs(osl[:, 3] - y) < tolerance).all()


# --- light_hint.h ---

HALF_VECTOR_BODY = """
  NormalFrame frame;
  frame.tangent = vector(in[0], in[1], in[2]); frame.bitangent = vector(in[3], in[4], in[5]);
  frame.upright = vector(in[6], in[7], in[8]); frame.tangent_dx = vector(in[9], in[10], in[11]);
  frame.tangent_dy = vector(in[12], in[13], in[14]); frame.bitangent_dx = vector(in[15], in[16], in[17]);
  frame.bitangent_dy = vector(in[18], in[19], in[20]); frame.upright_dx = vector(in[21], in[22], in[23]);
  frame.upright_dy = vector(in[24], in[25], in[26]);
  Footprint f;
  f.xu = in[27]; f.xv = in[28]; f.yu = in[29]; f.yv = in[30];
  f.ux = in[44]; f.uy = in[45]; f.vx = in[46]; f.vy = in[47];
  HalfVector hint;
  out[0] = half_vector(vector(in[31], in[32], in[33]), vector(in[34], in[35], 0), in[36], frame, f,
                       vector(in[37], in[38], in[39]), vector(in[40], in[41], in[42]), in[43], hint);
  if (out[0] != 0) {
    turn_over(f, hint);
  }
  vector results[7] = { hint.h, hint.t1, hint.t2, hint.f1, hint.f2, hint.f3,
                        vector(hint.turn_u1, hint.turn_v1, hint.turn_u2) };
  for (int k = 0; k < 21; ++k) {
    out[1 + k] = out[0] != 0 ? results[k / 3][k % 3] : 0;
  }
  out[22] = out[0] != 0 ? hint.turn_v2 : 0;
  out[23] = out[0] != 0 ? hint.radius : 0;
  out[24] = out[0] != 0 ? hint.ball_growth : 0;
  out[25] = out[0] != 0 ? hint.reach : 0;
  out[26] = out[0] != 0 ? hint.patch_turn : 0;
  for (int k = 0; k < 3; ++k) {
    out[27 + k] = P[k]; out[30 + k] = I[k]; out[33 + k] = Ng[k];
  }
"""


def test_the_half_vector_of_suns_and_local_lights():
    rng = np.random.default_rng(6)
    rotation = np.linalg.qr(rng.normal(size=(ROWS, 3, 3)))[0]
    basis = rotation + 0.2 * rng.normal(size=(ROWS, 3, 3))  # objects may be sheared
    is_local = rng.random(ROWS) < 0.5
    above = unit(rng.normal(size=(ROWS, 3)) + [0, 0, 0.7])
    light = np.where(is_local[:, None], above * rng.uniform(0.3, 5, (ROWS, 1)), above)
    kind = np.where(rng.random(ROWS) < 0.05, 0.0, np.where(is_local, light_hint.HINT_LOCAL, light_hint.HINT_SUN))
    shape = np.stack([kind, rng.uniform(0, 0.15, ROWS)], axis=1)
    cone = 0.01
    first, second = np.tile([cone, 0, 0], (ROWS, 1)), np.tile([0, cone, 0], (ROWS, 1))
    inputs, values = packed(
        basis.reshape(ROWS, 9), 0.01 * rng.normal(size=(ROWS, 18)), rng.normal(size=(ROWS, 4)), light, shape,
        rng.uniform(0.001, 0.3, ROWS), first, second, rng.uniform(0, 2, ROWS), 5 * rng.normal(size=(ROWS, 4)),
    )
    osl = evaluate(HINT_HEADERS, HALF_VECTOR_BODY, inputs, 36, rotation=(0.2, 0.3, 0.4)).astype(float)
    valid, h, t1, t2, f1, f2, f3, turns, radius, growth, reach, patch_turn, position, view, normal = read(
        osl, (1, 3, 3, 3, 3, 3, 3, 4, 1, 1, 1, 1, 3, 3, 3)
    )
    basis, frame_turns, to_steps, light, shape, k_alpha, first, second, view_turn, axes = values
    change = frame_turns.reshape(ROWS, 6, 3)
    frame = light_hint.NormalFrame(*basis.reshape(ROWS, 3, 3).transpose(1, 0, 2), *change.transpose(1, 0, 2))
    area = footprint.Footprint(*axes.T, *to_steps.T, None, None, None)
    expected, twin = light_hint.half_vector(
        light, shape, k_alpha, frame, area, first, second, view_turn, position, view, normal
    )
    # Both answers occur; at most a few rows lie within rounding of the horizon or of the largest region.
    assert 0.2 < expected.mean() < 0.95 and (expected != (valid != 0)).sum() <= 2

    both = expected & (valid != 0)
    both &= np.abs(np.abs(twin.h[:, 2]) - 0.9) > MARGIN  # where OSL and the twin may choose different axes
    length = np.linalg.norm(view + np.where(shape[:, :1] == 2, unit(light - position), light), axis=1)
    # The half vector of nearly opposite directions is the difference of nearly equal numbers.
    tolerance = ROUNDING / np.minimum(length, 1.0) / np.sqrt(1 - twin.h[:, 2] ** 2).clip(0.1, 1)
    assert (np.abs(h - twin.h).max(1) < tolerance)[both].all()
    for value, other in ((t1, twin.axes[:, 0]), (t2, twin.axes[:, 1]), (f1, twin.forms[:, 0]),
                         (f2, twin.forms[:, 1]), (f3, twin.forms[:, 2])):
        assert (np.abs(value - other).max(1) < 4 * tolerance)[both].all()
    size = np.abs(twin.turns).max((1, 2)) + 1e-3
    wanted = twin.turns[:, [0, 0, 1, 1], [0, 1, 0, 1]]
    assert (np.abs(turns - wanted).max(1) < 16 * tolerance * size / np.minimum(length, 1.0))[both].all()
    assert (np.abs(radius - twin.radius) < (FAST_ASIN + tolerance) / length)[both].all()
    turned = 16 * tolerance * size / np.minimum(length, 1.0)
    texels = np.abs(axes).sum(axis=1) + 2
    assert (np.abs(reach - twin.reach) < turned * texels)[both].all()
    assert (np.abs(patch_turn - twin.patch_turn) < 2 * turned)[both].all()
    # The radius and the reach are multiplied by a third form that is about a unit vector.
    bound = 2 * ((FAST_ASIN + 8 * tolerance) / length + turned * texels)
    assert (np.abs(growth - twin.ball_growth) < bound)[both].all()


def test_where_a_light_with_a_cone_shines():
    rng = np.random.default_rng(16)
    kind = rng.choice([light_hint.HINT_SUN, light_hint.HINT_LOCAL], ROWS, p=[0.1, 0.9])
    cone = rng.choice([0.0, np.pi / 2, np.nan], ROWS, p=[0.1, 0.3, 0.6])
    cone = np.where(np.isnan(cone), rng.uniform(0.01, 1.5, ROWS), cone)
    shape = np.stack([kind, rng.uniform(0, 1, ROWS), cone], axis=1)
    inputs, (light, shape, axis) = packed(rng.normal(size=(ROWS, 3)), shape, unit(rng.normal(size=(ROWS, 3))))
    body = """
      out[0] = shines_here(vector(in[0], in[1], in[2]), vector(in[3], in[4], in[5]), vector(in[6], in[7], in[8]));
      out[1] = P[0]; out[2] = P[1]; out[3] = P[2];
    """
    osl = evaluate(HINT_HEADERS, body, inputs, 4, rotation=(0.2, 0.3, 0.4)).astype(float)
    assert_flags_agree(osl[:, 0], *light_hint.shines_here(light, shape, axis, osl[:, 1:]))
    # A flat lamp shines on its whole front, however near, and nowhere else.
    front = np.einsum("nk,nk->n", light - osl[:, 1:], axis)
    flat = (shape[:, 0] == light_hint.HINT_LOCAL) & (shape[:, 2] > light_hint.FLAT_CONE) & (np.abs(front) > ROUNDING)
    np.testing.assert_array_equal(osl[flat, 0] != 0, front[flat] > 0)


HINT_BODY = """
  HalfVector hint;
  hint.f1 = vector(in[0], in[1], in[2]); hint.f2 = vector(in[3], in[4], in[5]); hint.f3 = vector(in[6], in[7], in[8]);
  hint.turn_u1 = in[9]; hint.turn_v1 = in[10]; hint.turn_u2 = in[11]; hint.turn_v2 = in[12];
  hint.radius = in[13]; hint.ball_growth = in[14]; hint.patch_turn = in[15]; hint.reach = 0;
"""


def random_hints(rng, count):
    """float32 columns of HINT_BODY and the same hints for the twins, in frames that are sheared a little."""
    frames = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0] + 0.05 * rng.normal(size=(count, 3, 3))
    forms = frames * np.where(frames[:, 2:3, 2:3] < 0, -1.0, 1.0)
    radius = rng.uniform(0.02, 0.5, count)
    turns = 0.05 * rng.normal(size=(count, 4))
    hint = light_hint.bounded_half_vector(None, None, forms, turns.reshape(count, 2, 2), radius, np.ones((count, 2)))
    inputs, (forms, turns, radius, growth, turn) = packed(forms, turns, radius, hint.ball_growth, hint.patch_turn)
    turns = turns.reshape(count, 2, 2)
    return inputs, light_hint.HalfVector(None, None, forms, turns, radius, hint.reach, turn, growth)


def normals_near(rng, hint, spread):
    """Tangent-space normals (n, 3) whose slopes around the half vectors are `spread` radii wide."""
    slopes = rng.normal(size=(len(hint.radius), 2)) * spread * hint.radius[:, None]
    wanted = np.concatenate([slopes, np.ones((len(slopes), 1))], axis=1)
    n = np.linalg.solve(hint.forms, wanted[..., None])[..., 0]
    return n * rng.uniform(0.3, 1.0, (len(n), 1))


def test_slopes_around_a_half_vector_and_the_tests_that_skip():
    rng = np.random.default_rng(7)
    columns, hint = random_hints(rng, ROWS)
    near = normals_near(rng, hint, 3.0)
    near[::10] *= -1  # behind the horizon
    low = rng.normal(size=(ROWS, 2)) * 0.5
    inputs, (n, offset, ball, low, high, reach) = packed(
        near, rng.normal(size=(ROWS, 2)), rng.uniform(0, 0.5, ROWS), low, low + rng.uniform(0, 0.6, (ROWS, 2)),
        rng.uniform(0, 0.1, ROWS),
    )
    osl = evaluate(
        MAP_HEADERS, HINT_BODY + """
  vector n = vector(in[16], in[17], in[18]);
  vector form = slope_forms(hint, n, in[19], in[20]);
  out[0] = form[2] > 0; out[1] = form[0] / form[2]; out[2] = form[1] / form[2];
  out[3] = hint_reaches_ball(hint, n, in[21], in[19], in[20]);
  hint.reach = in[26];
  out[4] = map_reaches_hint(hint, vector(in[22], in[23], 0), vector(in[24], in[25], 0));
""", np.concatenate([columns, inputs], axis=1), 5,
    )
    valid, slopes = light_hint.hint_slope(hint, n, *offset.T)
    along = np.einsum("nk,nk->n", hint.forms[:, 2], n)
    assert_flags_agree(osl[:, 0], valid, along)
    clear = valid & (along > MARGIN)
    tolerance = ROUNDING / along[clear] * (1 + np.abs(slopes[clear]).max(1))
    assert (np.abs(osl[clear, 1:3] - slopes[clear]).max(1) < tolerance).all()
    assert_flags_agree(osl[:, 3], *light_hint.hint_reaches_ball(hint, n, ball, *offset.T))
    hint.reach = reach
    reached, margin = light_hint.map_reaches_hint(hint, low, high)
    assert_flags_agree(osl[:, 4], reached, margin)


# --- map.h ---

PATCH_BODY = HINT_BODY + """
  Patch patch;
  patch.n00 = vector(in[16], in[17], in[18]); patch.n10 = vector(in[19], in[20], in[21]);
  patch.n01 = vector(in[22], in[23], in[24]); patch.n11 = vector(in[25], in[26], in[27]);
  vector n = patch_normal(patch, in[30], in[31]);
  PatchSlopes s;
  SlopeMoments m = { 0.0, 0.0, 0.0, 0.0, 0.0 };
  PatchPart part = { in[30], in[31], in[32], in[33], in[34], in[35] };
  out[0] = n[0]; out[1] = n[1]; out[2] = n[2];
  out[3] = patch_slopes(hint, patch, in[28], in[29], s);
  out[4] = patch_slope(hint, s, in[30], in[31], m.p1, m.p2);
  patch_covariance(s, part, m);
  out[5] = m.p1; out[6] = m.p2; out[7] = m.c11; out[8] = m.c12; out[9] = m.c22;
  out[10] = patch_columns(patch, in[36]); out[11] = patch_rows(patch, in[36]);
"""


def test_normals_slopes_and_covariance_of_a_bilinear_patch():
    rng = np.random.default_rng(8)
    columns, hint = random_hints(rng, ROWS)
    centre = normals_near(rng, hint, 1.0)
    patches = centre[:, None] + 0.15 * rng.normal(size=(ROWS, 4, 3)) * np.linalg.norm(centre, axis=1)[:, None, None]
    inputs, (patch, offset, at, spread, alpha) = packed(
        patches, rng.normal(size=(ROWS, 2)), rng.uniform(0, 1, (ROWS, 2)), rng.normal(size=(ROWS, 4)),
        rng.uniform(0.01, 0.3, ROWS),
    )
    osl = evaluate(MAP_HEADERS, PATCH_BODY, np.concatenate([columns, inputs], axis=1), 12).astype(float)
    np.testing.assert_allclose(osl[:, :3], normal_map.patch_normal(patch, *at.T), rtol=0, atol=4 * ROUNDING)

    valid, forms, margin = normal_map.patch_slopes(hint, patch, *offset.T)
    assert_flags_agree(osl[:, 3], valid, margin)
    along = normal_map.patch_normal(forms, *at.T)[:, 2]
    seen = valid & (along > 0.05)  # nearer the horizon slopes have no size to be compared by
    inside, slope = normal_map.patch_slope(hint, forms, *at.T)
    tolerance = ROUNDING * (1 + np.abs(slope).max(1)) / along * 4
    assert (np.abs(osl[:, 5:7] - slope).max(1) < tolerance)[seen].all()
    assert_flags_agree(osl[seen, 4], inside[seen], (np.linalg.norm(slope, axis=1) - hint.radius)[seen])

    covariance = normal_map.patch_covariance(forms, *at.T, spread[:, :2], spread[:, 2:])
    differences = 1e-5  # the twin differentiates by steps of 1e-5
    size = np.abs(covariance).max(1) + 1e-3
    relative = np.abs(osl[:, 7:10] - covariance).max(1) / size
    assert (relative < differences + 16 * tolerance / along)[seen].all()

    corners = patch.transpose(1, 0, 2)
    for column, order in ((10, (0, 1, 2, 3)), (11, (0, 2, 1, 3))):
        parts, exact = normal_map.patch_parts(*(corners[k] for k in order), alpha)
        clear = np.abs(exact - np.round(exact)) > MARGIN
        np.testing.assert_array_equal(osl[clear, column], parts[clear])
        assert clear.mean() > 0.98 and len(np.unique(parts)) > 5


# --- selection.h ---

ELEMENTS = 7  # given; each is repeated with scaled slopes until there are more than reservoirs
LIMITS = (1, 7, 24, 60)  # closures of a sample that are asked for
SELECTION_BODY = """
  HalfVector hints[8];
  hints[0].radius = in[0]; hints[1].radius = in[1];
  Selection s = new_selection((int)in[3], 1, (int)in[4], in[5], in[6]);
  int repeats = (int)in[2];
  for (int k = 0; k < 7 * repeats; ++k) {
    int e = 7 + 6 * (k % 7);
    float scale = 1.0 - (k / 7) / 16.0;
    SlopeMoments m = { scale * in[e + 1], scale * in[e + 2], in[e + 3], in[e + 4], in[e + 5] };
    select_element(s, hints, k % 2, in[e], m);
  }
  out[0] = s.count; out[1] = s.limit;
  for (int k = 0; k < min(s.count, s.limit); ++k) {
    int o = 2 + 5 * k;
    out[o] = s.sum[k]; out[o + 1] = s.importance[k]; out[o + 2] = s.p1[k]; out[o + 3] = s.c22[k];
    out[o + 4] = s.hint[k];
  }
"""


def test_each_reservoir_keeps_one_of_its_elements_with_odds_of_its_importance():
    rng = np.random.default_rng(9)
    elements = rng.normal(size=(ROWS, ELEMENTS, 6)) * 0.1
    elements[..., 0] = rng.uniform(0, 1, (ROWS, ELEMENTS))
    elements[..., 3:] = 0.01 * rng.uniform(0, 1, (ROWS, ELEMENTS, 3))
    alpha = rng.uniform(0.01, 0.1, ROWS)
    inputs, (radius, repeats, limit, is_ggx, alpha, random, elements) = packed(
        light_hint.REGION * alpha[:, None] + rng.uniform(0, 0.1, (ROWS, 2)), rng.integers(1, 17, ROWS),
        rng.choice(LIMITS, ROWS), rng.integers(0, 2, ROWS), alpha, rng.uniform(0, 1, ROWS), elements)
    osl = evaluate((*MAP_HEADERS, "selection.h"), SELECTION_BODY, inputs, 2 + 5 * selection.CLOSURE_BUDGET)

    clear = []
    for row in range(ROWS):
        k = np.arange(ELEMENTS * int(repeats[row]))
        weight, p, covariance = np.split(elements[row, k % ELEMENTS], [1, 3], axis=1)
        p = p * (1 - (k // ELEMENTS) / 16)[:, None]
        importance = selection.element_importance(
            is_ggx[row], alpha[row], radius[row, k % 2], weight[:, 0], p, covariance)
        size = min(int(limit[row]), selection.CLOSURE_BUDGET)
        kept, sums, sure = selection.reservoirs(importance, size, random[row])
        assert tuple(osl[row, :2]) == (len(k), size)
        found = osl[row, 2:].reshape(-1, 5)[:len(kept)]
        np.testing.assert_allclose(found[:, 0], sums, rtol=1e-4)
        wanted = np.stack([importance[kept], p[kept, 0], covariance[kept, 2], kept % 2], axis=1)
        np.testing.assert_allclose(found[sure, 1:], wanted[sure], rtol=1e-4, atol=1e-7)
        clear += [*sure]
    assert np.mean(clear) > 0.98


def test_lobes_of_one_point_share_the_closures_that_cycles_keeps():
    lobes = np.arange(1, 9)
    inputs, (lobes,) = packed(np.resize(lobes, ROWS))
    body = "Selection s = new_selection(60, (int)in[0], 0, 0.1, 0.5); out[0] = s.limit;"
    limit = evaluate((*MAP_HEADERS, "selection.h"), body, inputs, 1)
    # Each lobe has a remainder too.
    assert (lobes * (limit[:, 0] + 1) <= 64).all() and limit[0, 0] == selection.CLOSURE_BUDGET and limit.min() == 7


# --- query.h ---

VISIT_SIZE = (11, 7)  # texels, neither a power of two: the padded table has other things beyond the edge
VISIT_BODY = """
  Map map;
  map.table = "{file}"; map.width = {width}; map.height = {height};
  map.inverse_padded_width = 1.0 / padded_size({width}); map.inverse_padded_height = 1.0 / padded_size({height});
  map.strength = in[16]; map.is_linear = 1; map.kept = 0; map.fetches = 0;
  HalfVector hints[8];
  hints[0] = hint;
  Selection s = new_selection(24, 1, 0, 0.01, 0.5);
  PatchPart place = {{ in[19], in[20], 0.0, 0.0, 0.0, 0.0 }};
  visit_patch(map, hints, 0, 1, 0.01, MODE_POINTS, (int)in[17], (int)in[18], -in[19], -in[20], place, 1.0, s);
  out[0] = s.count; out[1] = map.fetches;
"""


def test_a_visit_skips_no_patch_whose_normal_is_in_the_region_at_the_edges_of_the_map_too(tmp_path):
    rng = np.random.default_rng(11)
    width, height = VISIT_SIZE
    slopes = 0.4 * rng.normal(size=(height, width, 2))
    normals = np.append(slopes, np.ones((height, width, 1)), axis=2).astype(np.float32)
    file, _ = bake.bake_table(normals, tmp_path, interpolation="LINEAR")

    # Points of all patches, and hints whose region's rim is around the normal there.
    i, j = np.arange(ROWS) % width, np.arange(ROWS) // width % height
    strength, a, b = rng.uniform(-2, 3, ROWS), rng.random(ROWS), rng.random(ROWS)
    strength, a, b = (values.astype(np.float32).astype(float) for values in (strength, a, b))
    patch = np.stack([normals[(j + dv) % height, (i + du) % width] for du, dv in normal_map.CORNERS], axis=1)
    patch = table.strengthened(patch, strength[:, None])
    h = unit(normal_map.patch_normal(patch, a, b))
    first = unit(np.cross(h, rng.normal(size=(ROWS, 3))))
    radius = rng.uniform(0.02, 0.3, ROWS)
    slope = radius[:, None] * rng.uniform(-1, 1, (ROWS, 2))
    forms = np.stack([first + slope[:, :1] * h, np.cross(h, first) + slope[:, 1:] * h, h], axis=1)
    turns = 0.02 * rng.normal(size=(ROWS, 2, 2))
    hint = light_hint.bounded_half_vector(None, None, forms, turns, radius, np.ones((ROWS, 2)))
    inputs, (hint.forms, hint.turns, hint.radius, *_) = packed(
        forms, turns, radius, hint.ball_growth, hint.patch_turn, strength, i, j, a, b)
    body = HINT_BODY + VISIT_BODY.format(file=file.as_posix(), width=width, height=height)
    osl = evaluate((*MAP_HEADERS, "selection.h", "query.h"), body, inputs, 2)

    valid, corners, margin = normal_map.patch_slopes(hint, patch, -a, -b)
    inside, slope = normal_map.patch_slope(hint, corners, a, b)
    margin = np.minimum(margin, np.abs(np.linalg.norm(slope, axis=1) - hint.radius))
    assert_flags_agree(osl[:, 0], valid & inside, margin)
    # One fetch for the bounds, where there are any, and four for the corners of what they do not rule out.
    bounded = table.patch_has_bounds(width, height, i, j)
    assert set(osl[bounded, 1]) <= {1, 5} and (osl[~bounded, 1] == 4).all() and not bounded.all()
