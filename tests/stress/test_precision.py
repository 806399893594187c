"""Precision: facets of a thousandth of a radian near and far, and the texels at the far end of long maps."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Vector

from benchmarks.query_scene import FOOTPRINT_RADIUS, light_direction, unit_normal
from demo_scenes import maps
from demo_scenes.measure import luminance
from demo_scenes.truth import truth_material
from glint_addon import create_glint_material, prepare_scene
from glint_addon.choice import close_views
from tests.helpers import cycles
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress

pytestmark = stress("sharp facets and long maps against Blender's nodes", fast=[
    "stress/test_one_of_each.py::test_a_case_of_each_group_agrees_with_blenders_nodes",
])

ALPHA = 0.001
SLOPE = 0.03  # standard deviation: at 2 degrees of sun 4 % of the facets shine, so that Blender's nodes converge
SUN = math.radians(2)
SIDE = 16  # pixels
NODES = (1024, 2)  # spp, seeds: a percent of the mean
ENERGY = 0.01  # relative, of the mean, beside its noise
LARGEST_Z = 4.0  # deviations of that noise
# Map (texels a side), how often a view of SIDE pixels holds it, and spp and seeds of the lobe: 7 and 9216 texels a
# pixel. Whole repeats, so that nothing is lost at the picture's edges.
NEAR, FAR = (44, 1, (128, 2)), (512, 3, (8, 2))

SIZES = ((8192, 64), (1000, 300))  # texels (width, height)
MIRRORED = ((SIZES[0], "CLOSEST"), (SIZES[0], "LINEAR"), (SIZES[1], "LINEAR"))
# Of a mirrored direction's components: the place of a hit is known to 2^-24 of the map, at 8192 texels 0.0005 texels,
# times the difference of two texels' normals (up to 0.5) and 2 for the mirror.
LARGEST_LOOKUP_ERROR = 1e-3
HALF_WIDTH = 3.0  # texels, of a footprint
QUERY_ALPHA = 0.05  # a few of the texels in a footprint shine
# Of the brightest facet: what lies outside the region (exp(-2.5^2)) comes from the hit alone, with weight 1 instead of
# each texel's own.
LARGEST_QUERY_ERROR = 0.005


def view(repeats):
    """A `build` of a plane seen straight from above by SIDE pixels, `repeats` of the map across, and a sun."""
    def build(scene, material):
        cycles.add_plane(scene, 3.0 * repeats, material=material, repeats=3.0 * repeats)
        cycles.add_camera(scene, (0.1, 0.2, 5), (0.1, 0.2, 0), width=repeats)
        cycles.add_sun(scene, light_direction((0.01, 0.0)), angle=SUN)
    return build


@pytest.mark.parametrize("distance", [NEAR, FAR], ids=["near", "far"])
@pytest.mark.parametrize("interpolation", ["CLOSEST", "LINEAR"])
def test_facets_of_a_thousandth_of_a_radian(stress_record, interpolation, distance):
    texels, repeats, lobe = distance
    make = {"CLOSEST": lambda: maps.flakes(texels, std=SLOPE, seed=6),
            "LINEAR": lambda: maps.bumps(texels, std=SLOPE, width=4.0, seed=6)}
    outcome = compare(stress_record, view(repeats), normal_map=make[interpolation](), nodes=NODES, lobe=lobe,
                      surface={"roughness": math.sqrt(ALPHA), "interpolation": interpolation}, size=(SIDE, SIDE))
    assert outcome.report["hints"] == ["Sun"]
    noise = abs((outcome.energy - 1.0) / outcome.deviations)
    assert abs(outcome.energy - 1.0) < ENERGY + LARGEST_Z * noise


def long_map(size):
    """Encoded normals (height, width, 3), each texel with slopes of its own."""
    return maps.encoded_normals(np.random.default_rng(9).normal(0.0, 0.1, (size[1], size[0], 2)))


def far_places(size, offset):
    """Texel coordinates (SIDE^2, 2), (column, row): corners of the map, its right edge, anywhere; plus `offset`."""
    width, height = size
    rng = np.random.default_rng(10)
    texels = np.stack([rng.integers(0, width, SIDE**2), rng.integers(0, height, SIDE**2)], axis=-1)
    texels[:4] = (0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)
    texels[4:40, 0] = width - 1 - np.arange(36)
    return texels + offset


def wall(scene, material, size, places, texels):
    """One square for each pixel, around `places`, seen straight from above; `texels`: across a pixel."""
    corner = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    squares = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 1, 2) + corner
    points = np.concatenate([squares, np.zeros((SIDE**2, 4, 1))], axis=-1).reshape(-1, 3)
    uvs = (places[:, None] + (corner - 0.5) * texels) / size
    faces = np.arange(len(points)).reshape(-1, 4).tolist()
    cycles.add_mesh(scene, points, faces, uvs=uvs.reshape(-1, 2), material=material)
    cycles.add_camera(scene, (SIDE / 2, SIDE / 2, 9), (SIDE / 2, SIDE / 2, 0), width=SIDE)
    cycles.box_filter(scene, 0.01)


def add_directions(scene):
    """A world that shines in each direction with that direction's components, as colours around 0.5."""
    scene.world = bpy.data.worlds.new("Directions")
    tree = scene.world.node_tree
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    scaled = tree.nodes.new("ShaderNodeVectorMath")
    scaled.operation = "MULTIPLY_ADD"
    scaled.inputs[1].default_value = scaled.inputs[2].default_value = (0.5, 0.5, 0.5)
    tree.links.new(coordinates.outputs["Generated"], scaled.inputs[0])
    tree.links.new(scaled.outputs["Vector"], tree.nodes["Background"].inputs["Color"])
    scene.world.cycles.sampling_method = "NONE"  # which would look at a million directions before the render


@pytest.mark.parametrize(("size", "interpolation"), MIRRORED, ids=str)
def test_far_texels_mirror_what_blenders_image_texture_shows(size, interpolation, monkeypatch):
    """Mirrors of no roughness; the sun is out of the map's reach, so that each sample shows the texel it hits."""
    monkeypatch.setattr(close_views, "FEWEST_TEXELS", 0.0)
    # Closest in the middle of texels, Linear between them.
    places = far_places(size, (0.5, 0.5) if interpolation == "CLOSEST" else (0.8, 0.3))
    shown = []
    for make in (truth_material, create_glint_material):
        scene = cycles.empty_scene(size=(SIDE, SIDE))
        image = maps.blender_image("Map", long_map(size))
        wall(scene, make("Mirror", image, roughness=0.0, interpolation=interpolation), size, places, texels=0.5)
        add_directions(scene)
        sun = cycles.add_sun(scene, light_direction((0.0, 0.0)), strength=1e-9)
        report = prepare_scene(scene)
        # Out of reach after preparing, or the sun would be no hint.
        sun.rotation_euler = Vector(light_direction((2.0, 0.0))).to_track_quat("Z", "Y").to_euler()
        shown.append(cycles.rendered(scene)[..., :3])
    assert report["hints"] == ["Sun"] and report["baked"] + report["reused"]
    assert shown[0].std(axis=(0, 1)).max() > 0.05, "the picture must show many directions"
    np.testing.assert_allclose(shown[1], shown[0], atol=LARGEST_LOOKUP_ERROR)


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_a_footprint_at_the_far_end_of_a_map_holds_the_texels_around_it(size):
    """Over the seams too; against the sum over the map's own texels."""
    encoded = long_map(size)
    places = far_places(size, (0.3, 0.6))
    half_vector = (0.05, 0.0)
    scene = cycles.empty_scene(size=(SIDE, SIDE))
    material = create_glint_material("Glint", maps.blender_image("Map", encoded), roughness=math.sqrt(QUERY_ALPHA),
                                     interpolation="CLOSEST")
    wall(scene, material, size, places, texels=HALF_WIDTH / FOOTPRINT_RADIUS)
    cycles.add_sun(scene, light_direction(half_vector))
    prepare_scene(scene)
    shown = luminance(cycles.rendered(scene)).ravel()

    # Weights of the texels around each place, and what a facet of each texel's normal mirrors.
    reach = np.arange(-math.ceil(HALF_WIDTH), math.ceil(HALF_WIDTH) + 1)
    columns, rows = np.floor(places).astype(int).T[..., None, None]
    columns, rows = columns + reach[None, None, :], rows + reach[None, :, None]
    square = (columns + 0.5 - places[:, 0, None, None]) ** 2 + (rows + 0.5 - places[:, 1, None, None]) ** 2
    weight = np.maximum(1.0 - square / HALF_WIDTH**2, 0.0) ** 2
    normals = 2.0 * encoded[rows % size[1], columns % size[0]].astype(np.float64) - 1.0
    cosine = normals @ unit_normal(half_vector)
    ndf = np.exp((1.0 - 1.0 / cosine**2) / QUERY_ALPHA**2) / (np.pi * QUERY_ALPHA**2 * cosine**4)
    wanted = (weight * ndf / (4.0 * normals[..., 2])).sum(axis=(1, 2)) / weight.sum(axis=(1, 2))
    np.testing.assert_allclose(shown, wanted, atol=LARGEST_QUERY_ERROR / (4.0 * np.pi * QUERY_ALPHA**2))
