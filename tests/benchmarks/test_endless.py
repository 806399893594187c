"""The table of endless surfaces: both variations are measured, and it says what the numbers say."""

import pytest

from benchmarks import endless
from glint_addon import prepare_scene
from glint_addon.nodes.map_choices import VARIATION
from tests.benchmarks.test_generate_benchmark import MACHINE


def test_the_variations_of_flakes_are_measured():
    assert set(endless.VARIATIONS) <= set(VARIATION.identifiers)


def test_the_table_has_a_line_for_each_distance_and_each_number_of_repeats():
    costs = [{"distance": name, "spp": spp, "ratio": 1.25} for name in endless.DISTANCES for spp in endless.SPPS]
    each = {"bytes": 2e6, "seconds": 0.5}
    text = endless.table({
        "machine": MACHINE, "costs": costs, "likeness": {"REPEAT": [0.9, 0.7], "SHUFFLE": [0.002, -0.001]},
        "tables": [{"repeats": 1000, "REPEAT": each, "SHUFFLE": each}]})
    assert "| 160 | 1.25 | 1.25 |" in text and "| 1000 | 2.0, 0.50 | 2.0, 0.50 |" in text
    assert "correlation 0.70 to 0.90 with Repeat, -0.001 to +0.002 with Shuffle" in text


@pytest.mark.parametrize("variation", endless.VARIATIONS)
def test_a_sheet_glints_and_its_tables_do_not_grow_with_it(variation):
    few, many = (prepare_scene(endless.dressed(variation, repeats, texels=64))["counts"]["bytes_in_use"]
                 for repeats in (8, 1000))
    assert few == many > 0
    scene = endless.dressed(variation, 8, texels=64, spp=16)
    prepare_scene(scene)
    assert endless.measure.rendered(scene).mean() > 0.0


def test_repeats_are_alike_and_shuffled_tiles_are_not(monkeypatch):
    monkeypatch.setattr(endless, "SIDE", 8)
    repeat, shuffle = (endless.likeness(variation) for variation in endless.VARIATIONS)
    assert repeat[1] > 0.5 and max(map(abs, shuffle)) < 4 / (8 * endless.TILES)
