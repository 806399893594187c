"""Glints in mirrors, behind glass and on diffuse neighbours; neighbours that do not show them."""

from __future__ import annotations

import math
from functools import partial

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from benchmarks.counters import MODES, counters, show
from demo_scenes import maps, stage
from demo_scenes.measure import luminance
from demo_scenes.truth import truth_material
from glint_addon import create_glint_material, prepare_scene
from glint_addon.nodes.driven import driver_curve
from glint_addon.nodes.glint_bsdf import CAUSTICS_NODE, GRID_NODE, WAY_NODE, build, refresh
from tests.helpers import cycles
from tests.helpers.old_group import make_old
from tests.helpers.seeds import rendered_seeds
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import SUN_ANGLE, add_sky, diffuse_material

SHARP = 0.005  # radians: a sun whose random points make no noise
LARGEST_Z = 5.0
FLOOR = 0.02  # relative: the footprint's blur across edges
ROUGHNESS = 0.25
# Smallest share of two renders' glints that must agree pixel by pixel (correlation).
SAME_GLINTS = 0.97
# Counters are whole numbers of a sample each; a mirrored ray meets the surface a rounding away from the direct one.
SAME_VISITS = 0.02
# Facets so sharp that their glints on a neighbour are fireflies: of 16 pictures of 64 samples the worst pixel is 6.2
# with Blender's nodes and 2.5 with the lobe (Linear), 5.4 and 2.3 (Closest); the noise 0.49 and 0.16, 0.48 and 0.19.
FIREFLY_ROUGHNESS = 0.1
WORST_PIXEL = 0.6
CAUSTIC_Z = 4.0
LARGEST_DEVIATION = 0.01  # relative


def glinting_square(material_of=create_glint_material, *, std=0.08, roughness=ROUGHNESS, size=(16, 16), repeats=4.0):
    """A square of 4 metres in an empty scene: (scene, square, material)."""
    scene = cycles.empty_scene(size=size)
    image = maps.blender_image("Map", maps.bumps(64, std=std, width=3.0, seed=4))
    material = material_of("Surface", image, roughness=roughness)
    return scene, cycles.add_plane(scene, 4.0, material=material, repeats=repeats), material


def look(scene, place, angle=SUN_ANGLE):
    """Look from `place` (metres) at the origin, with a sun behind it that the square mirrors."""
    cycles.add_camera(scene, place, (0, 0, 0), angle=0.3)
    cycles.add_sun(scene, (0, 1, 1), angle=angle)


def look_through_a_mirror(scene, place, angle):
    """The same view by way of an upright mirror half-way, left and right exchanged."""
    look(scene, place, angle)
    mirror = cycles.add_plane(scene, 3.0, material=stage.glossy_material("Mirror", roughness=0.0))
    # It stands between the camera's place and the origin, turned by 45 degrees about the vertical axis.
    middle = tuple(0.5 * number for number in place)
    mirror.matrix_world = Matrix.Translation(middle) @ Matrix.Rotation(math.pi / 4, 4, "Z") @ Matrix.Rotation(
        math.pi / 2, 4, "X")
    mirror.visible_shadow = mirror.visible_diffuse = False
    bpy.context.view_layer.update()
    normal = mirror.matrix_world.col[2].to_3d().normalized()
    reflection = Matrix.Identity(3) - 2 * Matrix([[a * b for b in normal] for a in normal])
    camera = scene.camera
    offset = camera.matrix_world.translation - mirror.matrix_world.translation
    axes = reflection @ camera.matrix_world.to_3x3()
    axes.col[0] = -axes.col[0]  # a camera cannot be mirrored: its picture is
    camera.matrix_world = Matrix.Translation(mirror.matrix_world.translation + reflection @ offset) @ axes.to_4x4()


def test_a_mirror_shows_the_glints_and_footprints_of_the_unfolded_view():
    """Slow: four renders, each with a shader of its own."""
    place = (0, -2, 2)
    pictures, visits = [], []
    for view in (look, look_through_a_mirror):
        scene, _, material = glinting_square(std=0.15, roughness=0.15)
        cycles.box_filter(scene, 0.01)  # the same points of the square
        view(scene, place, SHARP)
        assert prepare_scene(scene, bake_unseen=True)["hints"] == ["Sun"]
        picture = luminance(cycles.rendered(scene))
        pictures.append(picture if view is look else picture[:, ::-1])
        if view is look:
            visits.append(counters(scene, material).visited)
            continue
        (group,) = (node.node_tree for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
        show(group, "Counters")
        bpy.data.lights["Sun"].color = (0, 0, 0)
        shown = cycles.rendered(scene)[:, ::-1]
        visits.append(shown[..., 0])
        assert (shown[..., 2] >= min(mode for mode, name in MODES.items() if name == "ALL")).all()
    direct, mirrored = pictures
    assert direct.std() > 0.3 * direct.mean(), "there must be glints to compare"
    assert np.corrcoef(direct.ravel(), mirrored.ravel())[0, 1] > SAME_GLINTS
    assert mirrored.mean() == pytest.approx(direct.mean(), rel=FLOOR)
    np.testing.assert_allclose(visits[1].mean(), visits[0].mean(), rtol=SAME_VISITS)


def assert_same_mean(nodes, lobe):
    """Z-test of the mean luminance of pictures (seeds, rows, columns)."""
    deviation = math.hypot(*(math.sqrt(side.var(axis=0, ddof=1).mean() / side.size) for side in (nodes, lobe)))
    difference = lobe.mean() - nodes.mean()
    assert nodes.mean() > 0
    assert abs(difference) < LARGEST_Z * deviation + FLOOR * nodes.mean(), f"{lobe.mean()} and {nodes.mean()}"


def pictures_of(build, nodes, lobe):
    """Luminance of renders of build(material_of) with Blender's nodes and with the lobe; nodes, lobe: (spp, seeds)."""
    scene = build(truth_material)
    scene.cycles.shading_system = False
    first = luminance(rendered_seeds(scene, *nodes))
    scene = build(create_glint_material)
    assert prepare_scene(scene, bake_unseen=True)["hints"] == ["Sun"]
    return first, luminance(rendered_seeds(scene, *lobe))


def behind_glass(material_of):
    scene, _, _ = glinting_square(material_of)
    look(scene, (0, -2, 2))
    glass = cycles.add_plane(scene, 1.5, material=stage.glossy_material("Glass", roughness=0.0))
    tree = glass.material_slots[0].material.node_tree
    pane = tree.nodes.new("ShaderNodeBsdfRefraction")
    pane.inputs["Roughness"].default_value, pane.inputs["IOR"].default_value = 0.0, 1.0
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(pane.outputs["BSDF"], output.inputs["Surface"])
    glass.matrix_world = scene.camera.matrix_world @ Matrix.Translation((0, 0, -1))
    glass.visible_shadow = False
    return scene


def in_a_bent_mirror(material_of):
    scene, square, _ = glinting_square(material_of)
    square.rotation_euler = (math.pi, 0, 0)
    square.location.z = 2.0
    cycles.add_camera(scene, (0, -2, 1), (0, 0, 0), angle=0.3)
    cycles.add_sun(scene, (0, 1, -1), angle=SUN_ANGLE)
    cycles.add_sphere(scene, 0.5, material=stage.glossy_material("Mirror", roughness=0.0))
    return scene


def caustic(material_of, *, roughness=ROUGHNESS, interpolation="LINEAR"):
    """A diffuse floor that an upright glint wall lights, without Blender's own filter of glossy light."""
    material_of = partial(material_of, interpolation=interpolation)
    scene, square, _ = glinting_square(material_of, roughness=roughness, repeats=8.0)
    square.location, square.rotation_euler = (0, 1, 2), (math.pi / 2, 0, 0)
    cycles.add_plane(scene, 6.0, material=diffuse_material())
    cycles.add_camera(scene, (0, -0.2, 3), (0, 0, 0), width=1.6)
    cycles.add_sun(scene, (0, -1, 1), angle=SUN_ANGLE)
    scene.cycles.blur_glossy = 0.0
    scene.cycles.caustics_reflective = True
    return scene


@pytest.mark.parametrize("build", [behind_glass, in_a_bent_mirror, caustic])
def test_what_other_surfaces_show_of_glints_has_the_mean_of_the_nodes(build):
    assert_same_mean(*pictures_of(build, (1024, 2), (64, 2)))


BOUNCE = stress("thousands of samples in 16 seeds", fast=[
    "osl/test_secondary_rays.py::test_what_other_surfaces_show_of_glints_has_the_mean_of_the_nodes",
])


@BOUNCE
@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
def test_after_a_diffuse_bounce_the_worst_pixel_is_far_below_that_of_the_nodes_at_equal_samples(interpolation):
    build = partial(caustic, roughness=FIREFLY_ROUGHNESS, interpolation=interpolation)
    nodes, lobe = pictures_of(build, (64, 16), (64, 16))
    assert lobe.max() < WORST_PIXEL * nodes.max()
    assert lobe.std(axis=0).mean() < WORST_PIXEL * nodes.std(axis=0).mean()


@BOUNCE
@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
def test_after_a_diffuse_bounce_the_light_of_all_glints_is_that_of_the_nodes(interpolation):
    build = partial(caustic, roughness=FIREFLY_ROUGHNESS, interpolation=interpolation)
    nodes, lobe = pictures_of(build, (2048, 16), (384, 16))
    deviation = math.hypot(*(side.mean(axis=(1, 2)).std(ddof=1) / len(side) ** 0.5 for side in (nodes, lobe)))
    assert deviation < LARGEST_DEVIATION * nodes.mean(), "noise would hide a bias"
    assert abs(lobe.mean() - nodes.mean()) < CAUSTIC_Z * deviation


UNFILTERED = {"blur_glossy": 0.0, "caustics_reflective": True}


@pytest.mark.parametrize(
    ("change", "expected"), [({}, 1), ({"blur_glossy": 0.5}, 0), ({"caustics_reflective": False}, 0)]
)
def test_the_switch_of_caustics_follows_the_scene_that_is_rendered(change, expected):
    scene, _, material = glinting_square()
    other = scene.copy()  # whose switches are Blender's own
    for name, value in (UNFILTERED | change).items():
        setattr(scene.cycles, name, value)
    (group,) = (node.node_tree for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    assert driver_curve(group.nodes[CAUSTICS_NODE].outputs["Value"]).driver.is_simple_expression
    for each, value in ((scene, expected), (other, 0), (scene, expected)):
        with bpy.context.temp_override(scene=each, view_layer=each.view_layers[0]):
            graph = bpy.context.evaluated_depsgraph_get()
            switch = group.evaluated_get(graph).nodes[CAUSTICS_NODE].outputs["Value"]
            assert switch.default_value == value


def test_a_group_of_an_older_version_gets_the_switches_and_a_driver_each(scene):
    group = build()
    group.nodes.remove(group.nodes[CAUSTICS_NODE])
    for _ in range(2):
        make_old(group)
        refresh(group)
        curves = [driver_curve(group.nodes[name].outputs["Value"]) for name in (CAUSTICS_NODE, WAY_NODE, GRID_NODE)]
        drivers = list(group.animation_data.drivers)
        assert len(drivers) == 3 and all(curve in drivers for curve in curves)
        assert [len(curve.driver.variables) for curve in curves] == [2, 2, 4]


def fog(material):
    tree = material.node_tree
    tree.nodes.clear()
    volume = tree.nodes.new("ShaderNodeVolumePrincipled")
    volume.inputs["Density"].default_value = 1.0
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(volume.outputs["Volume"], output.inputs["Volume"])


def skin(material):
    tree = material.node_tree
    tree.nodes.clear()
    scatter = tree.nodes.new("ShaderNodeSubsurfaceScattering")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(scatter.outputs["BSSRDF"], output.inputs["Surface"])


@pytest.mark.parametrize("neighbour", [fog, skin])
def test_a_neighbour_that_sees_no_glints_is_the_same_to_a_rounding(neighbour):
    """A ball in front of the lights' side of the square: the square is in the scene, prepared, and out of its sight."""
    pictures = []
    for material_of in (truth_material, create_glint_material):
        scene, square, _ = glinting_square(material_of)
        square.location.z = -5.0
        square.visible_diffuse = square.visible_volume_scatter = square.visible_transmission = False
        ball = cycles.add_sphere(scene, 0.5, material=diffuse_material(), segments=16, rings=8)
        neighbour(ball.material_slots[0].material)
        cycles.add_camera(scene, (0, -3, 0.5), (0, 0, 0), width=0.8)
        cycles.add_sun(scene, (0, -1, 1), angle=SUN_ANGLE)
        add_sky(scene, 0.2)
        if material_of is create_glint_material:
            prepare_scene(scene, bake_unseen=True)
        scene.cycles.samples = 4
        pictures.append(cycles.rendered(scene))
    assert pictures[0][..., :3].max() > 0
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-4, atol=1e-4)
