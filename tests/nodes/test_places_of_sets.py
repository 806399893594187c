"""Glints of UDIM sets and image sequences, which no table holds: by nodes, with Open Shading Language on or off."""

import math

import bpy
import numpy as np
import pytest

from demo_scenes.truth import truth_material
from glint_addon import create_glint_material, prepare_scene
from glint_addon.images import Frames
from glint_addon.nodes import glint_bsdf, places, resampled
from glint_addon.nodes.map_binding import MapBinding
from glint_addon.nodes.map_choices import IMAGE_NODE
from glint_addon.nodes.map_tables import SCRIPT_NODE, MapTables
from glint_addon.prepare.changes import changes_since_prepared
from glint_addon.prepare.shading_system import ONE_FILE
from tests.helpers import cycles, map_sets
from tests.helpers.extension import write_flake_map
from tests.helpers.map_sets import sequence, udim_set

SIZE = (16, 16)  # pixels
SURFACE = {"interpolation": "CLOSEST", "roughness": 0.35}
# UVs 0..2 for a UDIM set, of whose four tiles one is missing.
KINDS = {"udim": (udim_set, 2.0), "sequence": (sequence, 8.0)}
LAST_FRAME = 5


def stage(kind, folder, make_material, *, is_data=True, **surface):
    scene = cycles.empty_scene(size=SIZE, osl=False)
    open_map, repeats = KINDS[kind]
    image = open_map(folder, is_data=is_data)
    material = make_material("Flakes", image, **SURFACE | surface)
    cycles.add_plane(scene, material=material, repeats=repeats)
    cycles.add_sun(scene, (0.15, 0.1, 1.0), angle=0.02, strength=math.pi)
    cycles.add_camera(scene, (0, -1, 4), width=2.0, angle=0.45)
    scene.frame_end = LAST_FRAME
    return scene


def plain(kind, folder, **surface):
    scene = stage(kind, folder, truth_material, **surface)
    for node in bpy.data.materials["Flakes"].node_tree.nodes:
        if node.bl_idname == "ShaderNodeTexImage" and kind == "sequence":
            Frames(5, frame_offset=2).write_to(node.image_user)
    return scene


def group_of(scene):
    return next(group for group in bpy.data.node_groups if glint_bsdf.is_glint_group(group))


def mean(scene, *, frame=1, spp=512):
    scene.cycles.samples = spp
    scene.frame_set(frame)
    return cycles.rendered(scene)[..., :3].mean()


def noise(scene, seeds=4):
    scene.cycles.samples = 16
    pictures = []
    for seed in range(seeds):
        scene.cycles.seed = seed
        pictures.append(cycles.rendered(scene)[..., :3].astype(np.float64))
    return float(np.var(pictures, axis=0, ddof=1).mean() / np.mean(pictures) ** 2)


@pytest.mark.parametrize("osl", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_the_picture_has_the_mean_of_plain_nodes_and_a_tenth_of_their_variance(kind, tmp_path, osl):
    expected = mean(plain(kind, tmp_path), spp=4096)
    scene = stage(kind, tmp_path, create_glint_material)
    report = prepare_scene(scene)
    assert report["hints"] == ["Sun"] and report["notes"] == [ONE_FILE] and report["counts"]["tables_baked"] == 0
    assert not scene.cycles.shading_system, "switched on for nothing"
    scene.cycles.shading_system = osl
    assert mean(scene) == pytest.approx(expected, rel=0.01)
    sharp = {"roughness": 0.15}
    before = noise(plain(kind, tmp_path, **sharp))
    scene = stage(kind, tmp_path, create_glint_material, **sharp)
    prepare_scene(scene)
    scene.cycles.shading_system = osl
    assert noise(scene) < 0.1 * before


def test_each_frame_shows_its_file(tmp_path):
    scene = plain("sequence", tmp_path)
    expected = [mean(scene, frame=frame, spp=4096) for frame in (1, 4)]
    assert abs(expected[1] / expected[0] - 1) > 0.015
    scene = stage("sequence", tmp_path, create_glint_material)
    prepare_scene(scene)
    assert [mean(scene, frame=frame) for frame in (1, 4)] == pytest.approx(expected, rel=0.01)


def test_frames_set_by_hand_are_asked_for_and_then_followed_and_stay(tmp_path):
    scene = stage("sequence", tmp_path, create_glint_material)
    prepare_scene(scene)
    assert changes_since_prepared(scene) == []
    group = group_of(scene)
    user = group.nodes[IMAGE_NODE].image_user
    assert (user.frame_duration, user.frame_start, user.frame_offset, user.use_auto_refresh) == (5, 1, 2, True)
    user.frame_start, user.use_cyclic = 3, True
    assert any("Frames" in sentence for sentence in changes_since_prepared(scene))
    prepare_scene(scene)
    assert changes_since_prepared(scene) == []
    expected = Frames(5, frame_start=3, frame_offset=2, use_cyclic=True)
    assert Frames.of(group.nodes[resampled.PLACES_IMAGE].image_user) == expected
    group[glint_bsdf.STAMP] = glint_bsdf.VERSION - 1
    glint_bsdf.refresh(group)
    assert {Frames.of(group.nodes[name].image_user) for name in (IMAGE_NODE, resampled.PLACES_IMAGE)} == {expected}


@pytest.mark.parametrize("kind", KINDS)
def test_a_set_shown_as_colour_elsewhere_is_read_as_data(kind, tmp_path):
    expected = mean(plain(kind, tmp_path), spp=4096)
    scene = stage(kind, tmp_path, create_glint_material, is_data=False)
    prepare_scene(scene)
    image = bpy.data.images["Flakes"]
    assert image.colorspace_settings.name == "sRGB" and glint_bsdf.map_of(group_of(scene)) == image
    assert mean(scene) == pytest.approx(expected, rel=0.01)


def test_a_still_map_beside_a_set_keeps_the_lobe(tmp_path):
    scene = stage("udim", tmp_path, create_glint_material)
    still = create_glint_material("Still", write_flake_map(tmp_path / "still.png"))
    cycles.add_plane(scene, material=still).location = (0, 0, 0.5)
    report = prepare_scene(scene)
    assert scene.cycles.shading_system and report["notes"] == [ONE_FILE] and report["counts"]["tables_in_use"] > 0
    ways = {glint_bsdf.map_of(group).name: glint_bsdf.is_way_chosen(group) for group in bpy.data.node_groups
            if glint_bsdf.is_glint_group(group)}
    assert ways == {"Flakes": True, "still.png": False}


def test_a_still_map_that_is_exchanged_for_a_set_forgets_its_table(tmp_path):
    scene = stage("udim", tmp_path, create_glint_material)
    group = glint_bsdf.group_for(MapBinding(bpy.data.images.load(str(write_flake_map(tmp_path / "still.png")))))
    surface = next(node for node in bpy.data.materials["Flakes"].node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    surface.node_tree = group
    prepare_scene(scene)
    group = surface.node_tree
    assert MapTables.of(group).path and not glint_bsdf.is_way_chosen(group)
    group.nodes[IMAGE_NODE].image = bpy.data.images["Flakes"]
    prepare_scene(scene)
    group = surface.node_tree
    assert not MapTables.of(group).path and glint_bsdf.is_way_chosen(group)
    assert group.nodes[SCRIPT_NODE].inputs["Table"].default_value == ""
    group.nodes[IMAGE_NODE].image = bpy.data.images["still.png"]
    prepare_scene(scene)
    assert MapTables.of(surface.node_tree).path and not glint_bsdf.is_way_chosen(surface.node_tree)


def test_a_set_whose_files_are_gone_is_named(tmp_path):
    scene = stage("udim", tmp_path, create_glint_material)
    for number in map_sets.TILES:
        (tmp_path / f"flakes.{number}.png").unlink()
    bpy.data.images["Flakes"].reload()
    assert any("is missing" in sentence for sentence in prepare_scene(scene)["warnings"])


def test_the_footprint_is_in_texels_of_the_largest_tile(tmp_path):
    scene = stage("udim", tmp_path, create_glint_material)
    size = group_of(scene).nodes[places.FOOTPRINT_NODE].inputs["Size"].default_value
    assert tuple(size) == (128.0, 128.0, 0.0)
