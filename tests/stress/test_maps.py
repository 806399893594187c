"""Stress of maps: sizes, values and settings at their ends, each against Blender's own nodes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from demo_scenes import maps
from glint_addon.errors import MapError
from glint_addon.materials.create import create_glint_material
from tests.helpers import cycles
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress

pytestmark = stress("every map against Blender's nodes", fast=[
    "osl/test_lobe.py::test_every_setting_has_the_right_mean",
    "materials/test_material.py::test_a_single_pixel_is_refused",
    "materials/test_material.py::test_pixels_that_are_no_numbers_are_refused",
])

SUN = math.radians(4)  # so large that Blender's nodes find it
WAYS = ("LINEAR", "CLOSEST")


def stage(scene, material, *, repeats=4.0, sun=SUN):
    """A square under a slanted camera, which sees about a metre and a half of its four, and a sun."""
    square = cycles.add_plane(scene, 4.0, material=material, repeats=repeats)
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    cycles.add_sun(scene, (0, 1, 1), angle=sun)
    return square


def spread(repeats):
    """A `build` whose map lies `repeats` times on the square."""
    return lambda scene, material: stage(scene, material, repeats=repeats)


def slopes(height, width, std=0.08, seed=3):
    """Encoded normals (height, width, 3), each texel with slopes of its own."""
    return maps.encoded_normals(np.random.default_rng(seed).normal(0.0, std, (height, width, 2)))


def slope_map(*slopes_of_texels):
    """Encoded normals of one row with these slopes."""
    return maps.encoded_normals(np.array([slopes_of_texels], float))


def refusal(record, pixels) -> str:
    """The sentence with which `create_glint_material` refuses a map of these encoded pixels, which is recorded."""
    cycles.empty_scene()
    with pytest.raises(MapError) as error:
        create_glint_material("Glint", maps.blender_image("Map", np.asarray(pixels, np.float32)))
    record(outcome=f"refused: {error.value}")
    return str(error.value)


# (height, width), and repeats on the square so that a pixel has some texels.
SIZES = {(1, 2): 13, (1, 16): 4, (16, 1): 4, (2, 3): 30, (3, 2): 30, (5, 7): 12, (4, 8192): 0.5, (8192, 4): 0.5}


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[1]} x {size[0]}")
@pytest.mark.parametrize("interpolation", WAYS)
def test_size(stress_record, size, interpolation):
    surface = {"roughness": 0.25, "interpolation": interpolation}
    outcome = compare(stress_record, spread(SIZES[size]), normal_map=slopes(*size), surface=surface)
    assert outcome.report["hints"] == ["Sun"]


def test_single_pixel(stress_record):
    assert "single pixel" in refusal(stress_record, slopes(1, 1))


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, -0.05), (-0.6, 0.0)], ids=str)
@pytest.mark.parametrize("interpolation", WAYS)
def test_constant(stress_record, slope, interpolation):
    # All facets mirror the same point of the sky; wide enough that it is near the sun, or dark as it should be.
    normal_map = maps.encoded_normals(np.broadcast_to(np.array(slope, float), (4, 4, 2)))
    compare(stress_record, stage, normal_map=normal_map, surface={"roughness": 0.35, "interpolation": interpolation},
            lit=slope[0] > -0.5)


@pytest.mark.parametrize("largest", [1, 5, 20])
@pytest.mark.parametrize("interpolation", WAYS)
def test_steep_slopes(stress_record, largest, interpolation):
    # Up to 87 degrees; few of them can send light, and neighbours are whole hemispheres apart.
    steep = np.random.default_rng(5).uniform(-largest, largest, (32, 32, 2))
    steep[::2] *= 0.05
    compare(stress_record, stage, normal_map=maps.encoded_normals(steep), nodes=(2048, 2), lobe=(64, 2),
            surface={"roughness": 0.25, "interpolation": interpolation})


@pytest.mark.parametrize("length", [0.1, 0.5, 1.7])
def test_normals_not_of_unit_length(stress_record, length):
    # Interpolated and filtered maps are; the Normal Map node normalises.
    normals = (slopes(32, 32, std=0.15) - 0.5) * length + 0.5
    compare(stress_record, stage, normal_map=normals, surface={"roughness": 0.2}, nodes=(2048, 2))


@pytest.mark.parametrize("interpolation", WAYS)
def test_normals_below_the_horizon(stress_record, interpolation):
    normals = np.random.default_rng(6).uniform(0, 1, (16, 16, 3)).astype(np.float32)
    compare(stress_record, stage, normal_map=normals, nodes=(2048, 2), lobe=(64, 2),
            surface={"roughness": 0.3, "interpolation": interpolation})


def test_opposite_neighbours_whose_interpolation_passes_through_zero(stress_record):
    normals = np.full((8, 8, 3), 0.5, np.float32)
    normals[::2, ::2], normals[1::2, ::2] = (1, 0.5, 0.6), (0, 0.5, 0.4)
    normals[:, 1::2] = (0.5, 0.55, 1)
    compare(stress_record, stage, normal_map=normals, nodes=(2048, 2), lobe=(64, 2), surface={"roughness": 0.3})


def test_zero_normals(stress_record):
    normals = slopes(8, 8)
    normals[2, 3:5] = 0.5
    assert "has 2 pixels of value (0.5, 0.5, 0.5)" in refusal(stress_record, normals)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e30])
def test_pixels_that_are_no_colours(stress_record, value):
    normals = slopes(8, 8)
    normals[2, 3, 1] = value
    assert "has 1 pixels that are NaN, infinite or huge" in refusal(stress_record, normals)


@pytest.mark.parametrize("interpolation", WAYS)
def test_facets_sharper_than_their_differences(stress_record, interpolation):
    # Neighbouring texels differ by 28 alpha: a patch is cut into the most parts there are.
    compare(stress_record, spread(8.0), normal_map=maps.flakes(64, std=0.2), nodes=(2048, 2), lobe=(32, 2),
            surface={"roughness": 0.1, "interpolation": interpolation})


@pytest.mark.parametrize("strength", [0.0, 0.3, 3.0, 10.0])
@pytest.mark.parametrize("interpolation", WAYS)
def test_strength(stress_record, strength, interpolation):
    surface = {"roughness": 0.3, "strength": strength, "interpolation": interpolation}
    compare(stress_record, stage, surface=surface, nodes=(1024, 2))


@pytest.mark.parametrize("strength", [0.2, 0.6])
def test_strength_of_a_tilted_map_keeps_its_hints(stress_record, strength):
    # All slopes on one side, where a weak strength scales them by less than itself: n.z grows too.
    tilted = np.random.default_rng(7).normal(0.0, 0.03, (64, 64, 2)) + (0.0, 1.0)
    normal_map = maps.encoded_normals(tilted)
    outcome = compare(stress_record, stage, normal_map=normal_map, surface={"roughness": 0.3, "strength": strength})
    assert outcome.report["hints"] == ["Sun"]


def test_negative_strength(stress_record):
    """Refused by the function; a linked value below 0 is 0, as for Blender's nodes without OSL."""
    cycles.empty_scene()
    image = maps.blender_image("Map", slopes(8, 8))
    with pytest.raises(MapError, match="Strength -1.0 of glint material Glint is out of range"):
        create_glint_material("Glint", image, strength=-1.0)

    def build(scene, material):
        stage(scene, material)
        tree = material.node_tree
        value = tree.nodes.new("ShaderNodeValue")
        value.outputs[0].default_value = -1.0
        (node,) = (node for node in tree.nodes if "Strength" in node.inputs)
        tree.links.new(value.outputs[0], node.inputs["Strength"])

    compare(stress_record, build, surface={"roughness": 0.3})


@pytest.mark.parametrize("convention", ["OPENGL", "DIRECTX"])
def test_convention(stress_record, convention):
    # Facets that lean towards the camera are dark with one convention, those that lean away with the other.
    leaning = np.random.default_rng(8).normal(0.0, 0.05, (64, 64, 2)) + (0.0, 0.15)
    compare(stress_record, stage, normal_map=maps.encoded_normals(leaning),
            surface={"roughness": 0.3, "convention": convention})
