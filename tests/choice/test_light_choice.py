"""What each material looks for: its own strongest lights, the same at every frame, none that no facet mirrors."""

import math

import bpy
import numpy as np
import pytest

from benchmarks.counters import counters
from glint_addon import create_glint_material, prepare_scene
from glint_addon.choice.families import material_families
from glint_addon.choice.ranking import FEWEST_VISITS, LARGEST_VISIT, MISSES, OUT_OF_REACH, TOO_DIM, TOO_MANY, choose
from glint_addon.choice.reach import REGION, Facets, judgements
from glint_addon.lights.hint import Hint
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import glint_bsdf, glint_lights, places
from glint_addon.nodes.scene_lights import HOLDER
from glint_addon.prepare.uses import glint_uses
from glint_addon.seen.scene_views import scene_views
from tests.helpers import cycles
from tests.helpers.extension import data_names, write_flake_map
from tests.helpers.scene_hints import all_candidates

APART = 40.0  # metres between two planes, so far that lamps of one are dim on the other


@pytest.fixture
def flake_map(scene, tmp_path):
    return write_flake_map(tmp_path / "flakes.png")


def add_lamp(scene, name, location, energy=10.0, radius=0.01):
    light = bpy.data.lights.new(name, "POINT")
    light.energy, light.shadow_soft_size = energy, radius
    lamp = bpy.data.objects.new(name, light)
    lamp.location = location
    scene.collection.objects.link(lamp)
    return lamp


def glinting_plane(scene, flake_map, name, x=0.0, **settings):
    material = create_glint_material(name, flake_map, interpolation="CLOSEST", **settings)
    plane = cycles.add_plane(scene, material=material, repeats=4.0)
    plane.location.x = x
    return plane


@pytest.fixture
def two_planes(scene, flake_map):
    """Two planes far apart with one map, each under eight lamps of its own, and a camera that sees both."""
    cycles.add_camera(scene, (APART / 2, -1, 60), (APART / 2, 0, 0), angle=1.0)
    planes = [glinting_plane(scene, flake_map, name, x) for name, x in (("Left", 0.0), ("Right", APART))]
    for name, x in (("L", 0.0), ("R", APART)):
        for number in range(8):
            add_lamp(scene, f"{name}{number}", (x + 0.1 * number, 0.5, 3))
    return planes


def lights_read(material, scene=None):
    """The groups of lights that a material reads, and the light objects that drive these in a scene."""
    groups = [node.node_tree.nodes[glint_bsdf.LIGHTS_NODE].node_tree for node in material.node_tree.nodes
              if node.bl_idname == "ShaderNodeGroup" and glint_bsdf.is_glint_group(node.node_tree)]
    key = f'["lights_{glint_lights.set_of(groups[0])}"]'
    curves = [curve for curve in (scene or bpy.context.scene)[HOLDER].animation_data.drivers if curve.data_path == key]
    things = {target.id for curve in curves for each in curve.driver.variables for target in each.targets if target.id}
    return [group.name for group in groups], {thing.name for thing in things}


# --- the rule ---


def some_hints(values):
    """Hints called A, B, ... and their values."""
    return [Hint(chr(ord("A") + k), glint_lights.KIND_SUN, value, 0.01) for k, value in enumerate(values)], values


def test_the_eight_noisiest_are_looked_for_in_order_of_name():
    hints, values = some_hints([5.0, 9.0, 1.0, 7.0, 3.0, 8.0, 2.0, 6.0, 4.0, 10.0])
    choice = choose(hints, values)
    assert [hint.name for hint in choice.hints] == list("ABDEFHIJ")
    assert choice.left == (("C", TOO_MANY), ("G", TOO_MANY))


def test_lights_whose_noise_does_not_show_beside_the_others_are_left_out():
    hints, values = some_hints([1.0, 0.0005, 0.5, 0.0003])
    choice = choose(hints, values)
    assert [hint.name for hint in choice.hints] == ["A", "C"]
    assert choice.left == (("B", TOO_DIM), ("D", TOO_DIM))


def test_in_doubt_a_light_comes_first_and_nothing_beside_it_is_called_dim():
    hints, values = some_hints([math.inf, *[1.0] * 7, 0.001, 0.5])
    choice = choose(hints, values)
    assert [hint.name for hint in choice.hints] == list("ABCDEFGH")
    assert {reason for _, reason in choice.left} == {TOO_MANY}


@pytest.mark.parametrize(
    ("values", "visits"),
    [([1.0] * 8, LARGEST_VISIT), ([1.0] * 9, 90), ([1.0] * 80, FEWEST_VISITS), ([1.0] * 8 + [0.1], LARGEST_VISIT),
     ([1.0] * 8 + [0.2], 2010), ([math.inf] + [1.0] * 8, LARGEST_VISIT), ([], LARGEST_VISIT)],
    ids=["eight", "nine", "eighty", "a dim ninth", "a ninth", "in doubt", "none"],
)
def test_fewer_elements_are_visited_where_lights_beyond_the_eighth_make_noise(values, visits):
    """Visits of m elements divide the variance of the others by m, which is to be a tenth of that of the ninth."""
    assert choose(*some_hints(values)).visits == visits


def test_lights_that_miss_the_material_or_are_out_of_reach_free_their_places():
    hints, values = some_hints([10.0, 9.0, *range(1, 9), -1.0])
    choice = choose(hints, values, set(hints[1:]))
    assert [hint.name for hint in choice.hints] == list("BDEFGHIJ")
    assert dict(choice.left) == {"A": OUT_OF_REACH, "C": TOO_MANY, "K": MISSES}


# --- each material its own set ---


def test_each_material_looks_for_the_lights_at_its_own_objects(scene, two_planes):
    report = prepare_scene(scene)
    own = {"Left": [f"L{k}" for k in range(8)], "Right": [f"R{k}" for k in range(8)]}
    assert report["hints_by_material"] == own
    assert report["hints"] == own["Left"] + own["Right"] and report["skipped_lights"] == []
    assert [name for name, _ in report["left_by_material"]["Left"]] == own["Right"]
    left, right = (plane.material_slots[0].material for plane in two_planes)
    assert lights_read(left) == (["Glint Lights"], set(own["Left"]))
    assert lights_read(right) == (["Glint Lights.001"], set(own["Right"]))


def test_a_second_preparation_changes_nothing_and_equal_sets_become_one_again(scene, two_planes):
    prepare_scene(scene)
    before = data_names()
    prepare_scene(scene)
    assert data_names() == before
    for number in range(8):
        bpy.data.objects.remove(bpy.data.objects[f"R{number}"])
    report = prepare_scene(scene)
    assert report["hints_by_material"]["Left"] == report["hints_by_material"]["Right"] == report["hints"]
    ours = [group.name for group in bpy.data.node_groups if "Glint" in group.name]
    assert sorted(set(ours) - set(places.HIDDEN)) == [".Glint Lights of Scene", "Glint BSDF", "Glint Lights"]
    assert list(scene[HOLDER].keys()) == ["lights_1"]


def test_a_group_that_was_not_prepared_is_never_handed_to_a_material(scene, two_planes):
    group = next(node.node_tree for node in two_planes[1].material_slots[0].material.node_tree.nodes
                 if node.bl_idname == "ShaderNodeGroup")
    stale = group.copy()
    stale.name = "Glint A"  # the first by name
    prepare_scene(scene)
    nodes = [node for plane in two_planes for node in plane.material_slots[0].material.node_tree.nodes
             if node.bl_idname == "ShaderNodeGroup"]
    assert all(node.node_tree["glint_table"] and node.node_tree != stale for node in nodes)


def test_values_and_links_of_a_material_survive_a_group_of_its_own(scene, two_planes):
    right = two_planes[1].material_slots[0].material
    node = next(node for node in right.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    node.inputs["Roughness"].default_value = 0.25
    prepare_scene(scene)
    assert node.node_tree.name == "Glint BSDF.001" and node.inputs["Roughness"].default_value == 0.25
    assert node.inputs["Vector"].links[0].from_node.bl_idname == "ShaderNodeUVMap"
    assert node.outputs["BSDF"].is_linked


def test_a_material_asks_for_no_light_but_its_own(scene, flake_map):
    """By the shader's own count: a copied group works, and eight lamps over the other plane cost nothing."""
    cycles.set_up_cycles(scene, size=(8, 8), spp=1)
    cycles.add_camera(scene, (0, 0, 4), angle=0.4)
    glinting_plane(scene, flake_map, "Far", APART)
    near = glinting_plane(scene, flake_map, "Near")
    add_lamp(scene, "Near", (0, 0, 3), energy=100.0)
    for number in range(8):
        add_lamp(scene, f"Far {number}", (APART, 0.1 * number, 3), energy=10.0)
    prepare_scene(scene)
    assert lights_read(near.material_slots[0].material) == (["Glint Lights.001"], {"Near"})
    counts = counters(scene, near.material_slots[0].material, 1)
    assert counts.seen.all() and (counts.hints == 1).all()


def test_materials_with_glints_inside_a_group_of_the_users_share_one_set(scene, two_planes):
    inner = bpy.data.node_groups.new("Users own", "ShaderNodeTree")
    for plane in two_planes:
        tree = plane.material_slots[0].material.node_tree
        node = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeGroup")
        if not inner.nodes:
            inner.nodes.new("ShaderNodeGroup").node_tree = node.node_tree
        node.node_tree = inner
    report = prepare_scene(scene)
    assert report["hints_by_material"]["Left"] == report["hints_by_material"]["Right"]
    assert len(report["hints"]) == 8 and "Glint Lights.001" not in bpy.data.node_groups


def wrap(material):
    """Put a material's Glint BSDF into a group of its own."""
    node = next(each for each in material.node_tree.nodes if each.bl_idname == "ShaderNodeGroup")
    wrapper = bpy.data.node_groups.new("Wrapper", "ShaderNodeTree")
    wrapper.nodes.new("ShaderNodeGroup").node_tree = node.node_tree
    node.node_tree = wrapper


def test_a_group_that_a_group_of_the_users_holds_too_stays_in_both_places(scene, two_planes):
    material = two_planes[0].material_slots[0].material
    glints = glint_groups(material)[0]
    users = bpy.data.node_groups.new("Users own", "ShaderNodeTree")
    users.nodes.new("ShaderNodeGroup").node_tree = glints
    for _ in range(2):
        material.node_tree.nodes.new("ShaderNodeGroup").node_tree = users
    held, free = material_families(glint_uses(scene))
    assert held.materials == (material,) and not held.nodes and free.nodes
    assert len(held.held) == 3 and len(free.held) == 1


def test_a_group_of_the_users_that_is_used_once_is_its_materials_own(scene, two_planes):
    materials = [plane.material_slots[0].material for plane in two_planes]
    for material in materials:
        wrap(material)
    families = material_families(glint_uses(scene))
    assert [family.materials for family in families] == [(material,) for material in materials]
    assert all(family.nodes and family.nodes[0].id_data.name.startswith("Wrapper") for family in families)


def test_scenes_do_not_disturb_each_other_and_a_shared_material_finds_the_lights_of_each(scene, flake_map):
    planes = []
    for number in range(2):
        if number:
            scene = bpy.data.scenes.new("Second")
            cycles.set_up_cycles(scene)
        planes.append(glinting_plane(scene, flake_map, f"Material {number}"))
        cycles.add_camera(scene, (0, 0, 4))
        add_lamp(scene, f"Lamp {number}", (0, 0, 3))
    first, second = bpy.data.scenes
    materials = [plane.material_slots[0].material for plane in planes]
    for each in (first, second, first):
        assert prepare_scene(each)["warnings"] == []
    assert [lights_read(material, each) for material, each in zip(materials, (first, second), strict=True)] == [
        (["Glint Lights"], {"Lamp 0"}), (["Glint Lights"], {"Lamp 1"})
    ]
    first.name = "Renamed"  # a scene is not known by its name
    first.collection.objects.link(planes[1])
    assert prepare_scene(first)["warnings"] == []
    assert lights_read(materials[1], first) == (["Glint Lights"], {"Lamp 0"})
    assert lights_read(materials[1], second) == (["Glint Lights"], {"Lamp 1"})


def test_materials_that_one_scene_tells_apart_find_the_right_lights_in_both(scene, two_planes):
    """In a second scene both are under one lamp; what the first has is then kept for each by itself."""
    other = bpy.data.scenes.new("Together")
    cycles.set_up_cycles(other)
    cycles.add_camera(other, (0, 0, 4))
    materials = [plane.material_slots[0].material for plane in two_planes]
    for material in materials:
        cycles.add_plane(other, material=material, repeats=4.0)
    add_lamp(other, "Only", (0, 0, 3))
    prepare_scene(other)
    assert [lights_read(material, other)[1] for material in materials] == [{"Only"}, {"Only"}]
    prepare_scene(scene)
    own = [{f"{side}{number}" for number in range(8)} for side in "LR"]
    for _ in range(2):
        assert [lights_read(material, scene)[1] for material in materials] == own
        assert [lights_read(material, other)[1] for material in materials] == [{"Only"}, {"Only"}]
        prepare_scene(other)


# --- frames ---


def test_the_choice_is_the_same_at_whatever_frame_a_scene_is_prepared(scene, flake_map):
    scene.frame_start, scene.frame_end = 1, 40
    camera = cycles.add_camera(scene, (0, -3, 6))
    plane = glinting_plane(scene, flake_map, "Sparkle")
    lamps = [add_lamp(scene, f"Lamp {number:02}", (number - 8, 0, 2), energy=5.0) for number in range(16)]
    lamps[15].constraints.new("TRACK_TO").target = plane
    for frame, x in ((1, -6.0), (40, 6.0)):
        plane.location.x = camera.location.x = x
        plane.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("location", frame=frame)
        lamps[0].data.energy = 100.0 * frame
        lamps[0].data.keyframe_insert("energy", frame=frame)
    found = []
    for frame in (1, 20, 40, 90):
        scene.frame_set(frame)
        report = prepare_scene(scene)
        found.append((report["hints"], report["left_by_material"]))
    assert all(each == found[0] for each in found)
    assert len(found[0][0]) == 8 and "Lamp 00" in found[0][0]


# --- reach ---


def test_a_light_that_no_facet_mirrors_to_the_camera_is_left_out_unless_a_mirror_shows_it(scene, flake_map):
    cycles.add_camera(scene, (0, 0, 4), angle=0.3)
    plane = glinting_plane(scene, flake_map, "Sparkle", roughness=0.05, strength=0.1)
    add_lamp(scene, "Above", (0, 0, 3))
    add_lamp(scene, "Beside", (9, 0, 0.5), energy=1000.0)
    report = prepare_scene(scene)
    assert report["hints"] == ["Above"] and report["skipped_lights"] == [["Beside", OUT_OF_REACH]]
    mirror = cycles.add_plane(scene, material=bpy.data.materials.new("Mirror"))
    tree = mirror.data.materials[0].node_tree
    tree.nodes.clear()
    tree.nodes.new("ShaderNodeBsdfAnisotropic").inputs["Roughness"].default_value = 0.0
    assert "Beside" in prepare_scene(scene)["hints"]
    bpy.data.objects.remove(mirror)
    # Between these frames the camera passes where the lamp is mirrored to.
    camera = scene.camera
    for frame, x in ((1, 0.0), (100, -60.0)):
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 100
    assert "Beside" in prepare_scene(scene)["hints"]
    assert plane.name in scene.objects


@pytest.mark.parametrize(
    ("change", "is_kept"),
    [({}, True), ({"blur_glossy": 1.0}, False), ({"caustics_reflective": False}, False),
     ({"diffuse_bounces": 0}, False)],
)
def test_a_light_whose_glints_only_diffuse_surfaces_see_is_kept_where_they_show_them(scene, flake_map, change, is_kept):
    cycles.add_camera(scene, (0, 0, 4), angle=0.3)
    glinting_plane(scene, flake_map, "Sparkle", roughness=0.05, strength=0.1)
    add_lamp(scene, "Above", (0, 0, 3))
    add_lamp(scene, "Beside", (9, 0, 0.5), energy=1000.0)
    for name, value in ({"blur_glossy": 0.0, "caustics_reflective": True} | change).items():
        setattr(scene.cycles, name, value)
    assert ("Beside" in prepare_scene(scene)["hints"]) == is_kept
    if is_kept:
        scene.cycles.blur_glossy = 1.0
        assert "Beside" not in prepare_scene(scene)["hints"]
        scene.cycles.keyframe_insert("blur_glossy", frame=1)
        assert "Beside" in prepare_scene(scene)["hints"], "it may be 0 at another frame"


def wall_lamp(scene, kind, tilt):
    """A lamp 3 m above x = 0, turned by `tilt` [rad] from straight down towards +x."""
    light = bpy.data.lights.new(kind.title(), kind)
    light.energy = 10.0
    if kind == "AREA":
        light.size = 0.02
    else:
        light.spot_size, light.shadow_soft_size = math.radians(30.0), 0.01
    lamp = bpy.data.objects.new(kind.title(), light)
    lamp.location, lamp.rotation_euler = (0.0, 0.0, 3.0), (0.0, -tilt, 0.0)
    scene.collection.objects.link(lamp)
    return lamp


@pytest.fixture
def long_floor(scene, flake_map):
    """A floor from x = -1 to 9, and a camera 3 m above x = -1: a lamp as high above x = 0 is mirrored near it."""
    floor = glinting_plane(scene, flake_map, "Floor", x=4.0, roughness=0.1)
    floor.scale.x = 5.0
    floor.active_material.node_tree.nodes["Glint BSDF"].inputs["Strength"].default_value = 0.05
    cycles.add_camera(scene, (-1.0, 0.0, 3.0), (1.0, 0.0, 0.0), angle=1.5)
    return floor


@pytest.mark.parametrize(("kind", "tilt"), [("SPOT", 60.0), ("AREA", 135.0)])
def test_a_lamp_that_is_mirrored_only_where_it_does_not_shine_is_left_out(scene, long_floor, kind, tilt):
    lamp = wall_lamp(scene, kind, 0.0)
    assert prepare_scene(scene)["hints"] == [lamp.name]
    lamp.rotation_euler.y = -math.radians(tilt)
    report = prepare_scene(scene)
    assert report["hints"] == [] and report["skipped_lights"] == [[lamp.name, OUT_OF_REACH]]


def test_where_the_lamp_or_its_cone_moves_nothing_is_said_of_where_it_does_not_shine(scene, long_floor):
    lamp = wall_lamp(scene, "SPOT", math.radians(60.0))
    lamp.data.keyframe_insert("spot_size", frame=1)
    assert prepare_scene(scene)["hints"] == ["Spot"]
    lamp.data.animation_data_clear()
    for frame, tilt in ((1, 60.0), (10, 0.0)):
        lamp.rotation_euler.y = -math.radians(tilt)
        lamp.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)
    assert prepare_scene(scene)["hints"] == ["Spot"]


@pytest.mark.parametrize("shape", ["plane", "ball"])
def test_a_light_that_some_facet_mirrors_is_never_called_out_of_reach(scene, shape):
    """Against half vectors at many points of the surface, for lamps, suns and cameras at random."""
    generator = np.random.default_rng(5)
    facets, radius, angle = Facets(0.15, 0.01), 0.05, 0.02
    thing = cycles.add_plane(scene) if shape == "plane" else cycles.add_sphere(scene, segments=24, rings=12)
    thing.location, thing.scale, thing.rotation_euler = (0.3, 0, 0.1), (1, 2, 1), (0.2, 0.3, 0)
    lamps = [add_lamp(scene, f"Lamp {k}", generator.uniform(-4, 4, 3), radius=radius) for k in range(20)]
    lamps += [cycles.add_sun(scene, generator.normal(size=3), angle=2 * angle) for _ in range(20)]
    out = met = 0
    for _ in range(6):
        scene.camera = cycles.add_camera(scene, generator.uniform(-5, 5, 3))
        found, _ = all_candidates(scene)
        judged = judgements(scene, scene_views(scene), [thing], facets, found)
        points, normals = surface_points(thing, generator)
        for hint in found:
            mirrored = is_mirrored(hint, scene.camera, points, normals, facets, radius, angle)
            assert judged[hint].reached or not mirrored, (hint.name, scene.camera.location[:])
            out, met = out + (not judged[hint].reached), met + mirrored
        bpy.data.objects.remove(scene.camera)
    # On a ball a light is mirrored somewhere unless the camera cannot see there.
    assert met > 20 and (out > 20 or shape == "ball")


def surface_points(thing, generator, count=4000):
    """Points and shading normals (n, 3) at random on the faces of a mesh object, in world space."""
    mesh, matrix = thing.data, np.array(thing.matrix_world)
    mesh.calc_loop_triangles()
    triangles = [mesh.loop_triangles[k] for k in generator.integers(len(mesh.loop_triangles), size=count)]
    weights = generator.dirichlet((1, 1, 1), count)
    corners = np.array([[mesh.vertices[k].co for k in each.vertices] for each in triangles])
    normals = np.array([[mesh.corner_normals[k].vector for k in each.loops] for each in triangles])
    points = (weights[:, None] @ corners)[:, 0] @ matrix[:3, :3].T + matrix[:3, 3]
    normals = (weights[:, None] @ normals)[:, 0] @ np.linalg.inv(matrix[:3, :3])
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def is_mirrored(hint, camera, points, normals, facets, radius, angle) -> bool:
    """Whether somewhere the half vector is as near to the normal as the map's facets, the lobe and the light reach."""
    if hint.kind == glint_lights.KIND_SUN:
        light, size = np.array(hint.object.matrix_world.col[2][:3]), angle
    else:
        offset = np.array(hint.object.location) - points
        distance = np.linalg.norm(offset, axis=1, keepdims=True)
        light, size = offset / distance, np.arcsin(np.minimum(radius / distance[:, 0], 1.0))
    view = np.array(camera.matrix_world.translation) - points
    total = light + view / np.linalg.norm(view, axis=1, keepdims=True)
    length = np.linalg.norm(total, axis=1)
    tilt = np.arccos(np.clip(np.abs((total * normals).sum(axis=1)) / length, 0.0, 1.0))
    return bool((tilt < math.atan(facets.slope) + REGION * facets.alpha + size / length).any())


@pytest.mark.parametrize("count", [1, 200])
def test_lights_are_judged_where_instances_show_the_glints_and_not_where_their_collection_has_them(
        scene, flake_map, count):
    cycles.add_camera(scene, (APART, -1, 6), (APART, 0, 0), angle=1.0)
    plane = glinting_plane(scene, flake_map, "Shown")
    collection = bpy.data.collections.new("Shown")
    collection.objects.link(plane)
    scene.collection.objects.unlink(plane)
    for number in range(count):
        empty = bpy.data.objects.new("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location.x = APART + 0.01 * number
        scene.collection.objects.link(empty)
    for number in range(8):
        add_lamp(scene, f"Aside {number}", (0.1 * number, 0.5, 3))
        add_lamp(scene, f"There {number}", (APART + 0.1 * number, 0.5, 3))
    assert prepare_scene(scene)["hints"] == [f"There {number}" for number in range(8)]
