"""Materials that geometry nodes set are found wherever they come from, and what cannot be found is said."""

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material, prepare_scene
from glint_addon.materials.worn import hidden_materials, worn_materials
from glint_addon.prepare.uses import glint_uses, unknown_materials
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.stress_stage import add_lamp, add_square
from tests.lights.test_scene_lights import another_scene, assert_finds

SIZE = (12, 12)  # pixels
TRUTH_SPP = 128
FALL = 3.0  # of the error, by hints; it is more than ten with the same samples


@pytest.fixture
def glitter(scene, tmp_path):
    """A glint material; the scene has a camera and a small lamp, and shows it nowhere."""
    cycles.set_up_cycles(scene, size=SIZE, spp=4)
    square = add_square(scene, None)
    bpy.data.objects.remove(square)
    add_lamp(scene, shadow_soft_size=0.02)
    return create_glint_material("Glitter", write_flake_map(tmp_path / "flakes.png", 64), roughness=0.2)


def new_tree(name="Nodes", *inputs):
    """Geometry nodes, and their input and output node."""
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for kind in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=kind, socket_type="NodeSocketGeometry")
    for label, kind in inputs:
        tree.interface.new_socket(label, in_out="INPUT", socket_type=kind)
    return tree, tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")


def add_nodes(thing, tree):
    modifier = thing.modifiers.new("Nodes", "NODES")
    modifier.node_group = tree
    return modifier


def set_material(tree, source, target, material=None):
    """A Set Material node between two sockets."""
    node = tree.nodes.new("GeometryNodeSetMaterial")
    tree.links.new(source, node.inputs["Geometry"])
    tree.links.new(node.outputs["Geometry"], target)
    if material is not None:
        node.inputs["Material"].default_value = material
    return node


def bare_square(scene, name="Square"):
    square = cycles.add_plane(scene, 4.0, repeats=4.0)
    square.name = name
    return square


def on_an_object_without_slots(scene, material):
    square = bare_square(scene)
    tree, entry, end = new_tree()
    set_material(tree, entry.outputs[0], end.inputs[0], material)
    add_nodes(square, tree)
    return square


def inside_a_group(scene, material):
    square = on_an_object_without_slots(scene, material)
    outer, entry, end = new_tree("Outer")
    node = outer.nodes.new("GeometryNodeGroup")
    node.node_tree = square.modifiers[0].node_group
    outer.links.new(entry.outputs[0], node.inputs[0])
    outer.links.new(node.outputs[0], end.inputs[0])
    square.modifiers[0].node_group = outer
    return square


def by_an_input_of_the_modifier(scene, material):
    square = bare_square(scene)
    tree, entry, end = new_tree("Nodes", ("Material", "NodeSocketMaterial"))
    node = set_material(tree, entry.outputs[0], end.inputs[0])
    tree.links.new(entry.outputs["Material"], node.inputs["Material"])
    modifier = add_nodes(square, tree)
    identifier = tree.interface.items_tree["Material"].identifier
    getattr(modifier.properties.inputs, identifier).value = material
    return square


def on_instances(scene, material):
    """Squares at the vertices of an object, of a mesh that exists in the nodes alone."""
    points = cycles.add_mesh(scene, [(-1, 0, 0), (1, 0, 0)], [])
    tree, entry, end = new_tree()
    grid, scatter = tree.nodes.new("GeometryNodeMeshGrid"), tree.nodes.new("GeometryNodeInstanceOnPoints")
    set_material(tree, grid.outputs["Mesh"], scatter.inputs["Instance"], material)
    tree.links.new(entry.outputs[0], scatter.inputs["Points"])
    tree.links.new(scatter.outputs["Instances"], end.inputs[0])
    add_nodes(points, tree)
    return points


def on_curves(scene, material):
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.3
    curve.splines.new("POLY").points.add(1)
    for point, x in zip(curve.splines[0].points, (-1, 1), strict=True):
        point.co = x, 0, 0, 1
    thing = bpy.data.objects.new("Curve", curve)
    scene.collection.objects.link(thing)
    tree, entry, end = new_tree()
    set_material(tree, entry.outputs[0], end.inputs[0], material)
    add_nodes(thing, tree)
    return thing


def info_of(tree, kind, source, target):
    """A node that gives another object's, or a collection's, geometry as instances."""
    node = tree.nodes.new(f"GeometryNode{kind}Info")
    node.inputs[kind].default_value = source
    if kind == "Object":
        node.inputs["As Instance"].default_value = True
    tree.links.new(next(socket for socket in node.outputs if socket.type == "GEOMETRY"), target)


def hidden_source(scene, material):
    source = bare_square(scene, "Source")
    source.data.materials.append(material)
    source.hide_render = source.hide_viewport = True
    return source


def placed(scene, kind, source):
    place = bare_square(scene, "Place")
    tree, _, end = new_tree("Placing")
    info_of(tree, kind, source, end.inputs[0])
    add_nodes(place, tree)
    return place


def from_a_hidden_object(scene, material):
    return placed(scene, "Object", hidden_source(scene, material))


def from_a_collection_of_no_scene(scene, material):
    source = hidden_source(scene, material)
    collection = bpy.data.collections.new("Sources")
    collection.objects.link(source)
    scene.collection.objects.unlink(source)
    return placed(scene, "Collection", collection)


def from_an_object_that_has_nodes_itself(scene, material):
    source = on_an_object_without_slots(scene, material)
    source.hide_render = True
    return placed(scene, "Object", source)


def from_an_object_that_shows_instances_itself(scene, material):
    source = on_instances(scene, material)
    source.hide_render = True
    return placed(scene, "Object", source)


WAYS = [on_an_object_without_slots, inside_a_group, by_an_input_of_the_modifier, on_instances, on_curves,
        from_a_hidden_object, from_a_collection_of_no_scene, from_an_object_that_has_nodes_itself,
        from_an_object_that_shows_instances_itself]


@pytest.mark.parametrize("wear", WAYS)
def test_a_material_is_found_wherever_geometry_nodes_take_it_from(scene, glitter, wear):
    thing = wear(scene, glitter)
    report = prepare_scene(scene)
    assert report["hints"] == ["Point"] and report["warnings"] == [] and report["unseen"] == []
    assert report["hints_by_material"] == {"Glitter": ["Point"]} and report["baked"] + report["reused"]
    layers = list(scene.view_layers)
    assert worn_materials(thing, layers) == [glitter] and hidden_materials([thing], layers) == {}
    assert {pair for pairs in glint_uses(scene).values() for pair in pairs} == {(thing, glitter)}


def error(picture, truth):
    return np.sqrt(np.mean((picture - truth)**2))


def test_hints_for_a_material_of_geometry_nodes_make_less_noise(scene, glitter):
    on_an_object_without_slots(scene, glitter)
    noisy = cycles.rendered(scene)[..., :3]
    prepare_scene(scene)
    quiet = cycles.rendered(scene)[..., :3]
    scene.cycles.samples, scene.cycles.seed = TRUTH_SPP, 2
    truth = cycles.rendered(scene)[..., :3]
    assert truth.mean() > 0 and error(quiet, truth) * FALL < error(noisy, truth)


# --- what cannot be found ---


def hide_the_object(thing):
    thing.hide_viewport = True


def hide_in_the_view_layer(thing):
    thing.hide_set(True)


def hide_the_modifier(thing):
    thing.modifiers[0].show_viewport = False


@pytest.mark.parametrize("hide", [hide_the_object, hide_the_modifier])
@pytest.mark.parametrize("wear", WAYS)
def test_what_is_hidden_in_the_viewport_is_named_with_the_next_step(scene, glitter, hide, wear):
    thing = wear(scene, glitter)
    hide(thing)
    (warning,) = prepare_scene(scene)["warnings"]
    assert warning == (f'The materials that geometry nodes give to "{thing.name}" are unknown while it, or its '
                       "modifier, is hidden in the viewport: show it there and prepare again.")


def test_what_the_eye_hides_is_found_or_named(scene, glitter):
    thing = on_an_object_without_slots(scene, glitter)
    hide_in_the_view_layer(thing)
    report = prepare_scene(scene)
    assert (report["hints"] == ["Point"]) != (len(report["warnings"]) == 1)


@pytest.mark.parametrize("hide", [hide_the_object, hide_the_modifier])
def test_nothing_is_said_of_hidden_geometry_nodes_that_know_no_glints(scene, glitter, hide):
    """The square's own slot has them, and is known; a parent's are its own."""
    add_square(scene, glitter)
    other = on_an_object_without_slots(scene, bpy.data.materials.new("Wood"))
    other.parent = bpy.data.objects["Mesh"]
    hide(other)
    assert unknown_materials(scene) == []
    other.data.materials.append(glitter)
    assert prepare_scene(scene)["warnings"] == []


@pytest.mark.parametrize("setting", ["hide_render", "show_render"])
def test_nothing_is_said_of_what_no_render_shows(scene, glitter, setting):
    thing = on_an_object_without_slots(scene, glitter)
    hide_the_modifier(thing)
    if setting == "hide_render":
        thing.hide_render = True
    else:
        thing.modifiers[0].show_render = False
    assert unknown_materials(scene) == []


# --- several scenes ---


def shown_by_nodes(scene, material):
    return on_an_object_without_slots(scene, material)


def shown_by_an_instance(scene, material):
    collection = bpy.data.collections.new("Set")
    collection.objects.link(cycles.add_plane(scene, 4.0, material=material, repeats=4.0))
    scene.collection.objects.unlink(collection.objects[0])
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    scene.collection.objects.link(empty)


@pytest.mark.parametrize("show", [shown_by_nodes, shown_by_an_instance])
def test_another_scene_keeps_its_lights_for_what_only_nodes_and_instances_show(scene, glitter, tmp_path, show):
    """This scene tells two materials apart, of which the other shows one; that was not evaluated since the file opened.
    """
    other = another_scene()
    show(other, glitter)
    cycles.add_camera(other, (0, -2, 2), angle=0.6)
    lamp = add_lamp(other, location=(0.3, 1.2, 1.2), name="Other", shadow_soft_size=0.02)
    prepare_scene(other)
    # "Alone" comes first by name, and would take the first set.
    alone = create_glint_material("Alone", tmp_path / "flakes.png", roughness=0.2)
    for material, x in ((alone, 0.0), (glitter, 60.0)):
        cycles.add_plane(scene, 4.0, material=material, repeats=4.0).location.x = x
        for number in range(8):
            add_lamp(scene, location=(x + 0.1 * number, 0.5, 3), name=f"{material.name} {number}")
    scene.camera.location, scene.camera.rotation_euler, scene.camera.data.angle = (30, 0, 90), (0, 0, 0), 1.5
    place = tuple(lamp.location)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    first, second = bpy.data.scenes["Scene"], bpy.data.scenes["Other"]
    assert second.view_layers[0].depsgraph is None
    report = prepare_scene(first)
    assert report["hints_by_material"]["Alone"] != report["hints_by_material"]["Glitter"]
    assert_finds(second, place, material=bpy.data.materials["Glitter"])
