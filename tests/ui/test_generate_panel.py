"""The panel Generate: it shows the settings that have an effect, and what stands in the way."""

import bpy
import pytest

from glint_addon.generate import GENERATORS
from glint_addon.ui.generate_panel import GLINT_PT_generate
from tests.helpers.panel import words_of

pytestmark = pytest.mark.usefixtures("registered", "scene")


def generated(**settings):
    bpy.ops.glint.generate_map(**{"kind": "BUMPS", "resolution": "64", **settings})
    return bpy.context.scene.glint.normal_map


def test_without_a_map_the_panel_offers_to_make_one():
    assert words_of(GLINT_PT_generate) == ["[New Map: kind]"]


@pytest.mark.parametrize("kind", GENERATORS)
def test_the_settings_of_the_map_are_shown(kind):
    generated(kind=kind)
    seen = words_of(GLINT_PT_generate)
    assert seen[1:4] == [GENERATORS[kind].label, "[Kind]", "[Resolution]"]
    assert {"[Seed]", "[Extent]", "[Colors]"} <= set(seen)
    assert "[Hue Spread]" not in seen and "[Remove 1]" not in seen


def test_settings_without_effect_are_not_shown():
    image = generated(kind="SEQUINS")
    assert "[Roughness]" in words_of(GLINT_PT_generate) and "[Tail]" not in words_of(GLINT_PT_generate)
    image.glint.sequins.distribution = "CONE"
    assert "[Roughness]" not in words_of(GLINT_PT_generate) and "[Tail]" in words_of(GLINT_PT_generate)
    image.glint.coloring.mode = "SPREAD"
    assert "[Hue Spread]" in words_of(GLINT_PT_generate) and "[Add to Stops]" not in words_of(GLINT_PT_generate)
    image.glint.coloring.mode = "RAMP"
    assert "[Hue Spread]" not in words_of(GLINT_PT_generate) and "[Position]" in words_of(GLINT_PT_generate)


def test_each_population_has_a_box():
    generated(kind="FLAKES", settings='{"populations": [{}, {"distribution": "GGX"}]}')
    seen = words_of(GLINT_PT_generate)
    assert seen.count("[Size]") == 2 and {"[Remove 1]", "[Remove 2]", "[Add to Populations]"} <= set(seen)


def test_what_stands_in_the_way_is_said_with_a_button():
    image = generated()
    image.pixels[0] = 0.0
    image.update()
    image.glint.bumps.slope = 0.3
    seen = words_of(GLINT_PT_generate, width=2000)
    assert any("was edited after it was generated" in words for words in seen) and "[Overwrite Edits]" in seen
    bpy.ops.glint.regenerate_map(overwrite=True)
    image.glint.bumps.wavelength = 0.5
    seen = words_of(GLINT_PT_generate, width=2000)
    assert any("do not fit twice into" in words for words in seen) and "[Overwrite Edits]" not in seen
