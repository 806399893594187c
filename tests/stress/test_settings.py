"""Stress of render settings: samples, tiles, light tree, clamps, bounces, passes, view layers, threads."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

import glint_addon
from benchmarks.passes import rendered_passes
from demo_scenes.maps import blender_image
from tests.helpers import cycles
from tests.helpers.stress import FLOOR, SURFACE, compare, gentle_bumps
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import add_lamp, add_sky, add_wall, diffuse_material, sunny_square

pytestmark = stress("every setting of Cycles against Blender's nodes", fast=[
    "osl/test_passes.py::test_passes_of_light_and_colour_have_the_means_of_the_nodes",
    "stress/test_one_of_each.py::test_a_case_of_each_group_agrees_with_blenders_nodes",
])

# Two renders of the same samples: threads and tiles may add them in another order.
ROUNDING = 1e-5


def room(scene, material):
    """The sunny square, a diffuse wall that it mirrors and lights, a lamp and a sky."""
    sunny_square(scene, material)
    add_wall(scene, diffuse_material())
    add_lamp(scene, location=(0, -1, 1), shadow_soft_size=0.1)
    add_sky(scene, 0.3)


def lobe_scene(build=sunny_square, *, size=(12, 12), spp=4):
    """The prepared scene of the glint material."""
    scene = cycles.empty_scene(size=size, spp=spp)
    image = blender_image("Map", gentle_bumps())
    build(scene, glint_addon.create_glint_material("Glint", image, **SURFACE))
    glint_addon.prepare_scene(scene)
    return scene


def with_settings(build=room, **settings):
    """A build function: `build`, then Cycles' `settings`."""

    def changed(scene, material):
        build(scene, material)
        for name, value in settings.items():
            setattr(scene.cycles, name, value)

    return changed


@pytest.mark.parametrize("spp", [1, 2, 3, 64, 4096])
def test_samples(stress_record, spp):
    # The footprint shrinks with the samples; few pixels and many seeds for all that takes the same time.
    size, seeds = ((4, 4), 2) if spp > 64 else ((12, 12), max(2, 8 // spp))
    compare(stress_record, sunny_square, nodes=(1024, 2), lobe=(spp, seeds), size=size)


SETTINGS = {
    "adaptive sampling": {"use_adaptive_sampling": True, "adaptive_threshold": 0.01, "adaptive_min_samples": 64},
    "light tree": {"use_light_tree": True},
    "no light sampling threshold": {"light_sampling_threshold": 0.0},
    "no caustics": {"caustics_reflective": False, "caustics_refractive": False},
    "no bounces": {"max_bounces": 0},
    "no glossy bounces": {"glossy_bounces": 0},
    "one bounce": {"max_bounces": 1},
    "filter glossy": {"blur_glossy": 10.0},
    "no filter glossy": {"blur_glossy": 0.0},
    "scrambled less": {"scrambling_distance": 0.1},
    "tiles": {"use_auto_tile": True, "tile_size": 8},
}


@pytest.mark.parametrize("settings", SETTINGS)
def test_cycles_settings(stress_record, settings):
    compare(stress_record, with_settings(**SETTINGS[settings]), nodes=(1024, 2), lobe=(64, 2), note=str(settings))


@pytest.mark.parametrize("method", ["REPLACE", "ADD"])
def test_fast_global_illumination(stress_record, method):
    compare(stress_record, with_settings(use_fast_gi=True, fast_gi_method=method, ao_bounces_render=1), lobe=(64, 2))


@pytest.mark.parametrize("clamp", ["sample_clamp_direct", "sample_clamp_indirect"])
def test_clamped_light_is_no_brighter_than_unclamped(stress_record, clamp):
    """Clamping takes light from noisy samples: less of it from the lobe."""
    outcome = compare(stress_record, with_settings(sunny_square, **{clamp: 1.0}), lobe=(64, 2),
                      finite_only="clamping darkens what is noisy, the nodes more than the lobe")
    unclamped = compare(stress_record, sunny_square, lobe=(64, 2), case="not clamped")
    assert outcome.nodes.mean() <= outcome.lobe.mean() * (1 + FLOOR)
    assert outcome.lobe.mean() <= unclamped.nodes.mean() * (1 + FLOOR)


def test_denoised(stress_record):
    outcome = compare(stress_record, with_settings(sunny_square, use_denoising=True, denoiser="OPENIMAGEDENOISE"),
                      lobe=(64, 2), finite_only="the denoiser takes glints for noise")
    assert outcome.lobe.mean() > 0


def test_no_shader_language(stress_record):
    """Without OSL the material glints by nodes, whose mean is that of the plain ones: stress/test_by_nodes.py."""
    compare(stress_record, room, nodes=(1024, 2), lobe=(64, 4), by_nodes=True)


def same_picture(record, scene, change, note):
    """Assert that change(scene) leaves the picture as it is; returns it."""
    first = cycles.rendered(scene)
    change(scene)
    second = cycles.rendered(scene)
    assert first[..., :3].mean() > 0
    np.testing.assert_allclose(second, first, rtol=ROUNDING, atol=ROUNDING * first.max())
    record(outcome="agrees", lobe=first[..., :3].mean(), note=note)
    return first


def one_thread(scene):
    scene.render.threads = 1


def tiles(scene):
    scene.cycles.use_auto_tile, scene.cycles.tile_size = True, 8


def keep_data(scene):
    """The next two renders share what they loaded."""
    scene.render.use_persistent_data = True
    cycles.rendered(scene)


@pytest.mark.parametrize("change", [one_thread, tiles, keep_data])
def test_same_picture_after(stress_record, change):
    same_picture(stress_record, lobe_scene(room, size=(20, 20)), change, "every pixel is the same")


def test_kept_data_follows_a_light(stress_record):
    """With persistent data a moved light moves its hint."""

    def moved(x):
        bpy.data.objects["Point"].location.x = x
        return cycles.rendered(scene)

    scene = lobe_scene(room)
    fresh = [moved(x) for x in (0.0, 0.6)]
    scene.render.use_persistent_data = True
    kept = [moved(x) for x in (0.0, 0.6)]
    for first, second in zip(fresh, kept, strict=True):
        np.testing.assert_allclose(second, first, rtol=ROUNDING, atol=ROUNDING * first.max())
    assert not np.allclose(fresh[0], fresh[1], rtol=0.01)
    stress_record(outcome="agrees", lobe=fresh[1][..., :3].mean(), note="every pixel is the same")


def test_seeds(stress_record):
    """A seed gives its picture again; another seed another picture of the same light."""
    scene = lobe_scene(spp=64)
    first = same_picture(stress_record, scene, lambda scene: None, "every pixel is the same")
    scene.cycles.seed += 1
    other = cycles.rendered(scene)
    assert not np.array_equal(other, first)
    assert other[..., :3].mean() == pytest.approx(first[..., :3].mean(), rel=5 * FLOOR)


def override_material(scene, material):
    """The layer's material stands in for a diffuse one."""
    sunny_square(scene, diffuse_material())
    scene.view_layers[0].material_override = material


def override_samples(scene, material):
    sunny_square(scene, material)
    scene.view_layers[0].samples = 32


@pytest.mark.parametrize("override", [override_material, override_samples])
def test_view_layer(stress_record, override):
    outcome = compare(stress_record, override, nodes=(1024, 2), lobe=(64, 2))
    assert outcome.report["hints"] == ["Sun"]


def test_passes_add_up_to_the_picture(stress_record):
    """Direct and indirect light times colour, world and emission: the picture, pixel by pixel."""
    scene = lobe_scene(room, spp=32)
    layer = scene.view_layers[0]
    for name in ("diffuse_direct", "diffuse_indirect", "diffuse_color", "glossy_direct", "glossy_indirect",
                 "glossy_color", "environment", "emit", "normal", "z", "mist"):
        setattr(layer, f"use_pass_{name}", True)
    passes = {name: pixels[0, ..., :3] for name, pixels in rendered_passes(scene, spp=32, count=1).items()}
    assert all(np.isfinite(pixels).all() for pixels in passes.values())
    total = passes["Environment"] + passes["Emission"]
    for kind in ("Diffuse", "Glossy"):
        total = total + (passes[f"{kind} Direct"] + passes[f"{kind} Indirect"]) * passes[f"{kind} Color"]
    assert passes["Glossy Direct"].max() > 0
    np.testing.assert_allclose(total, passes["Combined"], rtol=1e-3, atol=1e-3 * passes["Combined"].max())
    stress_record(outcome="agrees", nodes=passes["Combined"].mean(), lobe=total.mean(), note="passes add up")
