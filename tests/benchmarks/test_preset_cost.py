"""The benchmark of presets renders one scene in three ways, of which only one has glints and only one has none."""

import bpy
import pytest

import glint_addon
from benchmarks import preset_cost
from demo_scenes import measure, preset_stage
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.map_choices import FACETS_NODE

MACHINE = {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "2000"}
SIZE = (24, 24)


def rendered(preset, way, spp):
    scene = preset_stage.build(preset, size=SIZE, spp=spp)
    glint_addon.prepare_scene(scene)
    preset_cost.WAYS[way](scene)
    return measure.rendered(scene)


def test_the_presets_exist_and_each_way_is_timed():
    assert set(preset_cost.PRESETS) <= set(glint_addon.presets())
    found = preset_cost.run(["Scratched Chrome"], size=SIZE, spp=1, repeats=1)
    (row,) = found["rows"]
    assert row["preset"] == "Scratched Chrome" and set(row["seconds"]) == set(preset_cost.WAYS)
    assert min(row["seconds"].values()) > 0 and min(row["start"].values()) > 0


@pytest.mark.parametrize("preset", ["Metallic Red", "Christmas Bauble"])
def test_without_glints_the_picture_is_smooth(preset):
    """Neighbours differ by the base's shading and its noise alone, instead of by single flakes."""
    roughest = {}
    for way in (preset_cost.NODES, preset_cost.NONE):
        pixels = measure.luminance(rendered(preset, way, 64))
        roughest[way] = abs(pixels[1:] - pixels[:-1])
    assert roughest[preset_cost.NONE].mean() < 0.8 * roughest[preset_cost.NODES].mean()


def test_without_a_presence_the_facets_lie_flat():
    scene = preset_stage.build("Scratched Chrome", size=SIZE, spp=1)
    preset_cost.remove_glints(scene)
    (group,) = glint_groups(bpy.data.materials["Scratched Chrome"])
    assert not group.nodes[FACETS_NODE].inputs["Normal"].is_linked
    assert not scene.cycles.shading_system


def test_the_table_has_seconds_starts_and_ratios():
    seconds = {preset_cost.GLINT: 6.0, preset_cost.NODES: 3.0, preset_cost.NONE: 2.0}
    row = {"preset": "Sand", "seconds": seconds, "start": dict.fromkeys(preset_cost.WAYS, 0.5)}
    text = preset_cost.table({"machine": MACHINE, "size": [960, 540], "spp": 16, "rows": [row]})
    assert "| Sand | 6.0 (0.5) | 3.0 (0.5) | 2.0 (0.5) | 3.00 | 1.50 |" in text
    assert "960 x 540" in text and "Abacus" in text
