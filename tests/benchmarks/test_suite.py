"""The benchmark's suite: its truths are quiet enough and belong to the scenes as they are, which show what they say."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from benchmarks import scenes, suite, truth
from tests.helpers import cycles
from tests.helpers.stress_marks import stress

TEXELS_FACTOR = 2.5  # "about so many texels a pixel": over the picture it varies with perspective and curvature
MARK = 1234.0  # no light of the suite shines so: tells the surface from floor and sky


@pytest.mark.parametrize("name", suite.NAMES)
def test_every_truth_is_quiet_and_of_the_scene_as_it_is(name):
    stored = truth.stored(name)
    assert stored.noise <= truth.allowed_noise(name)
    assert stored.seeds >= truth.FEWEST_PARTS or truth.is_exact(name)
    assert stored.scene_hash == suite.scene_hash(name), f"Renew the truth: make truth SCENE={name}."


@stress("every scene of the benchmark", fast=[
    "benchmarks/test_suite.py::test_every_truth_is_quiet_and_of_the_scene_as_it_is",
])
@pytest.mark.parametrize("name", suite.NAMES)
def test_a_pixel_holds_as_many_texels_as_the_scene_says(name):
    said = suite.scene_module(name).TEXELS
    assert said / TEXELS_FACTOR < texels_a_pixel(name) < said * TEXELS_FACTOR


def texels_a_pixel(name):
    """Median area in texels between the points that neighbouring pixels see, where they see the map."""
    scene = suite.scene_with(name, lambda image, **surface: uv_material())
    scene.cycles.max_bounces = 0
    cycles.box_filter(scene, 0.01)
    uv = cycles.rendered(scene)[..., :3].astype(np.float64)
    along, up = np.diff(uv, axis=1)[:-1], np.diff(uv, axis=0)[:, :-1]
    area = np.abs(along[..., 0] * up[..., 1] - along[..., 1] * up[..., 0])
    seen = (uv[..., 2] == MARK)[:-1, :-1] & (along[..., 2] == 0) & (up[..., 2] == 0)
    return np.median(area[seen]) * np.prod(bpy.data.images["Normal map"].size)


def uv_material():
    """Shines with the UV coordinates, and MARK as blue."""
    material, color = cycles.emission_material()
    nodes, links = material.node_tree.nodes, material.node_tree.links
    parts, whole = nodes.new("ShaderNodeSeparateXYZ"), nodes.new("ShaderNodeCombineXYZ")
    links.new(nodes.new("ShaderNodeUVMap").outputs["UV"], parts.inputs["Vector"])
    links.new(parts.outputs["X"], whole.inputs["X"])
    links.new(parts.outputs["Y"], whole.inputs["Y"])
    whole.inputs["Z"].default_value = MARK
    links.new(whole.outputs["Vector"], color)
    return material


def test_every_module_of_a_scene_is_in_the_suite():
    files = Path(scenes.__file__).parent.glob("*.py")
    assert {file.stem for file in files} - {"__init__"} == set(suite.NAMES)


def test_each_effect_is_alone_somewhere_and_with_others_somewhere():
    """The suite's plan: maps, distances, lights, sharpness."""
    modules = [suite.scene_module(name) for name in suite.NAMES]
    alphas = {round(module.SURFACE["roughness"] ** 2, 4) for module in modules}
    assert alphas == {0.0025, 0.003, 0.005, 0.01, 0.03}
    assert min(module.TEXELS for module in modules) < 1 and max(module.TEXELS for module in modules) >= 1e5
    assert {module.SURFACE["interpolation"] for module in modules} == {"CLOSEST", "LINEAR"}
    assert {module.SMALL_LIGHTS for module in modules} == {True, False}
