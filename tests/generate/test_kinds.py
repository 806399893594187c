"""The table of generators, and settings as plain data."""

import json

import numpy as np
import pytest

from glint_addon.errors import GenerateError
from glint_addon.generate import (
    GENERATORS,
    PRESETS,
    Coloring,
    Population,
    Recipe,
    Stop,
    as_data,
    of_data,
    recipe_of_text,
    settings_of,
    srgb,
)
from glint_addon.generate.flakes import Flakes
from glint_addon.generate.settings import Choice

OWNERS = [*GENERATORS.values(), Population, Coloring, Stop]


@pytest.mark.parametrize("generator", [*(cls() for cls in GENERATORS.values()), *PRESETS.values(),
                                       Flakes(populations=(Population(), Population(size=0.001)))])
def test_settings_come_back_from_json(generator):
    assert of_data(json.loads(json.dumps(as_data(generator)))) == generator


@pytest.mark.parametrize("owner", OWNERS)
def test_every_setting_says_what_a_panel_needs(owner):
    for name, described in settings_of(owner).items():
        assert described.label and described.help and not described.help.endswith("."), name
        default = getattr(owner(), name)
        if described.quantity == "COLOR":
            assert all(described.low <= channel <= described.high for channel in default) and len(default) == 3
            continue
        if described.choices:
            assert all(isinstance(choice, Choice) for choice in described.choices)
            assert default in [choice.value for choice in described.choices]
        elif not isinstance(default, tuple):
            assert described.low <= default <= described.high < float("inf"), name


def test_settings_that_are_left_out_have_their_defaults():
    assert of_data({"kind": "FLAKES", "coverage": 0.5}) == Flakes(coverage=0.5)


@pytest.mark.parametrize(("data", "words"), [
    ({"kind": "FOG"}, 'There is no generator "FOG": choose FLAKES, SCRATCHES'),
    ({}, 'There is no generator "None"'),
    ({"kind": "BUMPS", "height": 1}, 'Bumps has no setting "height": choose extent, fine_slope'),
    ({"kind": "FLAKES", "populations": [{"sise": 1}]}, 'Population has no setting "sise"'),
    ({"kind": "BUMPS", "slope": -1}, "the Slope -1"),
])
def test_data_that_is_no_generator_is_refused(data, words):
    with pytest.raises(GenerateError, match=words):
        of_data(data)


def test_a_recipe_comes_back_from_its_text():
    recipe = Recipe(PRESETS["Sugar"], 512, Coloring(mode="RAMP", stops=(Stop(position=0.2), Stop(color=(1, 0, 0)))))
    assert recipe_of_text(recipe.text()) == recipe
    assert recipe_of_text('{"generator": {"kind": "BUMPS"}}') == Recipe(GENERATORS["BUMPS"]())


@pytest.mark.parametrize("text", ["", "[]", '{"generator": 3}', '{"generator": {"kind": "BUMPS"}, "coloring": 1}'])
def test_other_texts_are_no_recipes(text):
    with pytest.raises(GenerateError, match="cannot be read|no generator"):
        recipe_of_text(text)


def test_a_recipe_gives_colours_where_there_are_individuals():
    coloring = Coloring(mode="SPREAD", hue=0.0, saturation=0.0, value=0.0, color=(0.5, 0.25, 0.125))
    surface, colors = Recipe(GENERATORS["DENTS"](), 2048, coloring).made(64)
    assert surface.normals.shape == colors.shape == (64, 64, 3)
    assert colors.reshape(-1, 3).max(axis=0) == pytest.approx((0.5, 0.25, 0.125))
    assert Recipe(GENERATORS["BUMPS"](), 2048, coloring).made(64)[1] is None
    assert Recipe(GENERATORS["DENTS"]()).made(64)[1] is None


@pytest.mark.parametrize(("coloring", "words"), [
    (Coloring(color=(0.1, 2.0, 0.0)), "Colors cannot have the Color 2.0: choose 0 to 1."),
    (Coloring(stops=()), "Colors cannot have 0 Stops: choose 1 to 32 of them."),
])
def test_colours_that_cannot_be_are_refused(coloring, words):
    with pytest.raises(GenerateError, match=words):
        Recipe(coloring=coloring).made(64)


def test_srgb_is_that_of_the_standard():
    np.testing.assert_allclose(srgb(np.array([0.0, 0.002, 0.214041, 1.0])), (0, 0.02584, 0.5, 1.0), atol=1e-5)
