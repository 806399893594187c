"""Glints by nodes alone: the mean of Blender's plain nodes, with less noise, wherever the OSL lobe cannot run."""

import hashlib
import math

import bpy
import numpy as np
import pytest

from demo_scenes import maps
from demo_scenes.truth import truth_material
from glint_addon import create_glint_material, prepare_scene
from glint_addon.errors import SceneError
from glint_addon.nodes import glint_bsdf, places, resampled
from glint_addon.nodes.builder import add_node
from glint_addon.nodes.map_choices import FACETS_NODE, IMAGE_NODE, NORMAL_NODE
from tests.helpers import cycles
from tests.helpers.no_osl import take_osl_away
from tests.helpers.old_group import make_old
from tests.helpers.stress_marks import thinned

SIZE = (16, 16)  # pixels
REPEATS = 8.0  # of a map of 64 texels over a square: 32 texels along a pixel's side
WIDE = {"roughness": 0.35}  # of lobes whose plain nodes converge within a test
SHARP = {"roughness": 0.15}
SUN = (0.15, 0.1, 1.0)
# The hidden groups as their version made them: where one changes, raise VERSION in glint_addon/nodes/places.py and put
# the new digest here.
BUILT = (4, "7b49f386d279e59c")


def stage(make_material, *, repeats=REPEATS, width=2.0, light=None, spp=4, **surface):
    """A square of flakes under a light, in the material `make_material(image, **surface)`, rendered without OSL."""
    scene = cycles.empty_scene(size=SIZE, spp=spp, osl=False)
    image = maps.blender_image("Flakes", maps.flakes(64, std=0.15, seed=3))
    surface = {"interpolation": "CLOSEST", **WIDE, **surface}
    cycles.add_plane(scene, material=make_material(image, **surface), repeats=repeats)
    if light is None:
        cycles.add_sun(scene, SUN, angle=0.02, strength=math.pi)
    else:
        light(scene)
    cycles.add_camera(scene, (0, -1, 4), width=width, angle=0.45)
    return scene


def plain(**settings):
    return stage(lambda image, **surface: truth_material("Plain", image, **surface), **settings)


def by_nodes(**settings):
    scene = stage(lambda image, **surface: create_glint_material("Glint", image, **surface), **settings)
    prepare_scene(scene)
    scene.cycles.shading_system = False
    return scene


def picture(scene):
    return cycles.rendered(scene)[..., :3].astype(np.float64)


def variance(scene, seeds=4):
    """Mean over pixels and channels of the variance between seeds, in squares of the mean."""
    pictures = []
    for seed in range(seeds):
        scene.cycles.seed = seed
        pictures.append(picture(scene))
    return float(np.var(pictures, axis=0, ddof=1).mean() / np.mean(pictures) ** 2)


def lamp(scene, kind="POINT", **settings):
    data = bpy.data.lights.new("Lamp", kind)
    data.energy = 200.0
    for name, value in settings.items():
        setattr(data, name, value)
    thing = bpy.data.objects.new("Lamp", data)
    thing.location = (0.6, 0.8, 3.0)
    scene.collection.objects.link(thing)


def several(scene):
    """Five lights, more than the importance knows."""
    for number in range(4):
        cycles.add_sun(scene, (0.3 * math.cos(number), 0.3 * math.sin(number), 1), angle=0.02, strength=1.0 + number)
    lamp(scene, shadow_soft_size=0.05)


def group_of(scene):
    return next(group for group in bpy.data.node_groups if glint_bsdf.is_glint_group(group))


LIGHTS = {
    "sun": None,
    "point": lambda scene: lamp(scene, shadow_soft_size=0.05),
    "area": lambda scene: lamp(scene, "AREA", size=0.2),
    "five": several,
}
CASES = [(light, distribution, interpolation) for light in LIGHTS for distribution in ("BECKMANN", "GGX")
         for interpolation in ("CLOSEST", "LINEAR")]


SURFACES = {
    "METAL": {"color": (0.9, 0.4, 0.1), "edge_tint": (0.2, 0.9, 0.6)},
    "CONDUCTOR": {"ior": (0.18, 0.42, 1.37), "extinction": (3.4, 2.3, 1.8)},
    "DIELECTRIC": {"ior": 1.31, "color": (0.9, 0.4, 0.1)},
}


def low_sun(scene):
    """A sun and a camera at 22 degrees above the square, where Fresnel's reflectance rises steeply."""
    cycles.add_sun(scene, (0.0, 3.0, 1.2), angle=0.05, strength=math.pi)


def look_low(scene):
    scene.camera.location, scene.camera.rotation_euler = (0.0, -4.0, 1.6), (math.atan2(4.0, 1.6), 0.0, 0.0)
    return scene


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("roughness", [0.2, 0.5])
def test_the_mean_of_each_kind_of_surface_is_that_of_its_node_in_each_channel(surface, roughness):
    settings = {"surface": surface, "distribution": "GGX", "light": low_sun, "roughness": roughness,
                **SURFACES[surface]}
    found = picture(look_low(by_nodes(spp=512, **settings))).mean(axis=(0, 1))
    expected = picture(look_low(plain(spp=2048, **settings))).mean(axis=(0, 1))
    assert found == pytest.approx(expected, rel=0.01) and np.ptp(expected) > 0.02 * expected.max()


@pytest.mark.parametrize("surface", SURFACES)
def test_each_kind_of_surface_has_less_noise_than_its_node(surface):
    settings = {"surface": surface, "distribution": "GGX", **SHARP, **SURFACES[surface]}
    assert variance(by_nodes(spp=16, **settings)) < 0.25 * variance(plain(spp=16, **settings))


def flaky(image, **surface):
    """A material of flakes of several colours over a dark base, and its images."""
    rng = np.random.default_rng(5)
    size = image.size[0]
    presence = maps.blender_image("Presence", np.repeat(rng.random((size, size, 1)) < 0.4, 3, axis=2).astype(float))
    color = maps.blender_image("Colors", 0.2 + 0.8 * rng.random((size, size, 3)))
    return create_glint_material("Flakes", image, presence=presence, flake_color=color, base_color=(0.1, 0.05, 0.2),
                                 **surface)


def test_flakes_and_their_base_have_the_mean_of_plain_nodes_with_less_noise():
    def scene_of(places_are_on, spp):
        scene = stage(flaky, spp=spp, **SHARP)
        prepare_scene(scene)
        scene.cycles.shading_system = False
        if not places_are_on:
            group_of(scene).nodes[resampled.WIDE_NODE].outputs[0].default_value = 0.0
        return scene

    found, expected = (picture(scene_of(*way)).mean(axis=(0, 1)) for way in ((True, 2048), (False, 16384)))
    assert found == pytest.approx(expected, rel=0.015)
    assert variance(scene_of(True, 16)) < 0.5 * variance(scene_of(False, 16))


@pytest.mark.parametrize(("light", "distribution", "interpolation"), thinned(
    CASES, kept=[("sun", "BECKMANN", "LINEAR"), ("area", "GGX", "CLOSEST"), ("five", "BECKMANN", "CLOSEST")],
    reason="statistical"))
def test_the_mean_is_that_of_plain_nodes(light, distribution, interpolation):
    settings = {"light": LIGHTS[light], "distribution": distribution, "interpolation": interpolation}
    found = picture(by_nodes(spp=512, **settings)).mean()
    assert found == pytest.approx(picture(plain(spp=4096, **settings)).mean(), rel=0.01)


@pytest.mark.parametrize("settings", [
    {"strength": 0.5}, {"convention": "DIRECTX"}, {"color": (0.9, 0.5, 0.1)}, {"width": None},
], ids=lambda settings: next(iter(settings)))
def test_the_mean_follows_every_setting(settings):
    found = picture(by_nodes(spp=512, **settings)).mean(axis=(0, 1))
    np.testing.assert_allclose(found, picture(plain(spp=4096, **settings)).mean(axis=(0, 1)), rtol=0.01)


@pytest.mark.parametrize("settings", [{}, {"width": None}, {"distribution": "GGX"}, {"light": LIGHTS["point"]},
                                      {"strength": 0.7}, {"convention": "DIRECTX"}],
                         ids=lambda settings: next(iter(settings), "sun"))
def test_the_variance_is_a_tenth_of_that_of_plain_nodes(settings):
    settings = {**SHARP, "spp": 16, **settings}
    assert variance(by_nodes(**settings)) < 0.1 * variance(plain(**settings))


def test_no_light_that_nobody_looks_for_gets_noisier():
    def alone(scene):
        lamp(scene, shadow_soft_size=0.05)

    settings = {**SHARP, "spp": 64, "light": alone}
    scene = by_nodes(**settings)
    cycles.add_sun(scene, (-0.3, -0.2, 1), angle=0.02, strength=20 * math.pi)  # after it was prepared
    other = plain(**settings)
    cycles.add_sun(other, (-0.3, -0.2, 1), angle=0.02, strength=20 * math.pi)
    noise = variance(other)
    scene = by_nodes(**settings)
    cycles.add_sun(scene, (-0.3, -0.2, 1), angle=0.02, strength=20 * math.pi)
    assert variance(scene) < 1.3 * noise


@pytest.mark.parametrize("change", ["close", "unprepared", "no light"])
def test_where_places_are_of_no_use_the_picture_is_that_of_plain_nodes_to_the_bit(change):
    settings = {"close": {"repeats": 0.05}, "no light": {"light": lambda scene: lamp(scene, shadow_soft_size=2.0)}}
    settings = settings.get(change, {})
    scene = (stage(lambda image, **surface: create_glint_material("Glint", image, **surface), **settings)
             if change == "unprepared" else by_nodes(**settings))
    found = picture(scene)
    np.testing.assert_array_equal(found, picture(plain(**settings)))
    assert found.mean() > 0.01


def test_places_are_not_even_compiled_where_no_camera_sees_a_footprint_wider_than_a_texel():
    def wide(scene):
        return group_of(scene).nodes[resampled.WIDE_NODE].outputs[0].default_value

    scene = by_nodes()
    assert wide(scene) == 1.0
    group = group_of(scene)
    scene.camera.data.ortho_scale = 1e-3
    prepare_scene(scene)
    assert wide(scene) == 0.0
    # The number is a factor of the places' weight, which Cycles drops where it is 0.
    factor = group.nodes[resampled.PLACES_MIX].inputs[0].links[0].from_node.inputs[0].links[0].from_node
    assert factor.operation == "MULTIPLY" and factor.inputs[0].links[0].from_node.name == resampled.WIDE_NODE
    bpy.data.scenes.new("Another, which may see more")
    prepare_scene(scene)
    assert wide(scene) == 1.0


@pytest.mark.parametrize("count", [-3, 1, 64, 10_000])
def test_any_number_of_places_fits(count):
    # Cycles' node stack has 255 numbers: 64 places would overflow it if they were worked on side by side.
    scene = by_nodes(spp=256)
    places.count_node(group_of(scene)).integer = count
    assert picture(scene).mean() == pytest.approx(picture(plain(spp=4096)).mean(), rel=0.015)


def test_an_older_group_keeps_its_number_of_places():
    group = group_of(by_nodes())
    places.count_node(group).integer = 24
    group[glint_bsdf.STAMP] = glint_bsdf.VERSION - 1
    glint_bsdf.refresh(group)
    assert places.count_node(group).integer == 24


def test_more_places_have_less_noise():
    scene = by_nodes(**SHARP, spp=16)
    noise = []
    for count in (2, 8, 32):
        places.count_node(group_of(scene)).integer = count
        noise.append(variance(scene))
    assert noise[1] < 0.4 * noise[0] and noise[2] < 0.5 * noise[1]


@pytest.mark.parametrize(("device", "osl", "way"), [("CPU", True, 1.0), ("CPU", False, 0.0), ("GPU", True, 0.0)])
def test_one_way_is_chosen_before_the_render(device, osl, way):
    scene = by_nodes()
    group = group_of(scene)
    scene.cycles.device, scene.cycles.shading_system = device, osl
    scene.view_layers[0].update()
    value = group.evaluated_get(bpy.context.evaluated_depsgraph_get()).nodes[glint_bsdf.WAY_NODE].outputs[0]
    assert value.default_value == way
    # Each way hangs on a product with that number, which Cycles drops where it is 0.
    for mix in (glint_bsdf.MIX_NODE, resampled.PLACES_MIX):
        factor = group.nodes[mix].inputs[0].links[0].from_node
        assert (factor.bl_idname, factor.operation) == ("ShaderNodeMath", "MULTIPLY")


@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_EEVEE"])
def test_blender_without_osl_and_eevee_go_by_nodes_whatever_the_settings_say(engine, monkeypatch):
    if engine == "CYCLES":
        take_osl_away(monkeypatch)
    scene = by_nodes()
    scene.render.engine = engine
    prepare_scene(scene)
    scene.cycles.shading_system = True
    scene.view_layers[0].update()
    group = group_of(scene).evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert group.nodes[glint_bsdf.WAY_NODE].outputs[0].default_value == 0.0


def test_a_group_made_without_osl_has_less_noise_too(monkeypatch):
    take_osl_away(monkeypatch)
    scene = by_nodes(**SHARP, spp=16)
    assert not any(node.bl_idname == "ShaderNodeScript" for node in group_of(scene).nodes)
    assert variance(scene) < 0.1 * variance(plain(**SHARP, spp=16))


@pytest.mark.parametrize("lost", [resampled.KEPT_FACETS, places.FOOTPRINT_NODE, "old"])
def test_preparing_without_osl_makes_a_group_whole_and_brings_it_up_to_date(lost, monkeypatch):
    scene = by_nodes(**SHARP, spp=16)
    group = group_of(scene)
    if lost == "old":
        make_old(group)
    else:
        group.nodes.remove(group.nodes[lost])
    take_osl_away(monkeypatch)
    prepare_scene(scene)
    assert group[glint_bsdf.STAMP] == glint_bsdf.VERSION
    assert variance(scene) < 0.1 * variance(plain(**SHARP, spp=16))


@pytest.mark.parametrize("settings", [{"roughness": 0.0}, {"roughness": 0.01, "strength": 0.0}, {"strength": 10.0}],
                         ids=["mirror", "flat", "steep"])
@pytest.mark.parametrize("light", ["sun", "point of no size"])
def test_extreme_settings_give_no_invalid_pixel(settings, light):
    light = None if light == "sun" else lambda scene: lamp(scene, shadow_soft_size=0.0)
    found = picture(by_nodes(spp=64, light=light, **settings))
    assert np.isfinite(found).all() and found.min() >= 0.0


def test_places_read_the_map_as_the_nodes_that_were_changed_by_hand():
    scene = by_nodes()
    nodes = group_of(scene).nodes
    nodes[IMAGE_NODE].interpolation, nodes[FACETS_NODE].distribution = "Linear", "GGX"
    nodes[NORMAL_NODE].convention = "DIRECTX"
    nodes[NORMAL_NODE].uv_map = "UVMap"
    prepare_scene(scene)
    assert nodes[resampled.PLACES_IMAGE].interpolation == "Linear"
    assert nodes[resampled.KEPT_FACETS].distribution == "GGX"
    for name in (resampled.KEPT_NORMAL, resampled.TANGENT_NODE, resampled.BITANGENT_NODE):
        assert (nodes[name].convention, nodes[name].uv_map) == ("DIRECTX", "UVMap")
    assert {nodes[name].inputs["GGX"].default_value for name in places.IMPORTANCE_NODES} == {1.0}


@pytest.mark.parametrize("texels", [64.0, 16384.0], ids=["within bounds", "far too wide"])
@pytest.mark.parametrize("width", [2.0, None], ids=["orthographic", "perspective"])
def test_the_footprint_is_the_pixel_laid_on_the_surface(scene, width, texels):
    material, colour = cycles.emission_material()
    tree = material.node_tree
    footprint = add_node(tree, "ShaderNodeGroup", node_tree=places.hidden_group(places.FOOTPRINT),
                         inputs={"Size": (texels, texels, 0.0), "Samples": 16.0})
    uv = add_node(tree, "ShaderNodeUVMap")
    tree.links.new(uv.outputs["UV"], footprint.inputs["Coordinates"])
    # The area of the parallelogram of both half axes does not depend on how they are turned.
    area = add_node(tree, "ShaderNodeVectorMath", operation="CROSS_PRODUCT")
    tree.links.new(footprint.outputs["Along"], area.inputs[0])
    tree.links.new(footprint.outputs["Across"], area.inputs[1])
    size = add_node(tree, "ShaderNodeVectorMath", operation="LENGTH")
    tree.links.new(area.outputs["Vector"], size.inputs[0])
    tree.links.new(size.outputs["Value"], colour)
    cycles.set_up_cycles(scene, size=(16, 16), osl=False)
    cycles.box_filter(scene, 0.01)
    cycles.add_plane(scene, 2.0, material=material, repeats=3.0)
    place, angle = np.array([0.0, -3.0, 4.0]), 0.02
    cycles.add_camera(scene, place, width=width, angle=angle)
    distance, cosine = np.linalg.norm(place), place[2] / np.linalg.norm(place)
    pixel = (width if width is not None else 2.0 * math.tan(angle / 2.0) * distance) / 16
    radius = pixel * places.FOOTPRINT_SCALE * 16.0**-places.FOOTPRINT_EXPONENT
    expected = min((radius * 3.0 / 2.0) ** 2 / cosine, (places.WIDEST / texels) ** 2)  # UV 0..3 over 2 m
    assert (expected == (places.WIDEST / texels) ** 2) == (texels > 64)
    found = picture(scene)[6:10, 6:10]
    np.testing.assert_allclose(found, expected, rtol=0.02)


def digest() -> str:
    """Short digest of the sockets, nodes and links of all hidden groups."""
    parts = []
    for name in places.HIDDEN:
        group = places.hidden_group(name)
        parts.append([(item.name, item.in_out, item.socket_type) for item in group.interface.items_tree])
        parts.append(sorted((node.name, node.bl_idname, getattr(node, "operation", "")) for node in group.nodes))
        parts.append(sorted((link.from_node.name, link.from_socket.name, link.to_node.name, link.to_socket.name)
                            for link in group.links))
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def test_other_hidden_groups_are_another_version(scene):
    assert (places.VERSION, digest()) == BUILT


def test_hidden_groups_are_shared():
    scene = by_nodes()
    image = maps.blender_image("Other", maps.flakes(64, std=0.1, seed=4))
    cycles.add_plane(scene, material=create_glint_material("Other", image))
    names = {group.name for group in bpy.data.node_groups if group.name.startswith(".Glint ")}
    assert names == {*places.HIDDEN, f".Glint Lights of {scene.name}"}


def test_a_group_of_the_users_with_that_name_is_left_alone(scene):
    bpy.data.node_groups.new(places.PLACE, "ShaderNodeTree")
    with pytest.raises(SceneError, match="rename it"):
        places.hidden_group(places.PLACE)
