"""Lights of the world as hints: where Cycles shows them, how they follow their nodes, and what is left out and why."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Euler, Vector

from demo_scenes import maps
from demo_scenes.truth import truth_material
from glint_addon.bake.float_image import write_image
from glint_addon.images import read_pixels
from glint_addon.lights.drivers import connect_hints
from glint_addon.lights.world.hints import world_hints
from glint_addon.lights.world.picture import linear_pixels
from glint_addon.lights.world.sky_sun import SKIES_WITH_SUN
from glint_addon.materials.create import create_glint_material
from glint_addon.nodes import glint_lights
from glint_addon.nodes.glint_lights import KIND_SUN
from glint_addon.nodes.scene_lights import HOLDER
from glint_addon.prepare.scene import prepare_scene
from tests.helpers import cycles
from tests.helpers.scene_hints import scene_hints
from tests.helpers.stress_marks import thinned
from tests.helpers.stress_stage import add_square
from tests.osl.test_lobe import assert_same_mean, series

SIZE = 64  # pixels across an environment picture
BRIGHT = 5000.0
DIRECTION_TOLERANCE = 5e-6  # 32-bit sockets and angles
SKY_POWER_TOLERANCE = 0.35  # an estimate to rank lights by


def add_environment(scene, projection="EQUIRECTANGULAR", texel=(20, 45), *, mapping=None):
    """A world whose picture has one bright texel (row, column); returns its Environment Texture and Mapping nodes."""
    scene.world = bpy.data.worlds.new("World")
    tree = scene.world.node_tree
    # By itself Cycles looks at 4096 x 2048 directions first, a second of each render.
    scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = "MANUAL", SIZE
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.projection, node.interpolation = projection, "Closest"
    node.image = picture(texel, SIZE if projection == "MIRROR_BALL" else SIZE // 2)
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    if mapping is None:
        return node, None
    turn = tree.nodes.new("ShaderNodeMapping")
    turn.vector_type = mapping
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], turn.inputs["Vector"])
    tree.links.new(turn.outputs["Vector"], node.inputs["Vector"])
    return node, turn


def picture(texel, height=SIZE // 2, *, is_float=True):
    image = bpy.data.images.new("Picture", SIZE, height, float_buffer=is_float)
    pixels = np.full((height, SIZE, 4), 0.2 if is_float else 0.01, np.float32)
    pixels[texel] = BRIGHT if is_float else 1.0
    pixels[..., 3] = 1.0  # a saved file does not keep another
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def add_sky(scene, kind="MULTIPLE_SCATTERING", **settings):
    scene.world = bpy.data.worlds.new("World")
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexSky")
    node.sky_type = kind
    for name, value in settings.items():
        setattr(node, name, value)
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    return node


def view(scene, direction, span, *, edge):
    """What a camera of angle `span` [rad] sees that looks at a light: how far the light is off its middle [rad], and
    the radiance in its middle.

    edge: part of the brightest pixel that still counts as light.
    """
    size = 24
    scene.render.resolution_x = scene.render.resolution_y = size
    cycles.add_camera(scene, (0, 0, 0), direction, angle=span)
    cycles.box_filter(scene, 0.01)
    seen = cycles.rendered(scene)[..., 0]
    weights = seen > edge * seen.max()
    assert 0 < weights.mean() < 0.9, "the light must be in view, with something around it"
    places = (np.arange(size) + 0.5) / size - 0.5
    x, y = (weights @ places).sum() / weights.sum(), (places @ weights).sum() / weights.sum()
    return span * math.hypot(x, y), seen[size // 2, size // 2]


@pytest.mark.parametrize(("projection", "kind"), [
    ("EQUIRECTANGULAR", "POINT"), ("MIRROR_BALL", "TEXTURE"), ("MIRROR_BALL", "VECTOR"), ("EQUIRECTANGULAR", "NORMAL"),
])
def test_a_bright_texel_is_in_the_direction_in_which_a_camera_sees_it(scene, projection, kind):
    _, mapping = add_environment(scene, projection, mapping=kind)
    mapping.inputs["Rotation"].default_value = (0.3, -0.5, 0.8)
    mapping.inputs["Scale"].default_value = (-2.0, 2.0, 2.0)
    [hint], skipped = world_hints(scene)
    assert (hint.kind, skipped) == (KIND_SUN, [])
    texel = hint.size / 0.75
    assert view(scene, hint.direction, 3 * texel, edge=0.5)[0] < 0.1 * texel


@pytest.mark.parametrize(("kind", "elevation", "rotation"), [
    ("SINGLE_SCATTERING", 0.4, 0.7), ("MULTIPLE_SCATTERING", 2.5, -1.0),
])
def test_the_sun_of_a_sky_is_where_a_camera_sees_it_as_wide_and_about_as_strong(scene, kind, elevation, rotation):
    assert kind in SKIES_WITH_SUN
    node = add_sky(scene, kind, sun_elevation=elevation, sun_rotation=rotation, sun_size=0.05)
    # A Mapping at the hidden socket of such a sky does nothing, to Cycles either.
    tree = scene.world.node_tree
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0, 0, 1)
    hidden = next(socket for socket in node.inputs if socket.name == "Vector")
    tree.links.new(mapping.outputs["Vector"], hidden)
    [hint], skipped = world_hints(scene)
    assert (hint.kind, skipped) == (KIND_SUN, [])
    assert hint.size == pytest.approx(0.025)
    off, middle = view(scene, hint.direction, 0.075, edge=0.2)
    assert off < 0.001
    # The disk darkens towards its limb, to 0.8 of its middle on average.
    assert hint.power == pytest.approx(0.8 * math.pi * math.sin(0.025) ** 2 * middle, rel=SKY_POWER_TOLERANCE)


def read_group(scene):
    """The group's first light as driven at the present frame, when something of the scene reads it."""
    group = glint_lights.build()
    nodes = group.evaluated_get(bpy.context.evaluated_depsgraph_get()).nodes
    return [[nodes[name].inputs[axis].default_value for axis in "XYZ"] for name in ("Light 1", "Shape 1")]


def connect(scene):
    """Write the scene's hints into the group, read by a material."""
    material, colour = cycles.emission_material()
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group = glint_lights.build()
    material.node_tree.links.new(node.outputs["Light 1"], colour)
    cycles.add_plane(scene, material=material)
    connect_hints(group, scene, scene_hints(scene)[0])
    animation = scene[HOLDER].animation_data
    for curve in animation.drivers if animation is not None else ():
        assert curve.driver.is_simple_expression, curve.driver.expression
    return group


@pytest.mark.parametrize("kind", ["POINT", "TEXTURE"])
def test_an_animated_rotation_is_followed_by_drivers_also_through_groups_and_values(scene, kind):
    node, mapping = add_environment(scene, mapping=kind)
    tree = scene.world.node_tree
    rotation = mapping.inputs["Rotation"]
    rotation.default_value = (0.3, 0.2, 0.0)
    [still], _ = world_hints(scene)
    assert still.live is None
    # X by a driver, Y still, Z by the keys of a Value node, all through a group's input.
    group = bpy.data.node_groups.new("Turn", "ShaderNodeTree")
    group.interface.new_socket("Angles", in_out="INPUT", socket_type="NodeSocketVector")
    group.interface.new_socket("Vector", in_out="OUTPUT", socket_type="NodeSocketVector")
    inner = group.nodes.new("ShaderNodeMapping")
    inner.vector_type = kind
    group.links.new(group.nodes.new("NodeGroupInput").outputs["Angles"], inner.inputs["Rotation"])
    group.links.new(inner.outputs["Vector"], group.nodes.new("NodeGroupOutput").inputs["Vector"])
    group.links.new(group.nodes.new("ShaderNodeTexCoord").outputs["Generated"], inner.inputs["Vector"])
    outer, angles, value = (tree.nodes.new(f"ShaderNode{name}") for name in ("Group", "CombineXYZ", "Value"))
    outer.node_tree = group
    tree.links.new(outer.outputs["Vector"], node.inputs["Vector"])
    tree.links.new(angles.outputs["Vector"], outer.inputs["Angles"])
    tree.links.new(value.outputs["Value"], angles.inputs["Z"])
    angles.inputs["X"].driver_add("default_value").driver.expression = "frame / 10"
    angles.inputs["Y"].default_value = 0.2
    for frame in (1, 20):
        value.outputs["Value"].default_value = frame / 7
        value.outputs["Value"].keyframe_insert("default_value", frame=frame)

    connect(scene)
    before = Vector(add_back(still.direction, kind, (0.3, 0.2, 0.0)))
    for frame in (1, 8, 20):
        scene.frame_set(frame)
        turn = Euler((frame / 10, 0.2, value.outputs["Value"].default_value)).to_matrix()
        expected = (turn if kind == "TEXTURE" else turn.transposed()) @ before
        direction, shape = read_group(scene)
        assert (Vector(direction) - expected).length < DIRECTION_TOLERANCE
        assert shape == pytest.approx([KIND_SUN, still.size, 0])


def add_back(direction, kind, angles):
    """The texture's own direction of what a Mapping of `kind` and Euler `angles` shows in `direction`."""
    turn = Euler(angles).to_matrix()
    return (turn.transposed() if kind == "TEXTURE" else turn) @ Vector(direction)


def test_an_animated_sun_of_a_sky_is_followed_and_sets(scene):
    node = add_sky(scene)
    for frame in (1, 11):
        node.sun_elevation, node.sun_rotation, node.sun_size = 0.6 - frame / 10, frame / 5, 0.01 * frame
        for name in ("sun_elevation", "sun_rotation", "sun_size"):
            node.keyframe_insert(name, frame=frame)
    connect(scene)
    kinds = []
    for frame in (1, 4, 11):
        scene.frame_set(frame)
        direction, (kind, size, _) = read_group(scene)
        up, around = node.sun_elevation, node.sun_rotation
        expected = math.cos(up) * math.sin(around), math.cos(up) * math.cos(around), math.sin(up)
        np.testing.assert_allclose(direction, expected, atol=DIRECTION_TOLERANCE)
        assert size == pytest.approx(node.sun_size / 2)
        kinds.append(kind)
    assert kinds == [KIND_SUN, KIND_SUN, 0]


def test_drivers_of_the_world_work_in_a_saved_file(scene, tmp_path):
    _, mapping = add_environment(scene, mapping="POINT")
    mapping.inputs["Rotation"].keyframe_insert("default_value", frame=1)
    mapping.inputs["Rotation"].default_value[2] = 1.0
    mapping.inputs["Rotation"].keyframe_insert("default_value", frame=9)
    connect(scene)
    scene.frame_set(5)
    before = read_group(scene)
    blend = str(tmp_path / "world.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.open_mainfile(filepath=blend, use_scripts=False)
    scene = bpy.context.scene
    scene.frame_set(9)
    assert read_group(scene) != before
    scene.frame_set(5)
    assert read_group(scene) == before


def test_connecting_lights_of_the_world_twice_writes_nothing_twice(scene):
    add_environment(scene)
    group = connect(scene)
    [hint], _ = scene_hints(scene)
    assert tuple(group.nodes["Light 1"].inputs[axis].default_value for axis in "XYZ") == hint.direction
    assert group.nodes["Shape 1"].inputs["Y"].default_value == hint.size


def unlink(scene):
    scene.world.node_tree.links.clear()


def dim(scene):
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0


def hide(scene):
    scene.world.cycles_visibility.glossy = False


def leave_to_chance(scene):
    scene.world.cycles.sampling_method = "NONE"


def stretch(scene):
    scene.world.node_tree.nodes["Mapping"].inputs["Scale"].default_value = (1, 1, 2)


def shift(scene):
    scene.world.node_tree.nodes["Mapping"].inputs["Location"].default_value = (0, 0, 0.5)


def move_scale(scene):
    scene.world.node_tree.nodes["Mapping"].inputs["Scale"].keyframe_insert("default_value", frame=1)


def use_camera(scene):
    tree = scene.world.node_tree
    tree.links.new(tree.nodes["Texture Coordinate"].outputs["Camera"], tree.nodes["Mapping"].inputs["Vector"])


def compute_rotation(scene):
    tree = scene.world.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeVectorMath").outputs["Vector"], tree.nodes["Mapping"].inputs["Rotation"])


def use_sequence(scene):
    scene.world.node_tree.nodes["Environment Texture"].image.source = "SEQUENCE"


def lose_file(scene):
    image = bpy.data.images.new("Lost", 4, 4)
    image.source, image.filepath = "FILE", "//lost.hdr"
    scene.world.node_tree.nodes["Environment Texture"].image = image


def compute_colour(scene):
    tree = scene.world.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeTexGradient").outputs["Color"], tree.nodes["Background"].inputs["Color"])


@pytest.mark.parametrize(("change", "words"), [
    (unlink, ""), (dim, "strength"), (hide, "glossy"), (leave_to_chance, "by chance"), (stretch, "stretches"),
    (shift, "shifts"), (move_scale, "scale"), (use_camera, "coordinates"), (compute_rotation, "rotation"),
    (use_sequence, "still image"), (lose_file, "no pixels"), (compute_colour, "Gradient"),
])
def test_what_cannot_be_followed_is_skipped_and_the_reason_said(scene, change, words):
    add_environment(scene, mapping="POINT")
    change(scene)
    hints, skipped = world_hints(scene)
    assert hints == []
    assert [name for name, _ in skipped] == (["World"] if words else [])
    assert all(words in reason for _, reason in skipped)


def test_a_scene_without_a_world_or_with_a_sun_below_the_horizon_has_no_hint(scene):
    assert world_hints(scene) == ([], [])
    add_sky(scene, sun_elevation=-0.1)
    assert world_hints(scene) == ([], [])
    add_sky(scene, sun_disc=False)
    assert world_hints(scene) == ([], [])


def test_lights_are_found_behind_mixed_and_added_shaders_but_not_in_a_backdrop_for_the_camera(scene):
    node, _ = add_environment(scene)
    tree = scene.world.node_tree
    [alone], _ = world_hints(scene)
    background, output = tree.nodes["Background"], tree.nodes["World Output"]
    background.inputs["Strength"].default_value = 3.0
    mix, add, path = (tree.nodes.new(f"ShaderNode{name}") for name in ("MixShader", "AddShader", "LightPath"))
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs["Fac"])
    tree.links.new(background.outputs["Background"], add.inputs[0])
    tree.links.new(add.outputs["Shader"], mix.inputs[2])
    tree.links.new(mix.outputs["Shader"], output.inputs["Surface"])
    assert world_hints(scene) == ([], [])
    tree.links.new(add.outputs["Shader"], mix.inputs[1])
    [hint], _ = world_hints(scene)
    assert hint.power == pytest.approx(3 * alone.power)
    assert hint.direction == alone.direction
    mix.inputs["Fac"].links[0].is_muted = True
    mix.inputs["Fac"].default_value = 0.75
    tree.links.remove(mix.inputs[2].links[0])
    assert world_hints(scene)[0][0].power == pytest.approx(0.75 * alone.power)


def test_pictures_of_bytes_are_read_as_light(scene):
    node, _ = add_environment(scene)
    [bright], _ = world_hints(scene)
    node.image = picture((20, 45), is_float=False)
    [hint], _ = world_hints(scene)
    assert hint.power == pytest.approx(bright.power / BRIGHT, rel=0.01)


def test_one_picture_behind_several_nodes_and_groups_is_one_light_as_strong_as_all_together(scene):
    node, _ = add_environment(scene)
    tree = scene.world.node_tree
    [alone], _ = world_hints(scene)
    group = bpy.data.node_groups.new("Backgrounds", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Background", in_out="OUTPUT", socket_type="NodeSocketShader")
    entry, end, add = (group.nodes.new(name) for name in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeAddShader"))
    second = group.nodes.new("ShaderNodeTexEnvironment")
    second.image = node.image
    for slot, colour in enumerate((entry.outputs["Color"], second.outputs["Color"])):
        background = group.nodes.new("ShaderNodeBackground")
        group.links.new(colour, background.inputs["Color"])
        group.links.new(background.outputs["Background"], add.inputs[slot])
    group.links.new(add.outputs["Shader"], end.inputs["Background"])
    outer = tree.nodes.new("ShaderNodeGroup")
    outer.node_tree = group
    tree.links.new(node.outputs["Color"], outer.inputs["Color"])
    tree.links.new(outer.outputs["Background"], tree.nodes["World Output"].inputs["Surface"])
    [hint], skipped = world_hints(scene)
    assert (hint.direction, skipped) == (alone.direction, [])
    assert hint.power == pytest.approx(2 * alone.power)


def test_the_world_of_a_view_layer_counts_instead_of_the_scenes(scene):
    add_sky(scene)
    layer = scene.view_layers[0]
    layer.world_override = bpy.data.worlds.new("Dark")
    assert scene_hints(scene) == ([], [])


@pytest.mark.parametrize("space", ["Linear Rec.709", "Non-Color", "sRGB"])
def test_a_file_is_read_as_blender_reads_it_and_not_left_in_memory(scene, tmp_path, space):
    pixels = np.random.default_rng(1).random((150, 40, 4), dtype=np.float32)
    pixels[..., 3] = 1
    file = tmp_path / "world.exr"
    write_image(str(file), pixels, half=True)
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = space
    found = linear_pixels(image)
    assert not image.has_data
    np.testing.assert_array_equal(found[..., :3], read_pixels(image)[..., :3])
    np.testing.assert_array_equal(linear_pixels(image)[..., :3], found[..., :3])


def test_the_sun_of_a_photographed_sky_is_the_only_light_of_it(scene):
    node, _ = add_environment(scene)
    file = Path(bpy.utils.system_resource("DATAFILES", path="studiolights/world")) / "city.exr"
    node.image = bpy.data.images.load(str(file))
    [hint], skipped = world_hints(scene)
    assert skipped == []
    # It is half a degree wide, and photographed a little wider; its picture was looked at.
    assert math.degrees(hint.size) == pytest.approx(0.5, abs=0.1)
    assert math.degrees(math.asin(hint.direction[2])) == pytest.approx(47.8, abs=0.3)


def sunny_picture(scene):
    """A sun of one texel, five degrees, which a picture of this size has.

    Smooth at its edge and looked at more finely than its texels: where Cycles takes a direction for dark that is not,
    every picture has fireflies.
    """
    node, mapping = add_environment(scene, texel=(int(SIZE / 2 * 0.75), SIZE // 4), mapping="POINT")
    mapping.inputs["Rotation"].default_value = (0, 0, 0.02)
    node.interpolation, scene.world.cycles.sample_map_resolution = "Linear", 8 * SIZE


def sunny_sky(scene):
    add_sky(scene, sun_elevation=math.radians(45), sun_rotation=0.0)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.1


@pytest.mark.parametrize("add_world", thinned([sunny_picture, sunny_sky], [sunny_picture], "a z-test of many renders"))
def test_the_lobe_under_a_world_has_the_mean_of_nodes_and_less_noise_than_sixteen_times_its_samples(add_world):
    scene = cycles.empty_scene(size=(18, 18))
    image = maps.blender_image("Map", maps.bumps(128, std=0.15, width=3.0, seed=4))
    add_world(scene)
    square = add_square(scene, truth_material("Truth", image, roughness=0.2))
    nodes = series(scene, 128, 4)
    square.material_slots[0].material = create_glint_material("Glint", image, roughness=0.2)
    assert len(prepare_scene(scene)["hints"]) == 1
    lobe = series(scene, 8, 4)
    assert_same_mean(nodes, lobe)
    assert lobe.var(axis=0).mean() < nodes.var(axis=0).mean()
