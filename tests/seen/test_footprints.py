"""The range of footprints that is worked out from a scene holds every footprint that the shader finds in its render."""

import math

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material, paths
from glint_addon.animation.poses import poses
from glint_addon.bake.counts import counts_levels
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import scale as scale_group
from glint_addon.nodes import script_node
from glint_addon.prepare.real_size import write_object_sizes
from glint_addon.seen import footprints
from glint_addon.seen.footprints import EVERYTHING, MARGIN, NOTHING, counts_levels_reached, footprint_range
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.osl_functions import ROWS, evaluate
from tests.reference import footprint as reference

SIZE = (1024, 512)  # texels of the map as it is judged; nothing is baked here
# The range's ends less the margin, relative to the footprints found: far above, and there would be levels for nothing.
# Angles, the frame's own margin and the box around a ball take this much.
LOOSEST = 4.0

SHADER = """
#include "stdcycles.h"
{header}
shader axes(point UV = point(0), output color Result = color(0))
{{
  Footprint footprint;
  Matrix2 texels = {{ {width} * Dx(UV[0]), {width} * Dy(UV[0]), {height} * Dx(UV[1]), {height} * Dy(UV[1]) }};
  if (surface_footprint(cone_on_surface(Dx(P), Dy(P), I, Ng, footprint_radius({samples})), texels, footprint)) {{
    Result = color(footprint.short_axis, footprint.long_axis, 1);
  }}
}}
"""


@pytest.fixture
def material(scene, tmp_path):
    """A glint material; the scene's camera is three metres above the origin."""
    cycles.add_camera(scene, (0, 0, 3))
    return create_glint_material("Sparkle", write_flake_map(tmp_path / "flakes.png"))


def surface_of(material):
    return next(node for node in material.node_tree.nodes if getattr(node, "node_tree", None) in glint_groups(material))


def scale_node(material, width):
    """A new Glint Scale node."""
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = scale_group.build()
    node.inputs["Scale"].default_value = width
    return node


def judged(scene, *things, **options):
    """The range of the first thing's material on all `things`."""
    bpy.context.view_layer.update()
    uses = [(thing, thing.material_slots[0].material) for thing in things]
    (group,) = glint_groups(uses[0][1])
    return footprint_range(scene, group, uses, SIZE, **options)


def rendered_axes(scene, thing) -> np.ndarray:
    """Short semi-axes in texels, of all pixels that show `thing`, as the shader works them out."""
    material = thing.material_slots[0].material
    surface = surface_of(material)
    other = material.copy()
    tree = other.node_tree
    (source,) = [link.from_socket for link in tree.nodes[surface.name].inputs["Vector"].links]
    text = bpy.data.texts.new("Axes")
    header = script_node.with_headers('#include "footprint.h"')
    width, height = map(float, SIZE)
    text.from_string(SHADER.format(header=header, samples=float(scene.cycles.samples), width=width, height=height))
    node = tree.nodes.new("ShaderNodeScript")
    node.script = text
    if "UV" not in node.inputs:
        script_node.compile_script_node(node)
    emission = tree.nodes.new("ShaderNodeEmission")
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(source, node.inputs["UV"])
    tree.links.new(node.outputs["Result"], emission.inputs["Color"])
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    thing.material_slots[0].material = other
    cycles.box_filter(scene, 0.01)
    pixels = cycles.rendered(scene)
    thing.material_slots[0].material = material
    return pixels[pixels[..., 2] > 0][:, 0]


def tilted_plane(scene, material):
    plane = cycles.add_plane(scene, 40.0, material=material, repeats=2.0)
    plane.rotation_euler = (math.radians(70), 0, 0.3)
    return plane


def ball(scene, material):
    return cycles.add_sphere(scene, 0.8, material=material)


def mapped_plane(scene, material):
    tree = material.node_tree
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = (3.0, 5.0, 1.0)
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, 0.5)
    reroute = tree.nodes.new("NodeReroute")
    surface = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeGroup")
    (source,) = [link.from_socket for link in surface.inputs["Vector"].links]
    tree.links.new(source, mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], surface.inputs["Vector"])
    return cycles.add_plane(scene, 2.0, material=material)


def texture_mapped_plane(scene, material):
    plane = mapped_plane(scene, material)
    mapping = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeMapping")
    mapping.vector_type = "TEXTURE"
    return plane


def scaled_and_smoothed(scene, material):
    plane = cycles.add_plane(scene, 1.0, material=material)
    plane.scale = (1.0, 2.0, 3.0)
    plane.modifiers.new("Subdivision", "SUBSURF").subdivision_type = "SIMPLE"
    return plane


def sized(scene, material):
    """A plane whose units of UV are 4 metres wide, with repeats of half a metre."""
    plane = cycles.add_plane(scene, 2.0, material=material, repeats=1.5)
    plane.scale = (3.0, 3.0, 3.0)
    material.node_tree.links.new(scale_node(material, 0.5).outputs["Vector"], surface_of(material).inputs["Vector"])
    write_object_sizes(plane, bpy.context.evaluated_depsgraph_get(), material)
    return plane


def orthographic(scene, material):
    cycles.add_camera(scene, (0, 0, 3), width=1.5)
    return tilted_plane(scene, material)


def wide_and_shifted(scene, material):
    data = cycles.add_camera(scene, (0, 0, 3), angle=1.6).data
    data.shift_x = 0.4
    scene.render.pixel_aspect_x = 2.0
    scene.render.resolution_percentage = 200
    return cycles.add_plane(scene, 9.0, material=material)


@pytest.mark.parametrize(
    "build",
    [tilted_plane, ball, mapped_plane, texture_mapped_plane, scaled_and_smoothed, sized, orthographic,
     wide_and_shifted],
)
def test_the_range_holds_every_footprint_of_the_render_and_little_more(scene, material, build):
    scene.cycles.samples = 4
    scene.render.resolution_x, scene.render.resolution_y = 32, 20
    thing = build(scene, material)
    # Only what the brief camera of the test sees: with another camera it would see more.
    for camera in [other for other in scene.objects if other.type == "CAMERA" and other != scene.camera]:
        bpy.data.objects.remove(camera)
    low, high = judged(scene, thing)
    axes = rendered_axes(scene, thing)
    assert len(axes) > 20
    assert low <= axes.min() and axes.max() <= high, (low, axes.min(), axes.max(), high)
    # One pixel in a hundred, at the rim of a ball or a plane's horizon, tells little of the rest.
    typical = np.quantile(axes, [0.01, 0.99])
    assert typical[0] < low * MARGIN * LOOSEST and typical[1] > high / MARGIN / LOOSEST, (low, typical, high)


@pytest.mark.parametrize("mapped", [False, True])
def test_the_range_with_a_scale_is_that_of_the_same_size_by_a_mapping_node(scene, material, mapped):
    plane = cycles.add_plane(scene, 2.0, material=material, repeats=2.0)
    plane.scale = (3.0, 3.0, 3.0)
    tree, vector = material.node_tree, surface_of(material).inputs["Vector"]
    source = vector.links[0].from_socket
    mapping = tree.nodes.new("ShaderNodeMapping")
    tree.links.new(source, mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], vector)
    mapping.inputs["Scale"].default_value = (6.0, 6.0, 1.0)  # units of 3 metres, repeats of half a metre
    by_hand = judged(scene, plane)
    node = scale_node(material, 0.5)
    mapping.inputs["Scale"].default_value = (1.0, 1.0, 1.0)
    tree.links.new(node.outputs["Vector"], vector)
    if mapped:
        tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    assert judged(scene, plane) == pytest.approx(by_hand)
    node.inputs["Scale"].default_value = 0.0
    plain = judged(scene, plane)
    assert plain == pytest.approx((by_hand[0] / 6.0, by_hand[1] / 6.0))
    tree.links.new(tree.nodes.new("ShaderNodeValue").outputs[0], node.inputs["Scale"])
    assert judged(scene, plane) == EVERYTHING


def test_a_footprint_is_the_pixel_in_texels_for_a_plane_seen_from_above(scene, material):
    """64 pixels over a view 2 metres wide, on a map of 1024 texels over 2 metres: 16 texels a pixel."""
    scene.render.resolution_x = scene.render.resolution_y = 64
    cycles.add_camera(scene, (0, 0, 3), width=2.0)
    bpy.data.objects.remove(bpy.data.objects["Camera"])
    scene.cycles.samples = 16
    radius = reference.footprint_radius(16)
    low, high = judged(scene, cycles.add_plane(scene, material=material))
    assert low == pytest.approx(8 * radius / MARGIN) and high == pytest.approx(16 * radius * MARGIN)


def test_twice_as_far_is_twice_as_wide_and_nothing_outside_the_view_counts(scene, material):
    plane = cycles.add_plane(scene, 0.1, material=material)
    near = judged(scene, plane)
    plane.location.z = -3
    assert judged(scene, plane) == pytest.approx((2 * near[0], 2 * near[1]), rel=0.1)
    plane.location.z = 5
    assert judged(scene, plane) == NOTHING
    plane.location = (20, 0, 0)
    assert judged(scene, plane) == NOTHING


def test_a_floor_under_the_camera_is_as_near_as_its_nearest_point_in_view(scene, material):
    """All corners of the floor are far away, and most are behind the camera."""
    cycles.add_camera(scene, (0, 0, 1), (1, 0, 0.8))
    bpy.data.objects.remove(bpy.data.objects["Camera"])
    scene.camera.data.clip_end = 50.0
    low, high = judged(scene, cycles.add_plane(scene, 200.0, material=material))
    pixel = 2 * math.tan(0.35) / 32 * reference.footprint_radius(1)
    # The view's lower edge, widened by a quarter, meets the floor where the depth is between one and three metres.
    assert 512 / 200 * pixel / MARGIN < low < 3 * 512 / 200 * pixel / MARGIN
    assert 1024 / 200 * pixel * 49 * MARGIN < high < 1024 / 200 * pixel * 51 * MARGIN


def test_inside_an_object_the_range_starts_where_the_camera_begins_to_see(scene, material):
    room = cycles.add_sphere(scene, 100.0, material=material)
    low, high = judged(scene, room)
    assert 0 < low < 0.1 and high == math.inf  # a hollow shows in itself


def panorama(scene, plane):
    scene.camera.data.type = "PANO"


def no_camera(scene, plane):
    bpy.data.objects.remove(scene.camera)


def stereo(scene, plane):
    scene.render.use_multiview = True


def driven_camera(scene, plane):
    scene.camera.driver_add("location", 0)


def camera_in_a_strip(scene, plane):
    scene.camera.keyframe_insert("location", frame=1)
    animation = scene.camera.animation_data
    animation.nla_tracks.new().strips.new("Strip", 1, animation.action)


def growing_object(scene, plane):
    for frame, scale in ((1, 1.0), (50, 2.0)):
        plane.scale = (scale, scale, scale)
        plane.keyframe_insert("scale", frame=frame)


def changing_mesh(scene, plane):
    plane.shape_key_add(name="Basis")
    plane.shape_key_add(name="Other").keyframe_insert("value", frame=1)


def zooming_camera(scene, plane):
    scene.camera.data.keyframe_insert("lens", frame=1)


def moving_object(scene, plane):
    plane.driver_add("location", 0)


def constraint(scene, plane):
    plane.constraints.new("TRACK_TO")


def changing_samples(scene, plane):
    scene.cycles.keyframe_insert("samples", frame=1)


def instancer(scene, plane):
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type = "COLLECTION"
    scene.collection.objects.link(empty)


def waves(scene, plane):
    plane.modifiers.new("Wave", "WAVE")


def displacement(scene, plane):
    plane.material_slots[0].material.displacement_method = "BOTH"


def no_uv_map(scene, plane):
    plane.data.uv_layers.remove(plane.data.uv_layers[0])
    plane.data.update()


def degenerate_uvs(scene, plane):
    plane.data.uv_layers[0].uv.foreach_set("vector", [0.0] * 8)


def flattened(scene, plane):
    plane.scale = (0, 0, 0)


def surface_node(plane):
    return next(n for n in plane.material_slots[0].material.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")


def object_coordinates(scene, plane):
    tree = plane.material_slots[0].material.node_tree
    source = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(source.outputs["Object"], surface_node(plane).inputs["Vector"])


def linked_scale(scene, plane):
    mapped_plane(scene, plane.material_slots[0].material)
    tree = plane.material_slots[0].material.node_tree
    mapping = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeMapping")
    tree.links.new(tree.nodes.new("ShaderNodeValue").outputs[0], mapping.inputs["Scale"])


def animated_nodes(scene, plane):
    linked = plane.material_slots[0].material.node_tree
    linked.nodes.new("ShaderNodeValue").outputs[0].keyframe_insert("default_value", frame=1)


def bent_coordinates(scene, plane):
    tree = plane.material_slots[0].material.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], surface_node(plane).inputs["Vector"])


@pytest.mark.parametrize(
    "change",
    [panorama, no_camera, stereo, driven_camera, camera_in_a_strip, zooming_camera, moving_object, growing_object,
     changing_mesh, constraint, changing_samples, instancer,
     waves, displacement, no_uv_map, degenerate_uvs, flattened, object_coordinates, linked_scale, animated_nodes,
     bent_coordinates],
)
def test_in_doubt_the_range_is_everything(scene, material, change):
    plane = cycles.add_plane(scene, material=material)
    assert judged(scene, plane) != EVERYTHING
    change(scene, plane)
    assert judged(scene, plane) == EVERYTHING


def test_groups_around_the_node_change_nothing(scene, material):
    plane = cycles.add_plane(scene, material=material)
    expected = judged(scene, plane)
    tree, node = material.node_tree, surface_node(plane)
    source = node.inputs["Vector"].links[0].from_socket
    for name in ("Inner", "Outer"):
        wrapper = bpy.data.node_groups.new(name, "ShaderNodeTree")
        wrapper.interface.new_socket("Place", in_out="INPUT", socket_type="NodeSocketVector")
        held = wrapper.nodes.new("ShaderNodeGroup")
        held.node_tree = node.node_tree
        wrapper.links.new(wrapper.nodes.new("NodeGroupInput").outputs["Place"], held.inputs[-1])
        tree.nodes.remove(node)
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = wrapper
    tree.links.new(source, node.inputs["Place"])
    assert judged(scene, plane) == expected != EVERYTHING
    # An input that shows its value has that value, and no coordinates.
    tree.links.remove(node.inputs["Place"].links[0])
    assert judged(scene, plane) == EVERYTHING
    node.inputs["Place"].hide_value = True
    assert judged(scene, plane) == expected


def test_without_coordinates_it_is_that_of_the_uv_map(scene, material):
    plane = cycles.add_plane(scene, material=material)
    expected = judged(scene, plane)
    (link,) = surface_node(plane).inputs["Vector"].links
    material.node_tree.links.remove(link)
    assert judged(scene, plane) == expected != EVERYTHING


def keyed(thing, path, *keys):
    """Give a property keys (frame, value); the thing is left as it is at the first."""
    for frame, value in reversed(keys):
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=frame)


def dolly(scene, plane):
    keyed(scene.camera, "location", (1, (0, 0, 3)), (100, (0, 0, 30)))


def dolly_on_a_rig(scene, plane):
    rig = bpy.data.objects.new("Rig", None)
    scene.collection.objects.link(rig)
    scene.camera.parent = rig
    keyed(rig, "location", (1, (0, 0, 0)), (100, (0, 0, 27)))


def object_that_goes(scene, plane):
    plane.rotation_mode = "QUATERNION"
    keyed(plane, "location", (1, (0, 0, 0)), (100, (0, 0, -27)))
    keyed(plane, "rotation_quaternion", (1, (1, 0, 0, 0)), (100, (0, 0, 0, 1)))


@pytest.mark.parametrize("animate", [dolly, dolly_on_a_rig, object_that_goes])
def test_an_animation_counts_at_all_its_frames(scene, material, animate):
    scene.frame_start, scene.frame_end = 1, 100
    plane = cycles.add_plane(scene, 0.5, material=material)
    still = judged(scene, plane)
    before = {thing.name: thing.matrix_world.copy() for thing in scene.objects}
    animate(scene, plane)
    low, high = judged(scene, plane)
    assert low == pytest.approx(still[0], rel=0.01) and high == pytest.approx(10 * still[1], rel=0.05)
    assert all(scene.objects[name].matrix_world == matrix for name, matrix in before.items()), "nothing has moved"
    scene.frame_end = 1
    assert judged(scene, plane) == pytest.approx(still, rel=0.01)


@pytest.mark.parametrize("mode", ["XYZ", "ZYX", "QUATERNION", "AXIS_ANGLE"])
def test_poses_are_where_blender_puts_the_object(scene, mode):
    parent = bpy.data.objects.new("Parent", None)
    child = bpy.data.objects.new("Child", None)
    for index, thing in enumerate((parent, child)):
        scene.collection.objects.link(thing)
        thing.rotation_mode = mode
        path = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}.get(mode, "rotation_euler")
        values = np.random.default_rng(index).uniform(0.2, 1.5, (2, len(getattr(thing, path))))
        keyed(thing, path, (1, values[0]), (20, values[1]))
        keyed(thing, "location", (1, (index, 2, 3)), (20, (4, 5, index)))
    child.parent = parent
    child.matrix_parent_inverse = parent.matrix_basis.inverted()
    frames = [1, 7, 20]
    found = poses(child, frames)
    for frame, matrix in zip(frames, found, strict=True):
        scene.frame_set(frame)
        np.testing.assert_allclose(matrix, np.array(child.matrix_world), atol=1e-5)


def test_what_a_mirror_may_show_has_no_farthest_footprint(scene, material):
    plane = cycles.add_plane(scene, 0.5, material=material)
    direct = judged(scene, plane)
    mirror = cycles.add_plane(scene, 0.1)
    mirror.location = (0, 0, 50)  # behind the camera
    assert judged(scene, plane) == direct, "an object without material is no mirror"
    mirror.data.materials.append(bpy.data.materials.new("Default"))
    low, high = judged(scene, plane)
    # A mirror may show the middle of the view at its edge, where pixels are this much narrower.
    assert high == math.inf and 0.85 * direct[0] < low <= direct[0]
    # Outside the view the mirror shows it all the same.
    plane.location = (20, 0, 0)
    low, high = judged(scene, plane)
    assert high == math.inf and direct[0] < low < 20 * direct[0]
    scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = 0
    assert judged(scene, plane) == NOTHING
    assert judged(scene, plane, mirrored=True) == (low, math.inf)


@pytest.mark.parametrize("kind", ["ShaderNodeBsdfDiffuse", "ShaderNodeEmission"])
def test_what_scatters_widely_shows_nothing(scene, material, kind):
    plane = cycles.add_plane(scene, 0.5, material=material)
    direct = judged(scene, plane)
    plain = bpy.data.materials.new("Plain")
    plain.node_tree.nodes.clear()
    plain.node_tree.nodes.new(kind)
    cycles.add_plane(scene, material=plain)
    assert judged(scene, plane) == direct


def test_a_bowl_shows_in_itself_and_a_ball_does_not(scene, material):
    assert judged(scene, cycles.add_sphere(scene, material=material))[1] < math.inf
    corners = [(-0.5, 0, 0.5), (0, 0, 0), (0.5, 0, 0.5), (-0.5, 1, 0.5), (0, 1, 0), (0.5, 1, 0.5)]
    uvs = [(0, 0), (0.5, 0), (0.5, 1), (0, 1), (0.5, 0), (1, 0), (1, 1), (0.5, 1)]
    bowl = cycles.add_mesh(scene, corners, [(0, 1, 4, 3), (1, 2, 5, 4)], uvs=uvs, material=material)
    bpy.data.objects.remove(bpy.data.objects["Sphere"])
    assert judged(scene, bowl)[1] == math.inf


def test_slivers_of_a_mesh_do_not_widen_the_range(scene, material):
    plane = cycles.add_plane(scene, 1.0, material=material)
    expected = judged(scene, plane)
    bpy.data.objects.remove(plane)
    square = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]
    sliver = [(0, 0, 0), (1e-3, 0, 0), (0, 1e-3, 0)]
    uvs = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (9, 0), (0, 1e-6)]
    both = cycles.add_mesh(scene, square + sliver, [(0, 1, 2, 3), (4, 5, 6)], uvs=uvs, material=material)
    assert judged(scene, both) == pytest.approx(expected)


def test_all_objects_cameras_and_uv_maps_widen_the_range(scene, material):
    plane = cycles.add_plane(scene, 0.5, material=material)
    first = judged(scene, plane)
    far = cycles.add_plane(scene, 0.5, material=material)
    far.location.z = -6
    # Both have glints, so one might show the other, unless nothing is mirrored at all.
    scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = 0
    both = judged(scene, plane, far)
    assert both[0] == first[0] and both[1] == pytest.approx(3 * first[1], rel=0.1)
    near = cycles.add_camera(scene, (0, 0, 1))
    assert near != scene.objects["Camera"]
    assert judged(scene, plane, far)[0] == pytest.approx(first[0] / 3, rel=0.1)


@pytest.mark.parametrize("interpolation", ["CLOSEST", "LINEAR"])
def test_the_levels_are_those_of_the_blocks_that_the_shader_takes(interpolation):
    every = counts_levels(4096, 4096, interpolation)
    first = every[0]

    def reached(smallest, largest):
        return counts_levels_reached((smallest, largest), 4096, 4096, interpolation)

    assert reached(0, math.inf) == (first, every[-1])
    assert reached(math.inf, 0) is None
    assert reached(1, 0.99 * first / 2.5) is None
    # The smallest blocks serve near footprints, or the next, if their bins are too wide.
    assert reached(1, 1.01 * first / 2.5) == (first, 2 * first)
    # Twice 2.0 times the footprint is 3.4 blocks.
    assert reached(1, 1.01 * first / 1.2) == (first, 2 * first)
    assert reached(3.9 * first / 0.7, 4 * first / 0.7) == (2 * first, 16 * first)
    assert reached(1e9, 1e9) == (every[-1], every[-1])


HEADERS = ("table.h", "normal_frame.h", "footprint.h", "light_hint.h", "map.h", "selection.h", "query.h", "counts.h")
FAR_BLOCKS = """
  Footprint footprint;
  footprint.ux = in[0];
  footprint.uy = in[1];
  footprint.vx = in[2];
  footprint.vy = in[3];
  footprint.long_axis = in[4];
  footprint.short_axis = in[5];
  for (int k = 0; k < 2; ++k) {
    Counts counts;
    counts.first = (int)in[6 + 2 * k];
    counts.levels = (int)in[7 + 2 * k];
    out[k] = far_block(counts, footprint, WIDEST);
  }
"""


@pytest.mark.parametrize("widest", ["FAR_SIDE_FIRST", "FAR_SIDE_SUBSET"])
@pytest.mark.parametrize("interpolation", ["CLOSEST", "LINEAR"])
def test_with_the_levels_of_its_footprint_a_sample_takes_the_blocks_that_it_takes_with_all(interpolation, widest):
    every = counts_levels(4096, 4096, interpolation)
    rng = np.random.default_rng(5)
    short = 10 ** rng.uniform(0.5, 4.0, ROWS)
    long = short * 10 ** rng.uniform(0.0, 1.5, ROWS)
    angle = rng.uniform(0, np.pi, ROWS)
    axes = [long * np.cos(angle), -short * np.sin(angle), long * np.sin(angle), short * np.cos(angle)]
    reached = [counts_levels_reached((size, size), 4096, 4096, interpolation) for size in short]
    ends = [levels or (0, 0) for levels in reached]
    baked = [(first, every.index(last) - every.index(first) + 1) if last else (0, 0) for first, last in ends]
    rows = np.column_stack([*axes, long, short, np.tile([every[0], len(every)], (ROWS, 1)), baked])
    with_all, with_some = evaluate(HEADERS, FAR_BLOCKS.replace("WIDEST", widest), rows, 2).T
    np.testing.assert_array_equal(with_some, with_all)
    assert 0.1 < (with_all == 0).mean() < 0.9 and len(np.unique(with_all)) == len(every) + 1
    # One level up is there too, for narrower bins.
    above = np.minimum(2 * with_all, every[-1])
    assert (above <= [last for _, last in ends]).all()


def test_a_map_smaller_than_a_block_has_one_level():
    assert counts_levels_reached(EVERYTHING, 32, 16, "LINEAR") == (16, 16)


def test_constants_are_those_of_the_shader():
    assert (footprints.FOOTPRINT_SCALE, footprints.FOOTPRINT_EXPONENT) == (
        reference.FOOTPRINT_SCALE, reference.FOOTPRINT_EXPONENT)
    headers = ("counts_table.h", "counts.h")
    counts = "".join(paths.shader_file(name).read_text(encoding="utf-8") for name in headers)
    for name in ("FAR_SIDE", "FAR_SIDE_SUBSET", "FAR_SIDE_LONG"):
        assert f"#define {name} {getattr(footprints, name)}\n" in counts
    assert f"FAR_SIDE_LONG : {footprints.NARROWER_BINS} * widest)" in counts
