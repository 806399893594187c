"""The lobe is Blender's own nodes without their noise: same samples where no light is hinted, same mean everywhere."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

from benchmarks.counters import counters
from demo_scenes import maps
from demo_scenes.truth import truth_material
from glint_addon.lights.kinds import KINDS
from glint_addon.materials.create import create_glint_material
from glint_addon.nodes import glint_lights
from glint_addon.nodes.driven import write_number
from glint_addon.nodes.map_choices import DISTRIBUTION, SURFACE
from glint_addon.prepare.scene import prepare_scene
from tests.helpers import cycles
from tests.helpers.seeds import rendered_seeds
from tests.helpers.stress_marks import thinned

SIZE = 24
# Both shaders do the same arithmetic in another order: a few roundings of float32, amplified by the lobe's exponential.
ROUNDING = 2e-4
FURNACE = 0.01
BLOCK = 6  # pixels; blocks are wider than the footprint, so that its blur stays inside
FLOOR = 0.02  # relative: the blur of the footprint across a block's edge
LARGEST_Z = 5.0  # one false alarm in two million blocks
NODES = (256, 4)  # samples, seeds
LOBE = (8, 4)


def stage(*, repeats=2.0, interpolation="LINEAR", size=SIZE):
    """A square under a slanted camera, and its normal map: (scene, object, image)."""
    scene = cycles.empty_scene(size=(size, size))
    pixels = maps.bumps(128, std=0.15, width=3.0, seed=4) if interpolation == "LINEAR" else maps.flakes(128, std=0.2)
    image = maps.blender_image("Map", pixels)
    thing = cycles.add_plane(scene, 4.0, repeats=repeats)
    thing.data.materials.append(None)
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    return scene, thing, image


def sky(scene, radiance=1.0):
    world = bpy.data.worlds.new("Sky")
    scene.world = world
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (radiance, radiance, radiance, 1.0)


def add_light(scene, kind, location, *, target=(0, 0, 0), power=30.0, **settings):
    from mathutils import Vector

    data = bpy.data.lights.new(kind.title(), kind)
    data.energy = power
    for name, value in settings.items():
        setattr(data, name, value)
    lamp = bpy.data.objects.new(kind.title(), data)
    lamp.location = location
    lamp.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(lamp)
    return lamp


def pictures_of(scene, thing, image, *, nodes, lobe, channels=False, **settings):
    """Renders (seeds, rows, columns) with Blender's nodes and with the lobe; nodes, lobe: (spp, seeds) of each.

    channels: whether colours are kept: (seeds, rows, columns, 3).
    """
    thing.material_slots[0].material = truth_material("Truth", image, **settings)
    first = series(scene, *nodes, channels=channels)
    thing.material_slots[0].material = create_glint_material("Glint", image, **settings)
    report = prepare_scene(scene)
    return first, series(scene, *lobe, channels=channels), report


def series(scene, spp, seeds, *, channels=False):
    pictures = rendered_seeds(scene, spp, seeds)[..., :3].astype(np.float64)
    return pictures if channels else pictures.mean(axis=3)


def blocks(pictures):
    """Means over blocks of BLOCK x BLOCK pixels: (seeds, blocks)."""
    seeds, rows, columns = pictures.shape
    tiled = pictures.reshape(seeds, rows // BLOCK, BLOCK, columns // BLOCK, BLOCK)
    return tiled.mean(axis=(2, 4)).reshape(seeds, -1)


def assert_same_mean(nodes, lobe):
    """Z-test of every block's mean over the seeds, with the footprint's blur allowed for."""
    a, b = blocks(nodes), blocks(lobe)
    variance = a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b)
    # Few seeds estimate a block's variance badly; blocks share their scale.
    variance = np.maximum(variance, 0.5 * variance.mean()) + (FLOOR * a.mean(axis=0)) ** 2
    z = (b.mean(axis=0) - a.mean(axis=0)) / np.sqrt(variance)
    assert np.abs(z).max() < LARGEST_Z, f"largest z {np.abs(z).max():.1f}, energy {b.mean() / a.mean():.4f}"
    assert abs(z.mean()) < LARGEST_Z / math.sqrt(len(z)), f"mean z {z.mean():.2f}, energy {b.mean() / a.mean():.4f}"


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("distribution", DISTRIBUTION.identifiers)
def test_where_no_hint_is_reached_the_picture_is_blenders_own_at_the_same_seed(interpolation, distribution):
    scene, thing, image = stage(interpolation=interpolation)
    sky(scene)
    # Behind the plane and so dim that nothing shows: it is asked about everywhere, and answered nowhere.
    add_light(scene, "SUN", (0, 3, -3), power=1e-9, angle=0.01)
    nodes, lobe, report = pictures_of(scene, thing, image, nodes=(8, 1), lobe=(8, 1), roughness=0.2,
                                      interpolation=interpolation, distribution=distribution)
    assert len(report["hints"]) == 1
    np.testing.assert_allclose(lobe, nodes, atol=ROUNDING)


# Settings of each kind of surface that show most of it: colours that differ, and much of Fresnel's rise.
SURFACES = {
    "TINT": {"color": (0.9, 0.4, 0.1)},
    "METAL": {"color": (0.9, 0.4, 0.1), "edge_tint": (0.2, 0.9, 0.6)},
    "CONDUCTOR": {"ior": (0.18, 0.42, 1.37), "extinction": (3.4, 2.3, 1.8)},
    "DIELECTRIC": {"ior": 1.31, "color": (0.9, 0.4, 0.1)},
}


def test_the_surfaces_are_those_that_there_are():
    assert tuple(SURFACES) == SURFACE.identifiers


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("distribution", DISTRIBUTION.identifiers)
def test_without_a_hint_in_reach_every_surface_is_blenders_own_at_the_same_seed(surface, distribution):
    if surface == "DIELECTRIC" and distribution != "GGX":
        return  # Principled BSDF has no other
    scene, thing, image = stage(interpolation="CLOSEST")
    sky(scene)
    add_light(scene, "SUN", (0, 3, -3), power=1e-9, angle=0.01)
    settings = {"roughness": 0.2, "interpolation": "CLOSEST", "surface": surface, "distribution": distribution,
                **SURFACES[surface]}
    nodes, lobe, report = pictures_of(scene, thing, image, nodes=(8, 1), lobe=(8, 1), channels=True, **settings)
    assert len(report["hints"]) == 1 and np.ptp(nodes.mean(axis=(0, 1, 2))) > 0.01
    np.testing.assert_allclose(lobe, nodes, atol=ROUNDING)


def test_without_hints_the_picture_is_blenders_own_to_the_bit():
    scene, thing, image = stage()
    sky(scene)
    nodes, lobe, report = pictures_of(scene, thing, image, nodes=(8, 1), lobe=(8, 1), roughness=0.2)
    assert report["hints"] == []
    np.testing.assert_array_equal(lobe, nodes)


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("roughness", [0.1, 0.4])
def test_white_furnace_with_a_hint_keeps_its_energy(interpolation, roughness):
    scene, thing, image = stage(interpolation=interpolation)
    sky(scene)
    # So dim that it only steers the query.
    add_light(scene, "SUN", (0, 3, 3), power=1e-9, angle=0.01)
    nodes, lobe, report = pictures_of(scene, thing, image, nodes=(64, 1), lobe=(64, 1), roughness=roughness,
                                      interpolation=interpolation)
    assert len(report["hints"]) == 1
    assert not np.array_equal(nodes, lobe), "the hint must reach the lobe"
    assert lobe.mean() == pytest.approx(nodes.mean(), rel=FURNACE)


LIGHTS = {
    "sun": lambda scene: [add_light(scene, "SUN", (0, 3, 3), power=1.0, angle=0.05)],
    "point": lambda scene: [add_light(scene, "POINT", (0.2, 1, 1.2), shadow_soft_size=0.05)],
    "spot": lambda scene: [add_light(scene, "SPOT", (0, 1.2, 1.2), shadow_soft_size=0.05, spot_size=0.5)],
    "square area": lambda scene: [add_light(scene, "AREA", (0, 1.2, 1.2), size=0.2)],
    "disk area": lambda scene: [add_light(scene, "AREA", (0, 1.2, 1.2), shape="DISK", size=0.2)],
    "two close lights": lambda scene: [
        add_light(scene, "SUN", (x, 3, 3), power=1.0, angle=0.05) for x in (0.0, 0.15)
    ],
    "eight lights": lambda scene: [
        add_light(scene, "SUN", (x, 3, z), power=0.5, angle=0.05) for x in (-2, -1, 0, 1) for z in (2, 4)
    ],
    "nine lights and a sky": lambda scene: [
        add_light(scene, "SUN", (x, 3, 3), power=0.5, angle=0.05) for x in range(-4, 5)
    ] + [sky(scene, 0.2)],
}


def test_blenders_kinds_of_light_are_all_among_those(scene):
    added = [LIGHTS[name](scene) for name in LIGHTS]
    assert {lamp.data.type for lamps in added for lamp in lamps if lamp is not None} == set(KINDS)


@pytest.mark.parametrize("light", thinned(LIGHTS, ("sun", "square area"), "a z-test of many renders"))
@pytest.mark.parametrize("distribution", DISTRIBUTION.identifiers)
def test_every_kind_of_light_has_the_right_mean(light, distribution):
    scene, thing, image = stage()
    LIGHTS[light](scene)
    nodes, lobe, report = pictures_of(scene, thing, image, nodes=NODES, lobe=LOBE, roughness=0.25,
                                      distribution=distribution)
    assert report["hints"]
    assert_same_mean(nodes, lobe)


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("surface", [name for name in SURFACES if name != "TINT"])
def test_every_surface_has_the_right_mean_in_each_channel(surface, interpolation):
    scene, thing, image = stage(interpolation=interpolation)
    add_light(scene, "SUN", (0, 3, 0.6), power=1.0, angle=0.05)  # low, where Fresnel's reflectance rises
    nodes, lobe, report = pictures_of(scene, thing, image, nodes=NODES, lobe=LOBE, roughness=0.25, channels=True,
                                      interpolation=interpolation, surface=surface, distribution="GGX",
                                      **SURFACES[surface])
    assert report["hints"]
    for channel in range(3):
        assert_same_mean(nodes[..., channel], lobe[..., channel])


CONES = {
    "area": ("AREA", {"size": 0.2}),
    "disk with spread": ("AREA", {"shape": "DISK", "size": 0.3, "spread": 0.8}),
    "soft spot with blend": ("SPOT", {"spot_size": 0.3, "spot_blend": 1.0, "shadow_soft_size": 0.2}),
    "stretched spot": ("SPOT", {"spot_size": 0.3, "spot_blend": 0.0, "shadow_soft_size": 0.02}),
}


@pytest.mark.parametrize("name", thinned(CONES, ("disk with spread",), "four renders each"))
def test_points_on_which_a_lamp_does_not_shine_lose_nothing_by_not_looking_for_it(name):
    """At the same seeds the picture is that of a lamp which is looked for everywhere. Slow: four renders."""
    kind, settings = CONES[name]
    scene, thing, image = stage()
    lamp = add_light(scene, kind, (0, 1.0, 0.8), target=(0.3, 0.2, 0), **settings)
    if kind == "AREA":
        lamp.rotation_euler = (-0.3, math.pi / 2 - 0.2, 0.0)
        lamp.rotation_euler.y -= 0.7 if "spread" in name else 0.0
    if name.startswith("stretched"):
        lamp.scale = (3.0, 1.0, 1.5)
    thing.material_slots[0].material = material = create_glint_material("Glint", image, roughness=0.25)
    report = prepare_scene(scene)
    assert report["hints"] == [lamp.name]
    picture, asked = series(scene, 16, 1), counters(scene, material).hints.mean()
    write_number(glint_lights.build().nodes["Shape 1"].inputs["Z"], 0.0)
    assert 0.0 < asked < 0.9 * counters(scene, material).hints.mean()
    everywhere = series(scene, 16, 1)
    np.testing.assert_allclose(picture, everywhere, atol=ROUNDING * everywhere.max())
    assert (picture > 0.0).mean() > 0.05


def mirror_uvs(scene, thing):
    layer = thing.data.uv_layers.active
    uvs = np.empty(2 * len(layer.uv), np.float32)
    layer.uv.foreach_get("vector", uvs)
    layer.uv.foreach_set("vector", (uvs.reshape(-1, 2) * (-1, 1)).astype(np.float32).ravel())


def turn_back(scene, thing):
    thing.rotation_euler = (math.pi, 0, 0)


def scale_negative(scene, thing):
    thing.scale = (-1, 1, 1)


def scale_unevenly(scene, thing):
    thing.scale = (1.0, 1.6, 1.0)


def make_orthographic(scene, thing):
    scene.camera.data.type = "ORTHO"
    scene.camera.data.ortho_scale = 1.7


def use_far_uvs(scene, thing):
    layer = thing.data.uv_layers.active
    uvs = np.empty(2 * len(layer.uv), np.float32)
    layer.uv.foreach_get("vector", uvs)
    layer.uv.foreach_set("vector", (uvs + 50.0).astype(np.float32))


def squeeze_uvs(scene, thing):
    """Long thin footprints: many texels along, less than one across."""
    layer = thing.data.uv_layers.active
    uvs = np.empty(2 * len(layer.uv), np.float32)
    layer.uv.foreach_get("vector", uvs)
    layer.uv.foreach_set("vector", (uvs.reshape(-1, 2) * (2, 0.05)).astype(np.float32).ravel())


def go_far(scene, thing):
    """More texels a pixel than a query visits; the view is cut down to the time that takes."""
    scene.render.resolution_x = scene.render.resolution_y = 2 * BLOCK
    layer = thing.data.uv_layers.active
    uvs = np.empty(2 * len(layer.uv), np.float32)
    layer.uv.foreach_get("vector", uvs)
    layer.uv.foreach_set("vector", uvs * 20.0)


def blur_with_motion(scene, thing):
    scene.render.use_motion_blur = True
    thing.keyframe_insert("location", frame=1)
    thing.location = (0.2, 0.0, 0.0)
    thing.keyframe_insert("location", frame=2)


def defocus(scene, thing):
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_distance = 2.0
    scene.camera.data.dof.aperture_fstop = 0.5


GEOMETRIES = [
    mirror_uvs,
    turn_back,
    scale_negative,
    scale_unevenly,
    make_orthographic,
    use_far_uvs,
    squeeze_uvs,
    go_far,
    blur_with_motion,
    defocus,
]
KEPT_GEOMETRIES = (mirror_uvs, squeeze_uvs, go_far)


@pytest.mark.parametrize("change", thinned(GEOMETRIES, KEPT_GEOMETRIES, "a z-test of many renders"))
@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
def test_every_geometry_has_the_right_mean(change, interpolation):
    scene, thing, image = stage(interpolation=interpolation)
    LIGHTS["sun"](scene)
    change(scene, thing)
    nodes, lobe, report = pictures_of(scene, thing, image, nodes=NODES, lobe=LOBE, roughness=0.25,
                                      interpolation=interpolation)
    assert report["hints"]
    assert nodes.mean() > 0
    assert_same_mean(nodes, lobe)


SETTINGS = [{"convention": "DIRECTX"}, {"strength": 0.4}, {"strength": 2.0}, {"color": (0.9, 0.5, 0.1)}]


@pytest.mark.parametrize("settings", thinned(SETTINGS, SETTINGS[:2], "a z-test of many renders"), ids=str)
def test_every_setting_has_the_right_mean(settings):
    scene, thing, image = stage()
    LIGHTS["sun"](scene)
    nodes, lobe, _ = pictures_of(scene, thing, image, nodes=NODES, lobe=LOBE, roughness=0.25, **settings)
    assert_same_mean(nodes, lobe)
