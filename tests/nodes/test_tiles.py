"""Shuffle: each repeat is another cut of the map, in Blender's own nodes, in the lobe and by places; the truth is the
same arrangement written out as one large image."""

from functools import partial

import bpy
import numpy as np
import pytest

from benchmarks.counters import MODES, counters
from demo_scenes import maps
from demo_scenes.truth import truth_material
from glint_addon import create_glint_material, prepare_scene
from glint_addon.errors import MapError
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.glint_bsdf import follow_footprints, group_binding, refresh
from glint_addon.nodes.map_choices import SHUFFLE_NODE
from glint_addon.nodes.map_tables import SCRIPT_NODE
from glint_addon.nodes.resampled import WIDE_NODE
from glint_addon.nodes.tiles import PLACES_SHUFFLE, PRIME
from tests.helpers import cycles
from tests.helpers.extension import refused
from tests.reference import tiles

SIDE = 32  # texels of the map
TILES = 4  # along the plane
PIXELS = 32
SETTINGS = {"roughness": 0.4, "interpolation": "CLOSEST"}  # a lobe that converges in few samples


def flake_texels(side):
    """Normals, presence and colours of flakes, by the names of their images."""
    rng = np.random.default_rng(5)
    presence = np.repeat((rng.random((side, side, 1)) < 0.6).astype(float), 3, axis=2)
    return {"Normals": maps.flakes(side, std=0.15), "Presence": presence, "Colors": rng.random((side, side, 3))}


def normal_map():
    return maps.blender_image("Normals", flake_texels(SIDE)["Normals"])


def scene_with(make_material, *, repeats, spp, width=1.0, middle=(0.0, 0.0), light=(0.3, 0.2, 1.0)):
    """(scene, material): a plane of width 1, `repeats` UVs around `middle`, of which `width` is seen from above."""
    scene = cycles.empty_scene(size=(PIXELS, PIXELS), spp=spp)
    cycles.box_filter(scene)
    cycles.add_camera(scene, (0, 0, 3), width=width)
    cycles.add_sun(scene, light, angle=0.05)
    material = make_material()
    plane = cycles.add_plane(scene, 1.0, material=material)
    low, high = (np.array(middle) - repeats / 2, np.array(middle) + repeats / 2)
    corners = [low, (high[0], low[1]), high, (low[0], high[1])]
    plane.data.uv_layers[0].uv.foreach_set("vector", np.float32(corners).ravel())
    return scene, material


def shuffled_material(side, has_flakes):
    """A material whose map is shuffled; has_flakes: with presence and colours."""
    images = [maps.blender_image(name, values) for name, values in flake_texels(side).items()]
    return create_glint_material("Sparkle", images[0], variation="SHUFFLE", **SETTINGS, **more(images, has_flakes))


def written_out(side, count, first, has_flakes):
    """The same of count x count tiles from `first` on, as one image in Blender's own nodes."""
    images = [maps.blender_image(name, tiles.shuffled(values, (count, count), first))
              for name, values in flake_texels(side).items()]
    return truth_material("Truth", images[0], **SETTINGS, **more(images, has_flakes))


def sharp_material(variation):
    return create_glint_material("Sparkle", normal_map(), variation=variation, roughness=0.1, interpolation="CLOSEST")


def more(images, has_flakes):
    return {"presence": images[1], "flake_color": images[2]} if has_flakes else {}


@pytest.mark.parametrize("has_flakes", [False, True])
@pytest.mark.parametrize("first", [(-2, -2), (int(PRIME) - 2, 700)])
def test_blenders_own_nodes_show_the_arrangement_that_is_written_out(has_flakes, first):
    shown, material = scene_with(partial(shuffled_material, SIDE, has_flakes), repeats=TILES, spp=4,
                                 middle=np.array(first) + TILES / 2)
    (group,) = glint_groups(material)
    follow_footprints(group, (SIDE, SIDE), are_wide=False)
    shown.cycles.shading_system = False
    found = cycles.rendered(shown)[..., :3]
    shown, _ = scene_with(partial(written_out, SIDE, TILES, first, has_flakes), repeats=1, spp=4, middle=(0.5, 0.5))
    truth = cycles.rendered(shown)[..., :3]
    # UVs so far from the origin lie 2^-12 texels off, so that some samples see the next texel.
    far = np.abs(found - truth) > 1e-3 * truth.mean()
    assert far.mean() < (0.001 if first[0] < 0 else 0.05)
    assert np.abs(found.mean() / truth.mean() - 1) < 2e-3


# Texels along a pixel: sides of map in texels and surface in tiles, how most samples answer, samples of the truth.
DISTANCES = {0.25: (32, 4, "PLAIN", 64), 4.0: (32, 4, "ALL", 1024), 20.0: (128, 16, "ALL", 256),
             64.0: (128, 16, "COUNTS", 256)}


@pytest.mark.parametrize(("texels", "has_flakes"),
                         [(0.25, False), (0.25, True), (4.0, False), (4.0, True), (20.0, True), (64.0, True)])
def test_the_lobe_shows_the_arrangement_on_seams_as_inside(texels, has_flakes):
    side, count, mode, spp = DISTANCES[texels]
    width = texels * PIXELS / (count * side)
    shown, material = scene_with(partial(shuffled_material, side, has_flakes), repeats=count, spp=64, width=width)
    prepare_scene(shown)
    assert MODES[int(np.median(counters(shown, material).mode))] == mode
    found = cycles.rendered(shown)[..., :3]
    shown, _ = scene_with(partial(written_out, side, count, (-count // 2,) * 2, has_flakes), repeats=1, spp=spp,
                          width=width, middle=(0.5, 0.5))
    truth = cycles.rendered(shown)[..., :3]
    assert found.mean() == pytest.approx(truth.mean(), rel=0.004)

    # The middle of the picture is a corner of four tiles.
    is_seam = np.zeros((PIXELS, PIXELS), bool)
    is_seam[PIXELS // 2 - 2 : PIXELS // 2 + 2] = True
    is_seam |= is_seam.T
    assert found[is_seam].mean() == pytest.approx(truth[is_seam].mean(), rel=0.01)
    squares = np.square(found - truth).mean(axis=-1)
    assert squares[is_seam].mean() < 1.5 * squares[~is_seam].mean() + 1e-6
    assert np.sqrt(squares.mean()) < 0.15 * truth.mean()


@pytest.mark.parametrize("has_flakes", [False, True])
def test_places_show_the_arrangement_too(has_flakes):
    side, count, _, spp = DISTANCES[4.0]
    shown, material = scene_with(partial(shuffled_material, side, has_flakes), repeats=count, spp=256)
    prepare_scene(shown)
    shown.cycles.shading_system = False
    (group,) = glint_groups(material)
    assert group.nodes[WIDE_NODE].outputs["Value"].default_value == 1.0
    found = cycles.rendered(shown)[..., :3]
    shown, _ = scene_with(partial(written_out, side, count, (-count // 2,) * 2, has_flakes), repeats=1, spp=spp,
                          middle=(0.5, 0.5))
    truth = cycles.rendered(shown)[..., :3]
    assert found.mean() == pytest.approx(truth.mean(), rel=0.01)
    # Repeats that were alike would not be like the truth.
    assert np.corrcoef(found.ravel(), truth.ravel())[0, 1] > 0.8


def test_a_group_that_lost_a_shuffle_is_mended(scene):
    material = shuffled_material(SIDE, True)
    (group,) = glint_groups(material)
    group.nodes.remove(group.nodes[PLACES_SHUFFLE])
    refresh(group)
    assert PLACES_SHUFFLE in group.nodes and group_binding(group).variation == "SHUFFLE"
    group.nodes.remove(group.nodes[SHUFFLE_NODE])
    refresh(group)
    assert PLACES_SHUFFLE not in group.nodes and group_binding(group).variation == "REPEAT"
    assert group.nodes["Normal Map Image"].inputs["Vector"].is_linked


def test_no_repeat_is_like_the_next():
    """The correlation of a picture of 64 repeats with itself, moved by one to four tiles."""
    correlation = {}
    for variation in ("REPEAT", "SHUFFLE"):
        shown, _ = scene_with(partial(sharp_material, variation), repeats=8, spp=16, light=(0, 0, 1))
        prepare_scene(shown)
        picture = cycles.rendered(shown)[..., 0]
        picture = picture - picture.mean()
        moved = [np.roll(picture, PIXELS // 8 * step, axis) for axis in (0, 1) for step in (1, 2, 3, 4)]
        correlation[variation] = [np.mean(picture * each) / np.mean(picture**2) for each in moved]
    assert min(correlation["REPEAT"]) > 0.5
    # Of as many independent pixels it has the deviation 1 / PIXELS.
    assert np.abs(correlation["SHUFFLE"]).max() < 4 / PIXELS


def test_tables_do_not_depend_on_the_variation(scene):
    image = normal_map()
    materials = [create_glint_material(name, image, variation=name, **SETTINGS) for name in ("REPEAT", "SHUFFLE")]
    for material in materials:
        cycles.add_plane(scene, material=material)
    groups = [glint_groups(material)[0] for material in materials]
    assert len({group["glint_table"] for group in groups}) == 1 and groups[0] != groups[1]
    assert [group_binding(group).variation for group in groups] == ["REPEAT", "SHUFFLE"]
    if SCRIPT_NODE in groups[0].nodes:
        assert [group.nodes[SCRIPT_NODE].inputs["Variation"].default_value for group in groups] == [0, 1]
    assert groups[1].nodes[PLACES_SHUFFLE].inputs["Size"].default_value[:2] == (SIDE, SIDE)


@pytest.mark.parametrize(("settings", "words"), [
    ({"interpolation": "LINEAR"}, "Variation Shuffle cuts between texels, and the normal map is read with Linear"),
    ({"extension": "MIRROR"}, "Variation Shuffle is of maps that repeat, and the Extension is Mirror: choose Repeat"),
])
def test_what_cannot_be_shuffled_is_refused_in_a_sentence(scene, settings, words):
    image = normal_map()
    with pytest.raises(MapError, match=words):
        create_glint_material("Sparkle", image, variation="SHUFFLE", **{"interpolation": "CLOSEST", **settings})
    assert not bpy.data.materials


def test_the_variation_is_changed_in_the_dialog(registered, scene):
    image = normal_map()
    plane = cycles.add_plane(scene, material=create_glint_material("Sparkle", image, **SETTINGS))
    bpy.context.view_layer.objects.active = plane
    assert bpy.ops.glint.change_map(image=image.name, variation="SHUFFLE", interpolation="CLOSEST") == {"FINISHED"}
    (group,) = glint_groups(plane.active_material)
    assert group_binding(group).variation == "SHUFFLE"
    assert "choose Closest" in refused(bpy.ops.glint.change_map, image=image.name, variation="SHUFFLE",
                                       interpolation="LINEAR")
