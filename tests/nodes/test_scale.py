"""The node group "Glint Scale": one repeat is as wide as it says, on all objects that share a material."""

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material, prepare_scene
from glint_addon.errors import MapError
from glint_addon.nodes import scale as scale_group
from glint_addon.operators.change_map import follow_uv_map
from glint_addon.prepare.real_size import write_object_sizes
from tests.helpers import cycles
from tests.helpers.extension import data_names, write_flake_map

REPEAT = 0.25  # metres
COARSE = 1e-3  # relative: coordinates at pixels' centres, from differences of 32-bit numbers


@pytest.fixture(params=[False, True], ids=["svm", "osl"])
def scene(request):
    """A scene seen from above, 4 x 1 metres, in 64 x 16 pixels: a pixel is a sixteenth of a metre."""
    scene = cycles.empty_scene(size=(64, 16), osl=request.param)
    cycles.box_filter(scene, 0.01)
    cycles.add_camera(scene, (0, 0, 5), width=4.0)
    return scene


def sized_material(uv_map="", scale=REPEAT):
    """A material that shows the coordinates that a Glint Scale gives."""
    material, color = cycles.emission_material()
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = scale_group.group_for(uv_map)
    node.inputs["Scale"].default_value = scale
    tree.links.new(node.outputs["Vector"], color)
    return material


def measure(*things):
    bpy.context.view_layer.update()
    for thing in things:
        write_object_sizes(thing, bpy.context.evaluated_depsgraph_get(), thing.active_material)


def repeats_a_metre(scene, *places):
    """Along x at (row 8, column) of each place [m]: from the difference of coordinates between two pixels."""
    pixels = cycles.rendered(scene)[8, :, 0]
    columns = [round((place + 2.0) * 16) for place in places]
    return [float(pixels[column + 2] - pixels[column - 2]) / 4 * 16 for column in columns]


def plane_at(scene, material, x, **options):
    plane = cycles.add_plane(scene, material=material, **options)
    plane.location.x = x
    return plane


def test_planes_of_other_sizes_and_uvs_that_share_a_material_have_repeats_of_the_same_width(scene):
    material = sized_material()
    things = [plane_at(scene, material, -1.5, size=1.0, repeats=3.0), plane_at(scene, material, -0.5, size=0.5),
              plane_at(scene, material, 0.5, size=0.2), plane_at(scene, material, 1.5, size=1.0, repeats=0.01)]
    things[2].scale = (4.0, -4.0, -4.0)
    measure(*things)
    assert repeats_a_metre(scene, -1.5, -0.5, 0.5, 1.5) == pytest.approx([1 / REPEAT] * 4, rel=COARSE)


def test_the_width_follows_the_scale_of_an_object_and_of_its_instances_as_they_are_rendered(scene):
    material = sized_material()
    thing = plane_at(scene, material, -1.0, size=0.5)
    measure(thing)
    thing.scale = (2.0, 2.0, 2.0)
    shown = bpy.data.collections.new("Shown")
    inner = plane_at(scene, material, 0.0, size=1.0)
    measure(inner)
    shown.objects.link(inner)
    scene.collection.objects.unlink(inner)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", shown
    instance.location.x, instance.scale = 1.0, (0.7, 0.7, 0.7)
    scene.collection.objects.link(instance)
    assert repeats_a_metre(scene, -1.0, 1.0) == pytest.approx([1 / REPEAT] * 2, rel=COARSE)


def test_an_object_scaled_unevenly_has_the_mean_width(scene):
    thing = plane_at(scene, sized_material(), 0.0, size=1.0)
    thing.scale = (2.0, 0.5, 1.0)  # one unit of UV covers a square metre, two metres of it along x
    measure(thing)
    assert repeats_a_metre(scene, 0.0) == pytest.approx([0.5 / REPEAT], rel=COARSE)


def test_an_object_that_was_not_measured_counts_as_a_metre_a_unit(scene):
    plane_at(scene, sized_material(), 0.0, size=1.0, repeats=2.0)
    assert repeats_a_metre(scene, 0.0) == pytest.approx([2.0 / REPEAT], rel=COARSE)


def test_scale_zero_leaves_the_uv_map_as_it_is(scene):
    thing = plane_at(scene, sized_material(scale=0.0), 0.0, size=1.0, repeats=3.0)
    measure(thing)
    assert repeats_a_metre(scene, 0.0) == pytest.approx([3.0], rel=COARSE)


def test_a_connected_vector_is_scaled_and_another_uv_map_has_a_size_of_its_own(scene):
    material = sized_material("A map whose name is far longer than a property's may be, is it not")
    thing = plane_at(scene, material, 0.0, size=1.0, repeats=5.0)
    other = thing.data.uv_layers.new(name=scale_group.uv_map_of(material.node_tree.nodes[-1].node_tree))
    other.uv.foreach_set("vector", np.float32([0, 0, 2, 0, 2, 2, 0, 2]))
    measure(thing)
    assert thing[scale_group.metres_property(other.name)] == pytest.approx(0.5) and scale_group.UV_METRES not in thing
    assert repeats_a_metre(scene, 0.0) == pytest.approx([1 / REPEAT], rel=COARSE)
    tree = material.node_tree
    (node,) = scale_group.scale_nodes(material)
    coordinates = tree.nodes.new("ShaderNodeUVMap")
    coordinates.uv_map = other.name
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = (2.0, 2.0, 2.0)
    tree.links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    assert repeats_a_metre(scene, 0.0) == pytest.approx([2 / REPEAT], rel=COARSE)


def test_each_uv_map_has_one_group():
    cycles.empty_scene()
    first, other = scale_group.build(), scale_group.group_for("Other")
    assert first != other and first == scale_group.build() and other == scale_group.group_for("Other")
    assert first.nodes[scale_group.METRES_NODE].attribute_name != other.nodes[scale_group.METRES_NODE].attribute_name


def test_a_group_whose_uv_map_was_changed_by_hand_reads_the_size_of_that():
    cycles.empty_scene()
    group = scale_group.build()
    group.nodes[scale_group.UV_NODE].uv_map = "Other"
    scale_group.follow_uv_map(group)
    name = group.nodes[scale_group.METRES_NODE].attribute_name
    assert name == scale_group.metres_property("Other") and len(name) < 64


# --- materials ---


@pytest.fixture
def sparkle(tmp_path):
    """A scene, saved, and a material of flakes, half a metre wide, on a plane of 2 metres under a sun."""
    scene = cycles.empty_scene(size=(16, 16), spp=4)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    material = create_glint_material("Sparkle", write_flake_map(tmp_path / "flakes.png", 64), interpolation="CLOSEST",
                                     roughness=0.2, scale=0.5)
    cycles.add_plane(scene, material=material, repeats=2.0)
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 4), width=2.0)
    return scene, material


@pytest.mark.parametrize("osl", [True, False])
def test_glints_are_those_of_the_same_size_written_by_hand(sparkle, osl):
    """A plane of 2 metres with 2 units of UV repeats 4 times: a factor of 2, footprints included."""
    scene, material = sparkle
    tree = material.node_tree
    (node,) = scale_group.scale_nodes(material)
    (target,) = [link.to_socket for link in node.outputs["Vector"].links]
    coordinates, mapping = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeMapping")
    tree.links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])

    def picture(source, factor=1.0):
        mapping.inputs["Scale"].default_value = [factor] * 3
        tree.links.new(source, target)
        prepare_scene(scene)
        scene.cycles.shading_system, scene.cycles.samples = osl, 64
        return cycles.rendered(scene)[..., :3]

    sized = picture(node.outputs["Vector"])
    by_hand, rounded, others = (picture(mapping.outputs["Vector"], factor) for factor in (2.0, 2.000001, 2.5))
    # Random numbers are hashed of coordinates, so a rounding draws others: the difference may be as large as that.
    assert difference(sized, by_hand) < 2.0 * difference(rounded, by_hand) + 1e-4
    assert difference(sized, by_hand) < 0.1 * difference(others, by_hand)


def difference(picture, other):
    return float(np.sqrt(((picture - other) ** 2).mean()) / other.mean())


def test_a_material_keeps_its_width_when_its_map_gets_another_uv_map(sparkle):
    _, material = sparkle
    tree = material.node_tree
    (node,) = scale_group.scale_nodes(material)
    surface = node.outputs["Vector"].links[0].to_node
    follow_uv_map(surface, "Other")
    (node,) = scale_group.scale_nodes(material)
    assert scale_group.uv_map_of(node.node_tree) == "Other"
    assert node.inputs["Scale"].default_value == 0.5 and node.outputs["Vector"].links[0].to_node == surface
    assert not [each for each in tree.nodes if each.bl_idname == "ShaderNodeUVMap"]


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf"), "wide"])
def test_a_width_that_is_none_is_refused_and_leaves_nothing_behind(tmp_path, scale):
    cycles.empty_scene()
    file = write_flake_map(tmp_path / "flakes.png")
    before = data_names()
    with pytest.raises(MapError, match="no width: use metres above 0"):
        create_glint_material("Sparkle", file, scale=scale)
    assert data_names() == before
