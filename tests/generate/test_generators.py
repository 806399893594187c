"""What all generators promise: unit normals, a repeat without a seam, the same surface at every resolution and seed."""

from dataclasses import replace

import numpy as np
import pytest

from glint_addon.errors import GenerateError, GlintError
from glint_addon.generate import (
    GENERATORS,
    PRESETS,
    Generator,
    Population,
    encoded,
    normals_of,
    settings_of,
    slopes_of,
)
from glint_addon.generate.microstructure import STEEPEST

# Settings under which a map of few texels shows many individuals, and several texels of each.
SHOWN = {
    "FLAKES": {"extent": 0.002, "coverage": 0.6},
    "SCRATCHES": {"extent": 0.01, "density": 200.0, "width": 0.0002, "depth": 0.00002},
    "BRUSHED": {"extent": 0.01, "length": 0.001, "width": 0.0002},
    "BUMPS": {"extent": 0.01},
    "GRAINS": {"extent": 0.02},
    "SEQUINS": {"spacing": 0.006},
    "DENTS": {},
}
KINDS = list(GENERATORS)
FACETS = {"FLAKES": True, "SCRATCHES": True, "SEQUINS": True, "GRAINS": False, "DENTS": False}  # kind: has gaps


def shown(kind: str, **more) -> Generator:
    return GENERATORS[kind](**{**SHOWN[kind], **more})


@pytest.mark.parametrize("generator", [*map(shown, KINDS), *PRESETS.values()], ids=[*KINDS, *PRESETS])
def test_normals_are_unit_vectors_of_the_upper_hemisphere(generator):
    found = generator.microstructure(64)
    assert found.normals.shape == (64, 64, 3) and found.normals.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=-1), 1, atol=1e-6)  # float32
    assert (found.normals[..., 2] > np.cos(np.radians(85.01))).all()
    assert found.normals[..., :2].std() > 0.003  # it is not flat
    assert found.extent == generator.extent and found.interpolation in ("CLOSEST", "LINEAR")


@pytest.mark.parametrize("kind", KINDS)
def test_presence_and_numbers_are_there_where_the_kind_has_individuals(kind):
    found = shown(kind).microstructure(128)
    assert (found.id is not None) == (kind in FACETS) and (found.presence is not None) == FACETS.get(kind, False)
    if found.id is not None:
        assert found.id.dtype == np.float32 and found.id.shape == (128, 128)
        assert found.id.min() >= 0 and found.id.max() <= 1 and len(np.unique(found.id)) > 10
    if found.presence is not None:
        assert found.presence.dtype == bool and 0.02 < found.presence.mean() < 0.98
        assert (found.id[~found.presence] == 0).all() and (found.normals[~found.presence] == (0, 0, 1)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_gives_the_same_map_again_and_another_seed_another(kind):
    first, again, other = (shown(kind, seed=seed).microstructure(64) for seed in (5, 5, 6))
    assert (first.normals == again.normals).all()
    assert (first.normals != other.normals).any(axis=-1).mean() > 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_a_repeat_has_no_seam(kind):
    slopes = slopes_of(shown(kind).microstructure(256).normals)
    for axis in (0, 1):
        jumps = np.abs(slopes - np.roll(slopes, 1, axis)).mean(axis=(1 - axis, 2))  # of each line to the one before it
        # A line's mean scatters by the individuals in it; a seam would be as a jump between unrelated places.
        assert jumps[0] < jumps[1:].mean() + 5 * jumps[1:].std()
        unrelated = np.abs(slopes - np.roll(slopes, 101, axis)).mean()
        assert jumps[1:].mean() + 5 * jumps[1:].std() < 1.3 * unrelated or kind in ("SCRATCHES", "BRUSHED")


@pytest.mark.parametrize("kind", KINDS)
def test_another_resolution_shows_the_same_surface(kind):
    # Centres of coarse texels lie at corners of fine ones: compare with the mean of the four around them.
    fine = slopes_of(shown(kind).microstructure(512).normals)
    around = (fine[1::4, 1::4] + fine[2::4, 1::4] + fine[1::4, 2::4] + fine[2::4, 2::4]) / 4
    coarse = slopes_of(shown(kind).microstructure(128).normals)
    other = slopes_of(shown(kind, seed=2).microstructure(128).normals)
    assert correlation(around, coarse) > 0.9  # edges of facets and sides of scratches are within a coarse texel
    assert abs(correlation(around, other)) < 0.2


def correlation(a, b) -> float:
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


@pytest.mark.parametrize("kind", ["BUMPS", "BRUSHED", "SCRATCHES", "DENTS"])
def test_slopes_of_heights_sum_to_nothing_over_a_repeat(kind):
    # A periodic height comes back to itself: what remains is the error of sampling it at texels' centres.
    slopes = slopes_of(shown(kind).microstructure(512).normals)
    left = np.abs(slopes[..., 0].mean(axis=1)), np.abs(slopes[..., 1].mean(axis=0))
    bound = 2e-6 if kind in ("BUMPS", "BRUSHED") else 0.05 * slopes.std()
    assert max(values.mean() for values in left) < bound


@pytest.mark.parametrize("resolution", [0, -64, 32, 100, 8192, 64.0])
def test_a_resolution_that_is_no_power_of_two_is_refused(resolution):
    with pytest.raises(GenerateError, match="Bumps cannot have .* texels a side: choose a power of two from 64"):
        shown("BUMPS").microstructure(resolution)


@pytest.mark.parametrize(("kind", "wrong", "words"), [
    ("FLAKES", {"coverage": 1.5}, "Flakes cannot have the Coverage 1.5: choose 0 to 1."),
    ("BUMPS", {"wavelength": float("nan")}, "the Wavelength nan: choose 1e-07 to 10 metres."),
    ("SCRATCHES", {"shape": "ROUND"}, 'the Shape "ROUND": choose STRAIGHT, SWIRLS.'),
    ("SCRATCHES", {"bundle": 1.5}, "the Bundle 1.5: choose a whole number from 1 to 100."),
    ("GRAINS", {"roughness": "0.5"}, "the Roughness 0.5: choose 0 to 1."),
    ("DENTS", {"size": 0.06}, "Dents of Size 0.06 metres do not fit twice into one repeat of 0.1 metres"),
    ("GRAINS", {"size": 1e-5}, "too many in one repeat of 0.02 metres: choose an Extent below 0.01024"),
    ("SCRATCHES", {"density": 1e6, "extent": 0.1}, "100000000 in one repeat of 0.1 metres"),
    ("SEQUINS", {"size": 0.011}, "choose a Spacing of at least half the Size"),
    ("FLAKES", {"populations": ()}, "Flakes cannot have 0 Populations: choose 1 to 8 of them."),
])
def test_settings_that_are_not_allowed_are_refused_in_a_sentence(kind, wrong, words):
    with pytest.raises(GlintError) as caught:
        GENERATORS[kind](**wrong).microstructure(64)
    assert isinstance(caught.value, GenerateError) and words in str(caught.value)


def test_colours_of_a_normal_map_are_half_of_the_normal_and_a_half():
    normals = normals_of(np.array([[[0, 0], [1, 0], [0, -1]]]))
    np.testing.assert_allclose(encoded(normals)[0, 0], (0.5, 0.5, 1.0))
    assert encoded(normals)[0, 1, 0] > 0.8 and encoded(normals)[0, 2, 1] < 0.2
    assert encoded(normals).dtype == np.float32


def test_slopes_beyond_the_steepest_keep_their_direction():
    found = slopes_of(normals_of(np.array([[3.0, 4.0], [300.0, -400.0]])))
    np.testing.assert_allclose(found[0], (3, 4), rtol=1e-6)
    np.testing.assert_allclose(found[1], (0.6 * STEEPEST, -0.8 * STEEPEST), rtol=1e-5)


def test_lengths_scale_with_the_extent():
    small = shown("DENTS")
    large = replace(small, extent=1.0, size=0.05, depth=0.002)
    np.testing.assert_allclose(small.microstructure(64).normals, large.microstructure(64).normals, atol=1e-6)


def anything(owner, rng) -> dict:
    """Settings of a dataclass drawn over their whole ranges, lengths and densities by their logarithm."""
    values = {}
    for name, described in settings_of(owner).items():
        default = getattr(owner(), name)
        if name == "populations":
            values[name] = tuple(Population(**anything(Population, rng)) for _ in range(rng.integers(1, 4)))
        elif described.choices:
            values[name] = str(rng.choice([choice.value for choice in described.choices]))
        elif isinstance(default, int):
            values[name] = int(rng.integers(described.low, described.high + 1))
        elif described.low > 0:
            values[name] = float(np.exp(rng.uniform(np.log(described.low), np.log(described.high))))
        else:
            # Ends of the range as often as what is between.
            values[name] = float(rng.choice([described.low, described.high, rng.uniform(described.low, default)]))
    return values


@pytest.mark.parametrize("kind", KINDS)
def test_all_settings_in_their_ranges_give_a_map_or_a_sentence(kind):
    rng, made = np.random.default_rng(9), 0
    for _ in range({"SCRATCHES": 8, "BRUSHED": 12}.get(kind, 40)):  # those take seconds with their largest settings
        values = anything(GENERATORS[kind], rng)
        # A tenth of all are small enough for a repeat; let the others be so too, every other time.
        if rng.random() < 0.5:
            lengths = [value for name, value in values.items() if name in ("size", "spacing", "width", "wavelength")]
            values["extent"] = min(100.0, max(lengths, default=1e-3) * float(rng.uniform(2, 50)))
        try:
            found = GENERATORS[kind](**values).microstructure(64)
        except GenerateError as error:
            assert str(error).endswith(".") and ": choose" in str(error)
            continue
        made += 1
        np.testing.assert_allclose(np.linalg.norm(found.normals, axis=-1), 1, atol=1e-5)
        assert found.normals[..., 2].min() > 0.08
    assert made > 2
