"""Counts, which gate where times only inform: elements visited and closures made by the lobe, by distance and light."""

from __future__ import annotations

import math
import re

import bpy
import numpy as np
import pytest
from mathutils import Vector

from benchmarks.counters import MODES, REASONS, counters, show
from demo_scenes import maps, stage
from glint_addon import paths
from glint_addon.choice import close_views
from glint_addon.choice.ranking import LARGEST_VISIT
from glint_addon.materials.create import create_glint_material
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import glint_lights
from glint_addon.nodes.map_tables import SCRIPT_NODE
from glint_addon.prepare.scene import prepare_scene
from tests.helpers import cycles
from tests.helpers.seeds import rendered_seeds

LARGEST_GROUPS = 16  # of blocks, read for one light where no slope stands out: FAR_GROUPS of osl/counts.h
CORNERS = 8  # along a side of the cells of a light, at most: osl/counts.h has room for 7 x 7 cells
LARGEST_CLOSURES = 25  # the budget of osl/selection.h and the remainder; Cycles keeps 64
MEAN_PICTURES, LARGEST_NOISE = 16, 0.01  # of a mean over pictures, relative
CYCLES_CLOSURES = 64  # of a shading point; further ones are dropped in silence
MODE = {name: number for number, name in MODES.items()}
REASON = {name: number for number, name in REASONS.items()}
PLAIN_FETCHES = 2  # the texel or the interpolated normal, and the one that proves that the table is whole
SEAM_FETCHES = 3  # more, where Linear interpolates over the map's edge: its four corners instead of one
CAUSTIC_AREA = 64  # texels of a footprint after a diffuse bounce: osl/footprint.h
AREA_ROUNDING = 0.05  # texels are counted by their middles
SHADOW_SCALE = 0.05  # counts to transparency: small, so that nothing clips


def build(*, texels, interpolation="LINEAR", suns=1, direction=(0, 1, 1), std=0.15, is_indexed=True, **settings):
    """A prepared scene with about `texels` texels of a map along a pixel: (scene, plane, material)."""
    scene = cycles.empty_scene(size=(16, 16))
    cycles.box_filter(scene)
    pixels = maps.bumps(256, std=std) if interpolation == "LINEAR" else maps.flakes(256, std=std)
    # The view is a square metre, 16 pixels wide; the plane four metres.
    plane = cycles.add_plane(scene, 4.0, repeats=texels * 16 * 4 / 256)
    cycles.add_camera(scene, (0, -3, 3), (0, 0, 0), width=1.0)
    for index in range(suns):
        cycles.add_sun(scene, np.add(direction, (0.1 * index, 0, 0)), angle=0.01)
    image = maps.blender_image("Map", pixels)
    material = create_glint_material("Glint", image, interpolation=interpolation, **settings)
    plane.data.materials.append(material)
    prepare_scene(scene)
    if not is_indexed:
        (group,) = glint_groups(material)
        group.nodes[SCRIPT_NODE].inputs["IndexTable"].default_value = ""
    return scene, plane, material


def counts_of(**settings):
    """Counts of the pixels of such a scene; the material fills the view."""
    scene, _, material = build(**settings)
    seen = counters(scene, material)
    assert seen.seen.all()
    return seen


def assert_plain(seen, reason, fetches):
    """One closure, no query, for this reason."""
    assert (seen.visited == 0).all() and (seen.closures == 1).all() and (seen.mode == MODE["PLAIN"]).all()
    assert (seen.reason == REASON[reason]).all() and seen.share_left_early == 1.0
    assert np.isin(seen.fetches, fetches).all()


# --- what a scene does not need ---


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
def test_without_a_light_there_is_one_closure_and_no_fetch_beyond_those_of_blenders_own_nodes(interpolation):
    assert_plain(counts_of(texels=10, suns=0, interpolation=interpolation), "NO_HINT", [0])


# Half vectors are 40 degrees and more off a map of slopes below 0.1.
OUT_OF_REACH = {"texels": 10, "std": 0.02}
FROM_BEHIND = (0, -1, 0.1)


def test_a_light_that_no_normal_of_the_map_can_mirror_is_no_hint_and_costs_nothing():
    assert_plain(counts_of(**OUT_OF_REACH, direction=FROM_BEHIND), "NO_HINT", [0])


def test_a_light_moved_to_where_no_normal_can_mirror_it_costs_the_fetches_of_a_plain_normal_map():
    scene, _, material = build(**OUT_OF_REACH)
    assert counters(scene, material).visited.max() > 1, "the light was chosen, and its drivers follow it from here"
    bpy.data.objects["Sun"].rotation_euler = Vector(FROM_BEHIND).to_track_quat("Z", "Y").to_euler()
    seen = counters(scene, material)
    assert_plain(seen, "NOT_REACHED", [PLAIN_FETCHES, PLAIN_FETCHES + SEAM_FETCHES])
    # The map repeats every 25 pixels, so a row and a column of the picture may meet its edges.
    assert (seen.fetches == PLAIN_FETCHES).mean() > 0.85


def lamp_over_the_middle(scene, kind, tilt):
    """A lamp 4 m from the middle of the view, as high as the camera and opposite; turned from there by `tilt` [rad]."""
    data = bpy.data.lights.new("Lamp", kind)
    if kind == "AREA":
        data.size = 0.05
    else:
        data.spot_size, data.shadow_soft_size = 0.5, 0.02
    lamp = bpy.data.objects.new("Lamp", data)
    lamp.location, lamp.rotation_euler = (0, 3, 3), (-math.pi / 4 + tilt, 0, 0)
    scene.collection.objects.link(lamp)
    return lamp


@pytest.mark.parametrize(("kind", "away"), [("AREA", 1.75), ("SPOT", 0.6)])
def test_where_a_lamp_does_not_shine_behind_it_or_outside_its_cone_the_map_is_not_queried(kind, away):
    scene, _, material = build(texels=10, suns=0)
    lamp = lamp_over_the_middle(scene, kind, 0.0)
    prepare_scene(scene)
    before = counters(scene, material)
    assert (before.hints == 1).all() and before.visited.max() > 1
    lamp.rotation_euler.x += away
    after = counters(scene, material)
    assert_plain(after, "NOT_REACHED", [PLAIN_FETCHES, PLAIN_FETCHES + SEAM_FETCHES])


def test_at_the_edge_of_a_cone_the_map_is_queried_where_the_light_is():
    scene, _, material = build(texels=10, suns=0)
    lamp_over_the_middle(scene, "SPOT", 0.25)
    prepare_scene(scene)
    asked = counters(scene, material).hints
    assert 0.2 < asked.mean() < 0.8
    # The upper half of the view is further from the camera, and nearer to the lamp.
    assert abs(asked[:8].mean() - asked[8:].mean()) > 0.5


def test_without_strength_the_map_is_not_queried():
    assert_plain(counts_of(texels=10, interpolation="CLOSEST", strength=0.0), "FLAT", [PLAIN_FETCHES])


def test_a_light_that_animation_switched_off_costs_nothing_and_later_ones_stay():
    scene, _, material = build(texels=10, suns=2)
    first = next(lamp for lamp in scene.objects if lamp.name == "Sun").data
    both = counters(scene, material)
    for frame, energy in ((1, 1.0), (2, 0.0)):
        first.energy = energy
        first.keyframe_insert("energy", frame=frame)
    scene.frame_set(2)
    one = counters(scene, material)
    assert both.hints.max() == 2 and one.hints.max() == 1
    bpy.data.objects["Sun.001"].hide_render = True
    assert_plain(counters(scene, material), "NO_HINT", [0])


@pytest.mark.parametrize("ray", ["diffuse", "shadow"])
def test_diffuse_and_shadow_rays_make_one_closure_and_no_query(ray):
    """A white floor below the camera, lit by what the glint plane above it shows of its counters."""
    answers = {}
    for output in ("Counters", "Costs"):
        scene, plane, material = build(texels=10, interpolation="CLOSEST", direction=(0, 0, 1))
        plane.location.z = 1.0
        floor = cycles.add_plane(scene, 1.0, material=stage.diffuse_material("White", (1, 1, 1)))
        cycles.add_camera(scene, (0, -0.5, 0.5), (0, 0, 0), width=0.3)
        (group,) = glint_groups(material)
        if ray == "diffuse":
            bpy.data.lights["Sun"].color = (0, 0, 0)
            show(group, output)
            material.cycles.emission_sampling = "NONE"
        else:
            show(group, output, surface="ShaderNodeBsdfTransparent", scale=SHADOW_SCALE)
            scene.cycles.max_bounces = 0
        scene.cycles.samples = 16
        picture = cycles.rendered(scene)[..., :3].reshape(-1, 3)
        assert floor.visible_get() and picture.max() > 0
        answers[output] = picture

    # Each ray brings the same counts, so pixels differ in brightness alone.
    visited, closures, mode = answers["Counters"].T
    assert not visited.any() and not mode.any() and closures.max() > 0
    fetches, reason, hints = answers["Costs"].T
    assert not hints.any()
    np.testing.assert_allclose(reason, REASON["SECONDARY"] / PLAIN_FETCHES * fetches, rtol=1e-5)


@pytest.mark.parametrize("texels", [10, 100])
def test_after_a_diffuse_bounce_the_same_footprint_is_queried_however_wide_the_pixel_is(texels):
    """The same, lit from below, where Cycles shows caustics unfiltered."""
    scene, plane, material = build(texels=texels, interpolation="CLOSEST", direction=(0, 0, -1))
    plane.location.z = 1.0
    cycles.add_plane(scene, 1.0, material=stage.diffuse_material("White", (1, 1, 1)))
    cycles.add_camera(scene, (0, -0.5, 0.5), (0, 0, 0), width=0.3)
    scene.cycles.blur_glossy, scene.cycles.caustics_reflective = 0.0, True
    assert prepare_scene(scene, bake_unseen=True)["hints"] == ["Sun"], "no camera, but the floor sees its glints"
    bpy.data.lights["Sun"].color = (0, 0, 0)
    (group,) = glint_groups(material)
    show(group, "Counters")
    material.cycles.emission_sampling = "NONE"
    scene.cycles.samples = 16
    visited, closures, mode = cycles.rendered(scene)[..., :3].reshape(-1, 3).T
    # Counts are means over a pixel's rays, some of which miss the plane; all that hit it go the same way.
    hits = mode / MODE["ALL"]
    assert 0.7 < hits.mean() <= 1.0 and (closures >= 0.3 * hits).all()
    assert visited.sum() / hits.sum() == pytest.approx(CAUSTIC_AREA, rel=AREA_ROUNDING)


def test_what_a_mirror_shows_is_queried_as_what_the_camera_sees():
    # From below, where the plane's underside mirrors the view.
    scene, plane, material = build(texels=10, direction=(0, 1, -1))
    plane.location.z = 1.0
    cycles.add_plane(scene, 1.0, material=stage.glossy_material("Mirror", roughness=0.0))
    cycles.add_camera(scene, (0, -0.5, 0.5), (0, 0, 0), width=0.3)
    bpy.data.lights["Sun"].color = (0, 0, 0)
    (group,) = glint_groups(material)
    show(group, "Counters")
    picture = cycles.rendered(scene)[..., :3]
    assert (picture[..., 2] >= MODE["POINTS"]).mean() > 0.9 and (picture[..., 0] > 1).mean() > 0.9


# --- what a query costs ---


def test_a_footprint_within_a_patch_is_one_closure():
    seen = counts_of(texels=0.2)
    assert (seen.visited == 1).all() and (seen.closures == 1).all() and (seen.mode == MODE["SINGLE"]).all()
    assert seen.share_left_early == 1.0 and (seen.reason == REASON["WITHIN_TEXEL"]).all()


def test_a_footprint_within_a_texel_is_one_closure(monkeypatch):
    monkeypatch.setattr(close_views, "FEWEST_TEXELS", 0.0)  # or there would be no light to look for
    assert_plain(counts_of(texels=0.2, interpolation="CLOSEST"), "WITHIN_TEXEL", [PLAIN_FETCHES])


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
def test_without_an_index_every_element_under_the_footprint_is_visited_once(interpolation):
    seen = counts_of(texels=10, interpolation=interpolation, is_indexed=False)
    # An ellipse of 1.1 pixels at one sample, seen at 45 degrees: stretched by sqrt(2), ten texels a pixel.
    area = np.pi * 11.0 * 11.0 * np.sqrt(2.0)
    assert (seen.mode == MODE["ALL"]).all() and seen.share_left_early == 0.0
    assert seen.visited.mean() == pytest.approx(area, rel=0.02)
    assert seen.visited.std() < 0.03 * area
    assert 1 <= seen.closures.max() <= LARGEST_CLOSURES


def test_a_texel_is_fetched_once_and_a_patch_once_or_with_its_corners_where_a_light_reaches_it():
    seen = counts_of(texels=10, interpolation="CLOSEST", is_indexed=False)
    np.testing.assert_array_equal(seen.fetches, PLAIN_FETCHES + seen.visited)
    seen = counts_of(texels=10, is_indexed=False)
    corners = seen.fetches - seen.visited - PLAIN_FETCHES - 4  # the hit's own patch
    assert (corners >= 0).all() and (corners <= 4 * seen.visited + SEAM_FETCHES).all()
    # One patch in three, at least, is told from its bounds alone.
    assert corners.mean() < 4 * seen.visited.mean() * 2 / 3


def test_with_an_index_few_texels_are_visited_and_less_is_fetched():
    seen, plain = (counts_of(texels=10, interpolation="CLOSEST", is_indexed=wanted) for wanted in (True, False))
    assert (seen.mode == MODE["INDEX"]).all() and (plain.mode == MODE["ALL"]).all()
    assert seen.visited.mean() < 0.4 * plain.visited.mean() and seen.fetches.mean() < 0.2 * plain.fetches.mean()


@pytest.mark.parametrize(("interpolation", "texels"), [("CLOSEST", 20), ("LINEAR", 100)])
def test_two_lobes_in_one_material_share_the_closures_that_cycles_keeps(interpolation, texels):
    scene, _, material = build(texels=texels, interpolation=interpolation, suns=2)
    alone = counters(scene, material).closures.max()
    tree = material.node_tree
    (node,) = (node for node in tree.nodes if node.bl_idname == "ShaderNodeGroup")
    second = tree.nodes.new("ShaderNodeGroup")
    second.node_tree = node.node_tree
    mix = tree.nodes.new("ShaderNodeMixShader")
    surface = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial").inputs["Surface"]
    for lobe, socket in ((node, mix.inputs[1]), (second, mix.inputs[2])):
        tree.links.new(lobe.outputs["BSDF"], socket)
    tree.links.new(mix.outputs[0], surface)
    tree.links.new(node.inputs["Vector"].links[0].from_socket, second.inputs["Vector"])
    prepare_scene(scene)
    shared = counters(scene, material).closures.max()
    assert 8 < shared <= alone <= LARGEST_CLOSURES <= CYCLES_CLOSURES / 2


@pytest.mark.parametrize(("interpolation", "texels"), [("LINEAR", 10), ("CLOSEST", 100)])
def test_a_lobe_of_eight_closures_has_the_light_of_one_of_as_many_as_it_takes(interpolation, texels):
    """Where elements answer, and where counts do. Eight are what a GPU has room for."""
    scene, _, material = build(texels=texels, interpolation=interpolation)
    (group,) = glint_groups(material)
    closures = group.nodes[SCRIPT_NODE].inputs["Closures"]
    group.links.remove(closures.links[0])
    means, noises = [], []
    for number in (8, CYCLES_CLOSURES):
        closures.default_value = number
        most = counters(scene, material).closures.max()
        assert most == 8 if number == 8 else most > 16
        seen = rendered_seeds(scene, 4, MEAN_PICTURES)[..., 0].mean(axis=(1, 2))
        means.append(seen.mean())
        noises.append(seen.std(ddof=1) / MEAN_PICTURES**0.5)
    assert means[0] == pytest.approx(means[1], abs=4 * math.hypot(*noises))
    assert math.hypot(*noises) < LARGEST_NOISE * means[1]


def test_more_samples_mean_smaller_footprints():
    scene, _, material = build(texels=10, is_indexed=False)
    seen = [counters(scene, material, samples).visited.mean() for samples in (1, 2, 64)]
    # footprint.h: the radius falls with samples^0.21, the area with its square.
    assert seen[2] / seen[1] == pytest.approx(32 ** -0.42, rel=0.1)
    assert scene.cycles.samples == 1 and counters(scene, material).visited.mean() == seen[0], "the scene is as before"


def test_of_several_samples_each_draws_patches_of_small_weight_and_visits_half_of_all():
    scene, _, material = build(texels=10, is_indexed=False)
    every, drawn = (counters(scene, material, samples).visited.mean() for samples in (1, 2))
    # query.h: of a kernel (1 - t)^2 the part above SURE_WEIGHT, and of the rest its weight over that.
    sure = 0.75
    share = 1 - sure**0.5 + sure**0.5 / 3
    assert drawn / every == pytest.approx(share * 2**-0.42, rel=0.03)


# Each number of lights once: Linear maps and Closest ones read their counts alike.
@pytest.mark.parametrize(("interpolation", "suns"), [("LINEAR", 1), ("CLOSEST", 2), ("LINEAR", 4), ("CLOSEST", 8)])
def test_far_views_read_the_counts_of_a_few_blocks_whatever_the_distance(interpolation, suns):
    near = counts_of(texels=100, interpolation=interpolation, suns=suns)
    far = counts_of(texels=1600, interpolation=interpolation, suns=suns)
    for seen in (near, far):
        assert (seen.mode == MODE["COUNTS"]).all() and seen.share_left_early == 0.0
        assert (seen.visited >= suns).all() and (seen.visited <= LARGEST_GROUPS * suns).all()
        corners = seen.fetches - PLAIN_FETCHES - (interpolation == "LINEAR") * 4  # the hit's own patch
        assert (corners <= CORNERS**2 * seen.visited + SEAM_FETCHES).all()
        assert 8 < seen.closures.max() <= LARGEST_CLOSURES
    assert far.visited.mean() <= near.visited.mean() and far.fetches.mean() <= near.fetches.mean()


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
def test_far_views_without_counts_and_index_visit_and_return_no_more_than_the_bounds(interpolation):
    scene, _, material = build(texels=100, interpolation=interpolation, suns=2, is_indexed=False)
    (group,) = glint_groups(material)
    group.nodes[SCRIPT_NODE].inputs["CountsFirst"].default_value = 0
    seen = counters(scene, material)
    assert (seen.mode == MODE["SUBSET"]).all() and (seen.visited == LARGEST_VISIT).all()
    assert (seen.closures == seen.closures.round()).all()
    assert 8 < seen.closures.max() <= LARGEST_CLOSURES


@pytest.mark.parametrize("texels", [10, 100])
def test_of_ten_lights_alike_a_sample_visits_a_few_elements_and_no_counts(texels):
    scene, _, material = build(texels=texels, interpolation="CLOSEST", suns=8)
    assert (counters(scene, material).mode != MODE["SUBSET"]).all()
    for index in (1, 2):
        cycles.add_sun(scene, (-0.1 * index, 1, 1), angle=0.01)
    assert len(prepare_scene(scene)["hints"]) == 8
    seen = counters(scene, material)
    # About a tenth of the variance is left to chance, some more or less by where the suns stand: 10 / 0.1.
    assert (seen.mode == MODE["SUBSET"]).all() and (seen.visited == seen.visited.flat[0]).all()
    assert 40 < seen.visited.flat[0] < 250


def test_a_far_ball_whose_footprints_turn_more_than_counts_may_is_not_left_to_a_random_subset():
    scene, plane, material = build(texels=100, interpolation="CLOSEST")
    bpy.data.objects.remove(plane)
    stage.add_sphere(scene, material, centre=(0, 0, 0), radius=0.4, repeats=(80.0, 40.0))
    prepare_scene(scene)
    seen = counters(scene, material)
    # A pixel turns the surface by 0.16 and more, a light's region is 0.03 wide: counts may turn by twice as much.
    assert (seen.mode[seen.seen] == MODE["COUNTS"]).mean() > 0.25
    assert (seen.mode[seen.seen] == MODE["SUBSET"]).mean() < 0.1  # it was 0.4
    # Beyond, facets that mirror the light are steeper than the map's, though some of them lie behind the half vector.
    assert (seen.reason[seen.seen] == REASON["NOT_REACHED"]).mean() > 0.55  # it was 0.5


def test_the_shader_and_the_lights_group_agree_on_their_constants():
    """Numbers written in Python and read in OSL."""
    headers = ("light_hint.h", "selection.h", "query.h", "counts_table.h")
    text = "".join(paths.shader_file(name).read_text() for name in headers)
    constants = dict(re.findall(r"^#define (\w+) ([\d.]+)$", text, re.MULTILINE))
    kinds = {"NONE": glint_lights.KIND_NONE, "SUN": glint_lights.KIND_SUN, "LOCAL": glint_lights.KIND_LOCAL}
    assert {name: float(constants[f"HINT_{name}"]) for name in kinds} == kinds
    assert int(constants["HINT_COUNT"]) == glint_lights.HINT_COUNT
    assert glint_lights.CLOSURE_COUNT.expression.startswith(f"{CYCLES_CLOSURES} if ")
    assert int(constants["CLOSURE_BUDGET"]) + 1 == LARGEST_CLOSURES
    assert int(constants["LARGEST_VISIT"]) == LARGEST_VISIT
    assert int(constants["FAR_GROUPS"]) == LARGEST_GROUPS
