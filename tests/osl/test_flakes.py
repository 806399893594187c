"""Flakes with presence and colour are Blender's own nodes without their noise: near, middle and far."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from benchmarks.counters import counters
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.map_tables import SCRIPT_NODE
from tests.helpers import cycles
from tests.helpers.flakes import Sheet, diffuse, lobe_of, populations, truth_of
from tests.helpers.seeds import rendered_seeds
from tests.osl.test_lobe import ROUNDING, add_light, sky

SIZE = 12
MAP = 128  # texels
# Repeats of the map on the plane: a texel is about a pixel wide, or some hundred texels fill a footprint, or thousands.
REPEATS = {"near": 0.3, "middle": 5.0, "far": 40.0}
MODES = {"near": {3}, "middle": {5, 6}, "far": {5}}  # MODE_... of osl/counters.h: all; counts and index; counts
NODES, LOBE = (2048, 6), (64, 6)  # samples, seeds
NO_TABLE, NOT_REACHED = 2, 8  # LEFT_... of osl/counters.h
ERROR = 0.005  # of the mean
# Red and blue by themselves lose more far away, where the colour of a cell of slopes is that of its middle, on a map so
# small that 8 flakes share a bin: decision 74.
FAR_COLOR_ERROR = 0.01
LARGEST_Z = 4.0
FLAT_NOISE = 0.1  # relative


def stage(tmp_path, repeats):
    """A square under a slanted camera and a small sun that its flakes mirror: (scene, object)."""
    scene = cycles.empty_scene(size=(SIZE, SIZE))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    thing = cycles.add_plane(scene, 4.0, repeats=repeats)
    thing.data.materials.append(None)
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    add_light(scene, "SUN", (0, 3, 3), power=1.0, angle=0.05)
    return scene, thing


def script_inputs(material):
    """The inputs of the Script node of a glint material's one group."""
    (group,) = glint_groups(material)
    return group.nodes[SCRIPT_NODE].inputs


def means(scene, spp, seeds):
    """Mean colour of the picture of each seed: (seeds, 3)."""
    return rendered_seeds(scene, spp, seeds)[..., :3].mean(axis=(1, 2), dtype=np.float64)


def assert_same_mean(nodes, lobe, error=ERROR):
    """The means over seeds and pixels agree within `error` and LARGEST_Z standard errors."""
    deviation = np.sqrt((nodes.var(axis=0, ddof=1) + lobe.var(axis=0, ddof=1)) / len(nodes))
    expected = nodes.mean(axis=0)
    assert (deviation < 0.02 * expected).all(), "the pictures are too noisy to tell"
    difference = np.abs(lobe.mean(axis=0) - expected)
    assert (difference < error * expected + LARGEST_Z * deviation).all(), lobe.mean(axis=0) / expected - 1


CASES = [(view, share, True) for view in REPEATS for share in (0.1, 0.5, 0.9)] + [("far", 0.5, False)]


@pytest.mark.parametrize(("view", "share", "are_colored"), CASES)
def test_flakes_have_the_mean_of_blenders_nodes_at_every_distance(tmp_path, view, share, are_colored):
    scene, thing = stage(tmp_path, REPEATS[view])
    sheet = populations(MAP, share, colored=are_colored)
    thing.material_slots[0].material = truth_of(sheet, roughness=0.25)
    nodes = means(scene, *NODES)
    material = lobe_of(scene, thing, sheet, tmp_path, roughness=0.25)
    modes = set(counters(scene, material).mode.astype(int).flat)
    assert modes <= MODES[view] | {3} and modes & MODES[view]
    assert_same_mean(nodes, means(scene, *LOBE), FAR_COLOR_ERROR if view == "far" else ERROR)


WAYS = {
    "points": (lambda uvs: uvs * [8.0, 0.05], {2}, {}),  # thin footprints
    "subset": (lambda uvs: uvs * 40.0, {4}, {"counts": False}),
    "strength": (lambda uvs: uvs * 5.0, {3, 6}, {"counts": False, "strength": 0.4}),
}


@pytest.mark.parametrize("way", WAYS)
def test_flakes_have_the_mean_of_blenders_nodes_in_every_way_of_reading_the_map(tmp_path, way):
    stretch, modes, settings = WAYS[way]
    scene, thing = stage(tmp_path, 1.0)
    layer = thing.data.uv_layers.active
    uvs = np.empty(2 * len(layer.uv), np.float32)
    layer.uv.foreach_get("vector", uvs)
    layer.uv.foreach_set("vector", stretch(uvs.reshape(-1, 2)).astype(np.float32).ravel())
    sheet = populations(MAP, 0.3)
    strength = settings.get("strength", 1.0)
    thing.material_slots[0].material = truth_of(sheet, roughness=0.3, strength=strength)
    nodes = means(scene, *NODES)
    material = lobe_of(scene, thing, sheet, tmp_path, roughness=0.3, **settings)
    found = set(counters(scene, material).mode.astype(int).flat)
    assert found & modes and found <= modes | {3}
    assert_same_mean(nodes, means(scene, *LOBE), FAR_COLOR_ERROR)


def test_where_no_flake_shows_a_light_the_base_is_as_quiet_as_without_flakes(tmp_path):
    """A sun so dim that nothing of it shows is looked for; no flake mirrors the lamp that shines. Blender's nodes take
    flake or base at random."""
    scene, thing = stage(tmp_path, REPEATS["middle"])
    scene.objects["Sun"].data.energy = 1e-9
    sheet = populations(MAP, 0.5, std=0.05)
    lamp = add_light(scene, "AREA", (2.0, -1.0, 3.0), size=1.5, power=100.0)
    # Else half of the noise is that of directions which are sampled by the surface.
    lamp.data.cycles.use_multiple_importance_sampling = False
    bare = bpy.data.materials.new("Bare")
    tree = bare.node_tree
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(diffuse(tree), output.inputs["Surface"])

    def noise(material):
        thing.material_slots[0].material = material
        pictures = rendered_seeds(scene, 4, 12)[..., :3].astype(np.float64)
        return (pictures.std(axis=0, ddof=1) / pictures.mean(axis=0)).mean()

    plain = noise(bare)
    nodes = noise(truth_of(sheet, roughness=0.1))
    lobe = noise(lobe_of(scene, thing, sheet, tmp_path, roughness=0.1))
    assert plain > 0 and nodes > 2 * plain
    assert lobe == pytest.approx(plain, rel=FLAT_NOISE)


def test_where_no_hint_is_reached_flakes_and_base_have_the_mean_of_blenders_nodes(tmp_path):
    scene, thing = stage(tmp_path, REPEATS["middle"])
    bpy.data.objects.remove(scene.objects["Sun"])
    add_light(scene, "SUN", (0, 3, -3), power=1e-9, angle=0.01)
    sky(scene)
    sheet = populations(MAP, 0.5)
    thing.material_slots[0].material = truth_of(sheet, roughness=0.25)
    nodes = means(scene, 256, 4)
    material = lobe_of(scene, thing, sheet, tmp_path, roughness=0.25)
    assert (counters(scene, material).reason == NOT_REACHED).all()
    assert_same_mean(nodes, means(scene, 256, 4))


def test_a_missing_table_of_flakes_leaves_blenders_nodes(tmp_path):
    scene, thing = stage(tmp_path, REPEATS["middle"])
    sheet = populations(MAP, 0.5)
    material = lobe_of(scene, thing, sheet, tmp_path, roughness=0.25)
    inputs = script_inputs(material)
    assert (counters(scene, material).mode == 6).any()
    for table in (str(tmp_path / "none.exr"), inputs["Table"].default_value):
        inputs["FlakesTable"].default_value = table
        assert (counters(scene, material).reason == NO_TABLE).all()


def test_a_map_that_is_all_flakes_of_colour_1_is_the_map_without_flakes(tmp_path):
    scene, thing = stage(tmp_path, REPEATS["middle"])
    sheet = Sheet(populations(MAP, 1.0).encoded, np.ones((MAP, MAP), bool), None)
    material = lobe_of(scene, thing, sheet, tmp_path, roughness=0.25, counts=False)
    with_flakes = rendered_seeds(scene, 4, 1)
    script_inputs(material)["FlakesTable"].default_value = ""
    np.testing.assert_allclose(with_flakes, rendered_seeds(scene, 4, 1), atol=ROUNDING)
