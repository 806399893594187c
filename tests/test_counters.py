"""Counts, which gate where times only inform: elements visited and closures made by the lobe, by distance and light."""

from __future__ import annotations

import re

import numpy as np
import pytest

from demo_scenes import maps
from glint_addon import paths
from glint_addon.material import create_glint_material, glint_groups
from glint_addon.nodes import glint_lights
from glint_addon.nodes.glint_bsdf import SCRIPT_NODE
from glint_addon.prepare import prepare_scene

from .helpers import cycles

LARGEST_VISIT = 4096  # osl/query.h
LARGEST_CLOSURES = 61  # the budget of osl/selection.h and the remainder; Cycles keeps 64
MODE_PLAIN, MODE_SINGLE, MODE_POINTS, MODE_ALL, MODE_SUBSET = range(5)


def counters(*, texels, interpolation="LINEAR", suns=1, direction=(0, 1, 1), std=0.15, connect=True):
    """(visited, closures, mode) of each pixel, (16 * 16, 3), over a map with about `texels` texels along a pixel."""
    scene = cycles.empty_scene(size=(16, 16))
    cycles.box_filter(scene)
    pixels = maps.bumps(256, std=std) if interpolation == "LINEAR" else maps.flakes(256, std=std)
    # The view is a square metre, 16 pixels wide; the plane four metres.
    plane = cycles.add_plane(scene, 4.0, repeats=texels * 16 * 4 / 256)
    cycles.add_camera(scene, (0, -3, 3), (0, 0, 0), width=1.0)
    for index in range(suns):
        cycles.add_sun(scene, np.add(direction, (0.1 * index, 0, 0)), angle=0.01)
    material = create_glint_material("Glint", maps.blender_image("Map", pixels), interpolation=interpolation)
    plane.data.materials.append(material)
    prepare_scene(scene)
    show_counters(glint_groups(material)[0])
    return cycles.rendered(scene)[..., :3].reshape(-1, 3)


def show_counters(group):
    """Let the group shine with its shader's counters."""
    emission = group.nodes.new("ShaderNodeEmission")
    output = next(node for node in group.nodes if node.bl_idname == "NodeGroupOutput")
    group.links.new(group.nodes[SCRIPT_NODE].outputs["Counters"], emission.inputs["Color"])
    group.links.new(emission.outputs["Emission"], output.inputs["BSDF"])


def test_without_a_light_there_is_one_closure_and_no_query():
    assert (counters(texels=10, suns=0) == (0, 1, MODE_PLAIN)).all()


def test_a_light_that_no_normal_of_the_map_can_mirror_costs_no_query():
    # Half vectors 40 degrees and more off a map of slopes below 0.1.
    assert (counters(texels=10, std=0.02, direction=(0, -1, 0.1)) == (0, 1, MODE_PLAIN)).all()


@pytest.mark.parametrize(("interpolation", "visited", "mode"), [("LINEAR", 1, MODE_SINGLE), ("CLOSEST", 0, MODE_PLAIN)])
def test_a_footprint_within_a_texel_is_one_closure(interpolation, visited, mode):
    assert (counters(texels=0.2, interpolation=interpolation) == (visited, 1, mode)).all()


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
def test_every_element_under_the_footprint_is_visited_once(interpolation):
    seen = counters(texels=10, interpolation=interpolation)
    # An ellipse of 1.1 pixels at one sample, seen at 45 degrees: stretched by sqrt(2), ten texels a pixel.
    area = np.pi * 11.0 * 11.0 * np.sqrt(2.0)
    assert (seen[:, 2] == MODE_ALL).all()
    assert seen[:, 0].mean() == pytest.approx(area, rel=0.02)
    assert seen[:, 0].std() < 0.03 * area
    assert 1 <= seen[:, 1].max() <= LARGEST_CLOSURES


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("suns", [1, 2, 4, 8])
def test_far_views_visit_and_return_no_more_than_the_bounds(interpolation, suns):
    seen = counters(texels=100, interpolation=interpolation, suns=suns)
    assert (seen == seen.round()).all()
    assert (seen[:, 2] == MODE_SUBSET).all()
    assert (seen[:, 0] == LARGEST_VISIT).all()
    assert 8 < seen[:, 1].max() <= LARGEST_CLOSURES


def test_the_shader_and_the_lights_group_agree_on_their_constants():
    """Numbers written in Python and read in OSL."""
    text = "".join(paths.shader_file(name).read_text() for name in ("light_hint.h", "selection.h", "query.h"))
    constants = dict(re.findall(r"^#define (\w+) ([\d.]+)$", text, re.MULTILINE))
    kinds = {"NONE": glint_lights.KIND_NONE, "SUN": glint_lights.KIND_SUN, "LOCAL": glint_lights.KIND_LOCAL}
    assert {name: float(constants[f"HINT_{name}"]) for name in kinds} == kinds
    assert int(constants["HINT_COUNT"]) == glint_lights.HINT_COUNT
    assert glint_lights.CLOSURE_COUNT.expression.startswith(f"{constants['CLOSURE_BUDGET']} if ")
    assert int(constants["CLOSURE_BUDGET"]) + 1 == LARGEST_CLOSURES
    assert int(constants["LARGEST_VISIT"]) == LARGEST_VISIT
