"""Render passes of a glint material against those of Blender's own nodes: the same samples or the same means."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from benchmarks.passes import rendered_passes
from demo_scenes import maps
from demo_scenes.truth import truth_material
from glint_addon import create_glint_material, prepare_scene
from tests.helpers import cycles
from tests.helpers.stress_marks import thinned
from tests.helpers.stress_stage import SUN_ANGLE, add_lamp, add_sky, diffuse_material

SIZE = (16, 16)
SPP, SEEDS = 256, 2
ROUGHNESS = 0.25
# The camera's own samples are the same: float32 rounding, and cryptomatte adds shares in the order of the samples.
ROUNDING = 1e-4
LARGEST_Z = 5.0
FLOOR = 0.02  # relative: the blur of the footprint across the edges of square and picture
# What Cycles makes of a closure's normal or width is no mean over samples: it leans to the closures that are there.
# With the share s of the footprint's normals near a light's half vector that one weighs 2 s / (1 + s) instead of s, so
# passes of normals lean by up to 0.17 of the slopes (0.3 at most here); merged closures are wider than a facet, which
# counts as less specular: the worst pixel of the specular albedo is 11 % off. Relative to the pass's largest value.
LEANING = {"Normal": 0.05, "Denoising Normal": 0.15, "Denoising Albedo": 0.08, "Denoising Specular Albedo": 0.15,
           "Denoising Roughness": 0.03, "Denoising Depth": 0.15}

EXACT = ["Depth", "Position", "UV", "Vector", "Object Index", "Material Index", "Mist", "Debug Sample Count",
         "Environment", "Emission", "Diffuse Color", "Transmission Color", "CryptoObject00", "CryptoMaterial00",
         "CryptoAsset00"]
MEANS = ["Combined", "Combined_Suns", "Combined_Lamps", "Combined_Sky", "Glossy Direct", "Glossy Indirect",
         "Glossy Color", "Diffuse Direct", "Diffuse Indirect", "Ambient Occlusion"]
SETTINGS = ("use_pass_", "denoising_store_passes", "pass_debug_sample_count")


def room(material_of):
    """A square of half the picture, a diffuse ball on it that it mirrors, a lit sky behind; three light groups."""
    scene = cycles.empty_scene(size=SIZE)
    bumps = maps.blender_image("Map", maps.bumps(64, std=0.08, width=3.0, seed=4))
    # Of one name, or cryptomattes would differ.
    square = cycles.add_plane(scene, 1.2, material=material_of("Surface", bumps, roughness=ROUGHNESS), repeats=1.2)
    square.pass_index, square.material_slots[0].material.pass_index = 3, 2
    ball = cycles.add_sphere(scene, 0.2, material=diffuse_material(), segments=24, rings=12)
    ball.location = (0.2, 0.2, 0.2)
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.7)
    sun = cycles.add_sun(scene, (0, 1, 1), angle=SUN_ANGLE)
    lamp = add_lamp(scene, location=(-0.3, 1, 1), shadow_soft_size=0.15, power=10.0)
    add_sky(scene, 0.3)
    for name, thing in (("Suns", sun), ("Lamps", lamp), ("Sky", scene.world)):
        scene.view_layers[0].lightgroups.add(name=name)
        thing.lightgroup = name
    return scene, square


def shown_passes(material_of, change):
    """Passes of the room with the material that material_of(name, image, roughness=) makes."""
    scene, square = room(material_of)
    layer = scene.view_layers[0]
    for owner in (layer, layer.cycles):
        for name in dir(owner):
            if name.startswith(SETTINGS):
                setattr(owner, name, True)
    change(scene, square)
    if material_of.func is create_glint_material:
        assert sorted(prepare_scene(scene)["hints"]) == ["Point", "Sun"]
    return rendered_passes(scene, SPP, SEEDS)


def both(change, **surface):
    """Passes by Blender's nodes and by the lobe; surface: further arguments of both materials."""
    return tuple(shown_passes(partial(make, **surface), change) for make in (truth_material, create_glint_material))


def assert_same_mean(nodes, lobe, name):
    """Z-test of the mean of the picture, each channel, with the footprint's blur allowed for."""
    assert np.isfinite(lobe).all()
    a, b = nodes.astype(np.float64), lobe.astype(np.float64)
    variance = sum(x.var(axis=0, ddof=1).mean((0, 1)) / x[..., 0].size for x in (a, b))
    allowed = LARGEST_Z * np.sqrt(variance) + FLOOR * np.abs(a.mean((0, 1, 2)))
    difference = b.mean((0, 1, 2)) - a.mean((0, 1, 2))
    assert (np.abs(difference) <= allowed).all(), f"{name}: {difference}, allowed are {allowed}"


@pytest.fixture(scope="module")
def passes():
    return both(lambda scene, square: None)


def test_every_pass_of_the_nodes_is_there_and_finite(passes):
    nodes, lobe = passes
    assert set(nodes) == set(lobe) >= {*EXACT, *MEANS, *LEANING}
    assert all(np.isfinite(pixels).all() for pixels in lobe.values())


@pytest.mark.parametrize("name", EXACT)
def test_passes_of_what_the_camera_hits_are_those_of_the_nodes(passes, name):
    nodes, lobe = passes
    assert name in {"Emission", "Transmission Color", "Vector", "CryptoAsset00"} or nodes[name].any()
    np.testing.assert_allclose(lobe[name], nodes[name], rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("name", MEANS)
def test_passes_of_light_and_colour_have_the_means_of_the_nodes(passes, name):
    nodes, lobe = passes
    assert nodes[name].mean() > 0
    assert_same_mean(nodes[name], lobe[name], name)


@pytest.mark.parametrize("name", LEANING)
def test_passes_of_normals_and_widths_are_near_those_of_the_nodes(passes, name):
    nodes, lobe = (side[name].mean(axis=0) for side in passes)
    scale = np.abs(nodes).max()
    assert scale > 0
    difference = np.abs(lobe - nodes).max() / scale
    assert difference < LEANING[name], f"{name} differs by {difference:.3f} of its largest value"


def catch_shadows(scene, square):
    square.is_shadow_catcher = True
    scene.render.film_transparent = True


def hold_out(scene, square):
    square.is_holdout = True


def see_through(scene, square):
    """Half transparent, half glints, on a transparent film; a bumped diffuse below them in a Mix Shader."""
    scene.render.film_transparent = True
    tree = square.material_slots[0].material.node_tree
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    surface = output.inputs["Surface"].links[0].from_socket
    for other in ("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent"):
        mix, second = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new(other)
        mix.inputs["Factor"].default_value = 0.4
        if "Normal" in second.inputs:
            bump, noise = tree.nodes.new("ShaderNodeBump"), tree.nodes.new("ShaderNodeTexNoise")
            bump.inputs["Distance"].default_value = 0.1
            tree.links.new(noise.outputs["Factor"], bump.inputs["Height"])
            tree.links.new(bump.outputs["Normal"], second.inputs["Normal"])
        tree.links.new(surface, mix.inputs[1])
        tree.links.new(second.outputs["BSDF"], mix.inputs[2])
        surface = mix.outputs[0]
    tree.links.new(surface, output.inputs["Surface"])


FILMS = [
    (catch_shadows, ["Shadow Catcher", "Combined"]),
    (hold_out, ["Combined", "Glossy Direct"]),
    (see_through, ["Combined", "Glossy Direct", "Diffuse Direct", "Glossy Color", "Diffuse Color"]),
]


@pytest.mark.parametrize(("change", "names"), thinned(FILMS, FILMS[2:], "z-tests of many samples"),
                         ids=[change.__name__ for change, _ in FILMS])
def test_films_have_the_means_of_the_nodes(change, names):
    nodes, lobe = both(change)
    for name in names:
        assert_same_mean(nodes[name], lobe[name], name)
    assert nodes[names[0]].std() > 0
    # What is seen of the camera's rays alone is the same.
    for name in ("Depth", "CryptoObject00", "CryptoMaterial00"):
        np.testing.assert_allclose(lobe[name], nodes[name], rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("surface", [
    {"surface": "METAL", "color": (0.9, 0.5, 0.2), "edge_tint": (0.3, 0.9, 0.6)},
    {"surface": "CONDUCTOR"},
    {"surface": "DIELECTRIC", "ior": 1.5},
], ids=lambda surface: surface["surface"])
def test_every_surface_has_the_passes_of_its_node(surface):
    nodes, lobe = both(lambda scene, square: None, distribution="GGX", **surface)
    for name in EXACT:
        np.testing.assert_allclose(lobe[name], nodes[name], rtol=ROUNDING, atol=ROUNDING)
    for name in MEANS:
        assert_same_mean(nodes[name], lobe[name], name)
