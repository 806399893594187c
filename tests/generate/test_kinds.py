"""The table of generators, and settings as plain data."""

import json

import pytest

from glint_addon.errors import GenerateError
from glint_addon.generate import GENERATORS, PRESETS, Population, as_data, of_data, settings_of
from glint_addon.generate.flakes import Flakes
from glint_addon.generate.settings import Choice

OWNERS = [*GENERATORS.values(), Population]


@pytest.mark.parametrize("generator", [*(cls() for cls in GENERATORS.values()), *PRESETS.values(),
                                       Flakes(populations=(Population(), Population(size=0.001)))])
def test_settings_come_back_from_json(generator):
    assert of_data(json.loads(json.dumps(as_data(generator)))) == generator


@pytest.mark.parametrize("owner", OWNERS)
def test_every_setting_says_what_a_panel_needs(owner):
    for name, described in settings_of(owner).items():
        assert described.label and described.help and not described.help.endswith("."), name
        default = getattr(owner(), name)
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
