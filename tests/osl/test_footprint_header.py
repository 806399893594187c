"""osl/footprint.h and osl/sample_filter.h against their numpy twins, on a thousand random inputs in one render.

OSL computes in float32 from the very inputs the twin gets, so what may differ is rounding, and OSL's fast elementary
functions. A yes or no is compared where the twin's own margin is larger than that.
"""

import re

import numpy as np

from glint_addon.paths import shader_file
from tests.helpers.osl_functions import EPSILON, FAST_MATH, ROUNDING, ROWS, Inputs, unit
from tests.reference import footprint, sample_filter


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


FOOTPRINT = "f.ux, f.uy, f.vx, f.vy, f.xu, f.xv, f.yu, f.yv, f.area, f.long_axis, f.short_axis"


def footprints_of(arguments):
    """The arguments of the twin's ray_footprint as OSL gets them, and OSL's (validity, fields of the footprint)."""
    given = Inputs()
    vectors = given.vectors("vector dpdx, vector dpdy, vector view, vector up", np.stack(arguments[:4], axis=1))
    scalars = given.floats("float radius, texels.xx, texels.xy, texels.yx, texels.yy", np.stack(arguments[4:], axis=1))
    body = "Matrix2 surface = cone_on_surface(dpdx, dpdy, view, up, radius);"
    body += "int valid = surface_footprint(surface, texels, f);"
    shown = [f"valid ? {name.strip()} : 0" for name in FOOTPRINT.split(",")]
    osl = given.evaluate(("footprint.h",), "Footprint f; Matrix2 texels;", body, ("valid", *shown))
    return [*vectors.transpose(1, 0, 2), *scalars.T], osl


def test_the_footprint_of_a_ray_cone():
    rng = np.random.default_rng(3)
    arguments = cones(rng, ROWS, 0.01)
    for column in arguments[5:]:
        column[:20] = 0  # no UV derivatives: no footprint
    arguments, osl = footprints_of(arguments)
    jacobian = np.stack(arguments[5:], axis=-1).reshape(-1, 2, 2)
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
    _, osl = footprints_of(arguments)
    assert np.isfinite(osl).all() and (osl[:, 0] != 0).all()
    stretch = osl[:, 10] / osl[:, 11]
    # At 89.99 degrees the stretch is 1 / cosine = 5730; where float32 has lost the cosine it ends at 1 / LEAST_COSINE.
    assert (np.abs(stretch[: ROWS // 2] / 5730 - 1) < 0.01).all()
    assert (stretch[ROWS // 2 :] < 1.01 / footprint.LEAST_COSINE).all()


def test_the_constants_of_the_footprint_are_those_of_the_twin():
    header = shader_file("footprint.h").read_text(encoding="utf-8")
    defined = {name: float(value) for name, value in re.findall(r"^#define (\w+) ([\d.e-]+)$", header, re.MULTILINE)}
    twin = {name: value for name, value in vars(footprint).items() if name.isupper() and isinstance(value, float)}
    assert len(twin) == 7 and twin.items() <= defined.items()


def test_the_index_divides_by_the_integral_of_the_kernel():
    """Its elements are those near a half vector alone, so it cannot sum the weights of all."""
    source = shader_file("slope_index.h").read_text(encoding="utf-8")
    (divisor,) = re.findall(r"^  return query\.footprint\.area / ([\d.]+);$", source, re.MULTILINE)
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
    given = Inputs()
    axes = given.floats("f.ux, f.uy, f.vx, f.vy", axes)
    wide = given.floats("float wide_u, float wide_v", wide)
    place = given.floats("float du, float dv", rng.uniform(-1, 1, (ROWS, 2)))
    body = "Ellipse e = footprint_ellipse(f, wide_u, wide_v);"
    osl = given.evaluate(("footprint.h",), "Footprint f;", body,
                         ("e.reach_u", "e.reach_v", "ellipse_square(e, du, dv)"))
    form, reach = footprint.footprint_ellipse(axes, wide)
    np.testing.assert_allclose(osl[:, :2], reach, rtol=FAST_MATH)
    expected = footprint.ellipse_square(form, place)
    # The form's entries cancel along a thin ellipse's long axis, and so do the axes' own digits in its area.
    largest = (np.abs(form) * np.abs(place[:, :, None] * place[:, None])).sum(axis=(1, 2))
    assert (np.abs(osl[:, 2] - expected) < 8 * EPSILON / thin * largest).all()


def test_kernel_radius_and_samples_of_the_footprint():
    rng = np.random.default_rng(5)
    given = Inputs()
    t, samples = given.floats("float t, float samples", rng.uniform(0, (2, 3000), (ROWS, 2))).T
    a, b = given.floats("float a, float b", rng.uniform(0, 1, (ROWS, 2))).T
    osl = given.evaluate(
        ("footprint.h", "sample_filter.h"), "", "float x, y; footprint_sample(a, b, x, y);",
        ("footprint_kernel(t)", "footprint_radius(samples)", "x", "y", "sample_filter_std(samples)"),
    )
    np.testing.assert_allclose(osl[:, 0], footprint.footprint_kernel(t), rtol=0, atol=4 * EPSILON)
    np.testing.assert_allclose(osl[:, 1], footprint.footprint_radius(samples), rtol=FAST_MATH)
    np.testing.assert_allclose(osl[:, 4], sample_filter.sample_filter_std(samples), rtol=FAST_MATH)
    x, y = footprint.footprint_sample(a, b)
    # r is the square root of a small number near the centre, where its error is that number's divided by 2 r.
    tolerance = FAST_MATH * (1 + 1 / np.maximum(np.hypot(x, y), np.sqrt(FAST_MATH)))
    assert (np.abs(osl[:, 2] - x) < tolerance).all() and (np.abs(osl[:, 3] - y) < tolerance).all()


def test_a_footprint_made_wider_keeps_its_shape_and_what_it_says_of_the_surface():
    rng = np.random.default_rng(13)
    given = Inputs()
    values = given.floats(FOOTPRINT, 10.0 ** rng.uniform(-3, 3, (ROWS, 11)))
    scale, radius, distance = given.floats("float scale, float radius, float metres",
                                           10.0 ** rng.uniform(-2, 2, (ROWS, 3))).T
    body = "float caustic = caustic_scale(f, radius, metres); scale_footprint(scale, f);"
    osl = given.evaluate(("footprint.h",), "Footprint f;", body, ("caustic", *FOOTPRINT.split(",")))
    before = footprint.Footprint(*values.T)
    wider = footprint.scale_footprint(scale, before)
    np.testing.assert_allclose(osl[:, 1:].T, [getattr(wider, name) for name in footprint.FIELDS], rtol=4 * EPSILON)
    expected = footprint.caustic_scale(before.area, radius, distance)
    np.testing.assert_allclose(osl[:, 0], expected, rtol=8 * EPSILON)
    bounded = expected == footprint.CAUSTIC_ANGLE * distance / radius
    assert 0.1 < bounded.mean() < 0.9, "both limits occur"


DRAWS = 12


def test_light_elements_are_drawn_where_the_sum_of_their_odds_passes_a_whole_number():
    rng = np.random.default_rng(14)
    given = Inputs()
    sure = given.floats("float sure", np.where(rng.random(ROWS) < 0.1, 0.0, rng.uniform(0.2, 0.9, ROWS)))
    odds = given.floats("float odds", rng.random(ROWS))
    weights = rng.random((ROWS, DRAWS)) * (rng.random((ROWS, DRAWS)) < 0.9)
    names = [f"weights[{k}]" for k in range(DRAWS)]
    weights = given.floats(", ".join(names), weights)
    body = f"""
      for (int k = 0; k < {DRAWS}; ++k) {{
        float weight = weights[k];
        drawn[k] = is_drawn(sure, odds, weight);
        weights[k] = weight;
      }}
    """
    declarations = f"float weights[{DRAWS}]; int drawn[{DRAWS}];"
    osl = given.evaluate(("footprint.h",), declarations, body, (*names, *(f"drawn[{k}]" for k in range(DRAWS))))
    rows = [footprint.is_drawn(*row) for row in zip(sure, odds, weights, strict=True)]
    drawn, after, clear = (np.array(column) for column in zip(*rows, strict=True))
    assert clear.mean() > 0.98 and 0.3 < drawn.mean() < 0.9
    np.testing.assert_array_equal(osl[clear, DRAWS:] != 0, drawn[clear])
    np.testing.assert_allclose(osl[clear, :DRAWS], after[clear], rtol=EPSILON)
