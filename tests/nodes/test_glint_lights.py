"""Node group "Glint Lights": its sockets, its sample count, and that Cycles sees the numbers."""

import bpy
import pytest

from glint_addon.errors import SceneError
from glint_addon.lights.drivers import connect_hints
from glint_addon.nodes import GROUPS, glint_lights
from glint_addon.nodes.driven import Driven, Variable, driver_curve, write_number
from glint_addon.properties import LIGHT_SET, STAMP
from tests.helpers import cycles
from tests.helpers.scene_hints import scene_hints

# A render goes through 32-bit floats and a pixel filter that sums to 1 within a few of their steps.
RENDER_TOLERANCE = 1e-5


def add_shown_output(scene, output):
    """A plane that shines with the value of the group's `output` and a camera that sees nothing else."""
    material, colour = cycles.emission_material()
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = glint_lights.build()
    material.node_tree.links.new(node.outputs[output], colour)
    cycles.add_plane(scene, 2.0, material=material)
    cycles.add_camera(scene, (0, 0, 3), width=1.0)


def shown(scene):
    """The RGB of the picture's middle."""
    return cycles.rendered(scene)[2, 2, :3].tolist()


def test_the_group_has_no_inputs_and_three_vectors_for_each_light_and_the_samples():
    group = glint_lights.build()
    items = [(item.name, item.in_out, item.socket_type) for item in group.interface.items_tree]
    expected = []
    for slot in range(1, 9):
        expected += [(f"{name} {slot}", "OUTPUT", "NodeSocketVector") for name in ("Light", "Shape")]
    expected += [(name, "OUTPUT", "NodeSocketFloat") for name in ("Samples", "Closures")]
    assert items == expected + [(f"Axis {slot}", "OUTPUT", "NodeSocketVector") for slot in range(1, 9)]
    assert all(item.description for item in group.interface.items_tree)


def test_every_output_is_linked_and_every_node_labelled():
    group = glint_lights.build()
    [output] = [node for node in group.nodes if node.bl_idname == "NodeGroupOutput"]
    assert [socket.name for socket in output.inputs if socket.name and not socket.is_linked] == []
    assert all(node.label for node in group.nodes if node != output)


def test_building_twice_gives_the_same_group_and_the_menu_knows_it(scene):
    group = GROUPS[glint_lights.NAME]()
    drivers = len(group.animation_data.drivers)
    assert glint_lights.build() == group
    assert len(group.animation_data.drivers) == drivers == 8 * 9 + 2
    assert [tree.name for tree in bpy.data.node_groups] == ["Glint Lights"]


@pytest.mark.parametrize("version", [1, 2])
def test_a_group_of_an_older_version_reads_the_lights_of_the_scene_and_keeps_its_sockets(scene, version):
    group = glint_lights.build()
    sockets = [item.name for item in group.interface.items_tree]
    group.animation_data_clear()
    for slot in range(1, 9 if version == 1 else 1):
        name = glint_lights.axis_name(slot)
        group.nodes.remove(group.nodes[name])
        group.interface.remove(group.interface.items_tree[name])
    group[STAMP] = version
    del group[LIGHT_SET]
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    write_number(group.nodes["Light 2"].inputs["X"],
                 Driven("x", (Variable("x", "SINGLE_PROP", lamp, "matrix_world[3][0]"),)))
    for _ in range(2):
        assert glint_lights.build() == group and group[STAMP] == glint_lights.VERSION
        assert [item.name for item in group.interface.items_tree] == sockets
    test_every_output_is_linked_and_every_node_labelled()
    assert len(group.nodes) == 8 * 3 + 3 and lamp.users == 0


@pytest.mark.parametrize("version", [2, glint_lights.VERSION])
def test_a_set_is_that_of_its_number_whatever_other_groups_the_file_has(scene, version):
    """Groups come along from other files, and people rename them."""
    other = glint_lights.build()
    other.name = "Appended"
    group = glint_lights.build()
    assert group != other and glint_lights.set_of(other) == 1
    group[STAMP] = version
    group[LIGHT_SET] = 7
    assert [glint_lights.set_of(glint_lights.build_set(number)) for number in (1, 2, 7, 1)] == [1, 2, 7, 1]


def test_a_foreign_group_of_that_name_is_refused(scene):
    bpy.data.node_groups.new("Glint Lights", "ShaderNodeTree")
    with pytest.raises(SceneError, match="rename it"):
        glint_lights.build()


def test_the_sample_count_needs_no_python(scene):
    curve = driver_curve(glint_lights.build().nodes["Samples"].outputs["Value"])
    assert curve.driver.is_simple_expression


@pytest.mark.parametrize(
    ("rule", "layer_samples", "expected"),
    [("USE", 0, 7), ("USE", 3, 3), ("USE", 9, 9), ("BOUNDED", 3, 3), ("BOUNDED", 9, 7), ("IGNORE", 3, 7)],
)
def test_samples_are_those_the_render_takes(rule, layer_samples, expected, tmp_path):
    scene = cycles.empty_scene(size=(4, 4), spp=7, osl=False)
    scene.cycles.use_layer_samples = rule
    scene.view_layers[0].samples = layer_samples
    add_shown_output(scene, "Samples")
    assert shown(scene) == pytest.approx([expected] * 3, rel=RENDER_TOLERANCE)

    # Cycles writes the number it took into the file.
    scene.render.filepath = str(tmp_path / "render.exr")
    bpy.ops.render.render(write_still=True)
    assert f"cycles.ViewLayer.samples\0string\0\1\0\0\0{expected}".encode() in (tmp_path / "render.exr").read_bytes()


def test_samples_follow_the_scene_that_is_rendered():
    first = cycles.empty_scene(size=(4, 4), spp=2, osl=False)
    add_shown_output(first, "Samples")
    second = first.copy()
    second.cycles.samples = 5
    assert shown(second) == pytest.approx([5] * 3, rel=RENDER_TOLERANCE)
    assert shown(first) == pytest.approx([2] * 3, rel=RENDER_TOLERANCE)
    first.cycles.samples = 3
    assert shown(first) == pytest.approx([3] * 3, rel=RENDER_TOLERANCE)


def test_cycles_sees_position_kind_and_radius_of_a_light():
    for output, expected in (("Light 1", (1.5, 2.5, 40.0)), ("Shape 1", (2.0, 0.25, 0.0)), ("Shape 2", (0.0,) * 3)):
        scene = cycles.empty_scene(size=(4, 4), osl=False)
        add_shown_output(scene, output)
        light = bpy.data.lights.new("Lamp", "POINT")
        light.shadow_soft_size = 0.25
        lamp = bpy.data.objects.new("Lamp", light)
        lamp.location = (1.5, 2.5, 40.0)
        scene.collection.objects.link(lamp)
        connect_hints(glint_lights.build(), scene, scene_hints(scene)[0])
        assert shown(scene) == pytest.approx(expected, rel=RENDER_TOLERANCE)


def test_cycles_sees_direction_and_half_angle_of_a_sun():
    for output, expected in (("Light 1", (0.36, 0.48, 0.8)), ("Shape 1", (1.0, 0.01, 0.0))):
        scene = cycles.empty_scene(size=(4, 4), osl=False)
        add_shown_output(scene, output)
        cycles.add_sun(scene, (0.36, 0.48, 0.8), angle=0.02)
        connect_hints(glint_lights.build(), scene, scene_hints(scene)[0])
        assert shown(scene) == pytest.approx(expected, rel=RENDER_TOLERANCE)


@pytest.mark.parametrize(("device", "closures"), [("CPU", 64.0), ("GPU", 0.0)])
def test_closures_follow_the_device_because_a_gpu_drops_all_but_ten_in_silence(device, closures):
    scene = cycles.empty_scene()
    add_shown_output(scene, "Closures")
    group = glint_lights.build()
    scene.cycles.device = device
    bpy.context.view_layer.update()
    evaluated = group.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert evaluated.nodes["Closures"].outputs[0].default_value == closures
