"""Footprints that know the pixel grid: their numbers, where they are used, and that no light is gained or lost."""

from __future__ import annotations

import re

import bpy
import numpy as np
import pytest

from benchmarks import footprint_law
from demo_scenes import maps
from glint_addon.materials.create import create_glint_material
from glint_addon.nodes.driven import write_number
from glint_addon.nodes.glint_bsdf import GRID_NODE, PIXEL_GRID
from glint_addon.nodes.map_tables import SCRIPT_NODE
from glint_addon.paths import shader_file
from glint_addon.prepare.scene import prepare_scene
from tests.helpers import cycles
from tests.helpers.osl_functions import evaluate
from tests.helpers.osl_plane import CAMERA_DISTANCE, ROWS, SIDE
from tests.helpers.seeds import rendered_seeds
from tests.reference import footprint
from tests.reference import pixel_grid as twin

HEADERS = ("footprint.h", "pixel_grid.h")
FAST_MATH = 2e-5  # OSL's exp2 and log2
ROUNDING = 1e-5
SIZE = 16


# --- pixel_grid.h ---


def test_the_grid_of_samples_anywhere_in_the_picture():
    rng = np.random.default_rng(1)
    at = rng.uniform(0, 100, (ROWS, 2)).astype(np.float32)
    at[:40] = np.floor(at[:40]) + twin.GRID_MIDDLE + rng.uniform(-1e-3, 1e-3, (40, 2))  # first samples of a pixel
    samples = 2.0 ** rng.uniform(0, 13, ROWS).astype(np.float32)
    body = """
      PixelGrid grid = pixel_grid(in[0], in[1], in[2]);
      out[0] = grid.is_known; out[1] = grid.radius_x; out[2] = grid.radius_y; out[3] = grid.widest;
      out[4] = grid.total; out[5] = grid_place(in[0]);
    """
    osl = evaluate(HEADERS, body, np.column_stack([at, samples]), 6)
    known, grid = twin.pixel_grid(at.astype(float), samples.astype(float))
    np.testing.assert_array_equal(osl[:, 0] != 0, known)
    expected = np.column_stack([grid.radius, grid.widest, grid.total])
    # A place is a difference of numbers of up to a hundred, float32.
    np.testing.assert_allclose(osl[:, 1:5], expected, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(osl[:, 5], twin.grid_place(at[:, 0].astype(float)), atol=1e-5)
    assert (osl[:40, 4] == 1).all() and (osl[:, 1:3].max(axis=1) <= osl[:, 3] * (1 + FAST_MATH)).all()


def test_the_numbers_between_two_entries_of_a_table():
    places = np.linspace(0, 8, ROWS, dtype=np.float32)
    body = f"float table[9] = {{ {', '.join(map(str, twin.NUMBERS[0]))} }}; out[0] = grid_number(table, in[0]);"
    osl = evaluate(HEADERS, body, places[:, None], 1)
    np.testing.assert_allclose(osl[:, 0], np.interp(places, np.arange(9), twin.NUMBERS[0]), rtol=ROUNDING)


def test_footprints_follow_the_pixel_axes_on_the_surface():
    """The plane of `evaluate` faces the camera, whose pixels are 1 / SIDE wide on it."""
    body = """
      Matrix2 surface;
      out[0] = grid_on_surface(in[0], in[1], surface);
      vector across = surface.xx * Dx(P) + surface.yx * Dy(P);
      vector up = surface.xy * Dx(P) + surface.yy * Dy(P);
      PixelGrid grid = grid_here(64.0);
      out[1] = grid.is_known; out[2] = grid.total;
      for (int k = 0; k < 3; ++k) { out[3 + k] = across[k]; out[6 + k] = up[k]; }
    """
    radius = np.random.default_rng(2).uniform(0.1, 1.5, (ROWS, 2)).astype(np.float32)
    osl = evaluate(HEADERS, body, radius, 9, rotation=(0.2, 0.3, 0.4))
    assert (osl[:, 0] == 1).all() and CAMERA_DISTANCE > 0
    assert (osl[:, 1:3] == 1).all(), "a pixel's only sample lies in its middle"
    np.testing.assert_allclose(np.linalg.norm(osl[:, 3:6], axis=1), radius[:, 0] / SIDE, rtol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(osl[:, 6:9], axis=1), radius[:, 1] / SIDE, rtol=2e-3)
    square = np.einsum("nk,nk->n", osl[:, 3:6], osl[:, 6:9]) * SIDE**2
    np.testing.assert_allclose(square, 0, atol=1e-3)


@pytest.mark.parametrize("samples", [4, 8, 16, 24, 64, 100, 256, 1024])
def test_the_totals_of_a_pixels_samples_have_the_mean_one(samples):
    rng = np.random.default_rng(samples)
    totals = []
    for _ in range(max(2048 // samples, 4)):
        at = footprint_law.pixel_samples(samples, rng)
        at[0] = 0.0  # as in Cycles
        totals.append(twin.pixel_grid(at + twin.GRID_MIDDLE, np.full(samples, float(samples)))[1].total.mean())
    assert abs(np.mean(totals) - 1.0) < 0.005
    assert np.std(totals) < 0.01, "an even surface stays even"


@pytest.mark.parametrize(("samples", "gain"), [(4, 0.85), (16, 0.94), (64, 0.88), (256, 0.85)])
def test_a_single_glint_is_seen_better_than_through_round_footprints(samples, gain):
    plain = footprint_law.errors(samples, (footprint.footprint_radius(float(samples)),), scrambles=8)[0]
    assert footprint_law.grid_errors(samples, scrambles=8) < gain * plain


def test_the_constants_are_those_of_the_twin():
    header = shader_file("pixel_grid.h").read_text(encoding="utf-8")
    defined = {name: float(value) for name, value in re.findall(r"^#define (\w+) ([\d.e-]+)$", header, re.MULTILINE)}
    own = {name: value for name, value in vars(twin).items() if name.startswith("GRID_")}
    assert len(own) == 7 and own.items() <= defined.items()


# --- Where it is used ---


def stage(*, angle=0.5, interpolation="CLOSEST", repeats=2.0, extension="REPEAT"):
    """A sheet of sparse flakes under a sun in a glint material, prepared: (scene, group of the material)."""
    scene = cycles.empty_scene(size=(SIZE, SIZE), spp=16)
    image = maps.blender_image("Flakes", maps.flakes(128, std=0.12, seed=3))
    material = create_glint_material("Glint", image, roughness=0.2, interpolation=interpolation)
    group = next(node.node_tree for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeGroup")
    cycles.add_plane(scene, 2.0, repeats=repeats, material=material)
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=angle)
    cycles.add_sun(scene, (0.05, 1, 1), angle=0.01)
    prepare_scene(scene)
    return scene, group


def grids(scene, group, seeds=1):
    """Pictures without and with the grid (2, seeds, rows, columns)."""
    value = group.nodes[GRID_NODE].outputs[0]
    pictures = []
    for number in (0.0, 1.0):
        write_number(value, number)
        pictures.append(rendered_seeds(scene, scene.cycles.samples, seeds)[..., 0])
    write_number(value, PIXEL_GRID)
    return np.array(pictures, np.float64)


def driven_value(scene, group):
    """What the scene that is being rendered gives the node."""
    scene.update_tag()
    scene.frame_set(scene.frame_current)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return group.evaluated_get(depsgraph).nodes[GRID_NODE].outputs[0].default_value


@pytest.mark.parametrize(("interpolation", "gain"), [("CLOSEST", 0.95), ("LINEAR", 1.0)])
@pytest.mark.parametrize("samples", [16, 64])
def test_the_picture_keeps_its_light_and_has_less_noise(interpolation, gain, samples):
    scene, group = stage(interpolation=interpolation)
    scene.cycles.samples = samples
    plain, grid = grids(scene, group, seeds=4)
    assert abs(grid.mean() / plain.mean() - 1.0) < 0.01
    # Patches are drawn at random (SURE_WEIGHT), which leaves its own noise.
    assert grid.std(axis=0).mean() < gain * plain.std(axis=0).mean()


@pytest.mark.parametrize("change", ["crop", "border", "orthographic"])
def test_the_grid_is_that_of_the_whole_picture(change):
    scene, group = stage()
    if change == "orthographic":
        scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 1.2
    else:
        scene.render.use_border = True
        scene.render.use_crop_to_border = change == "crop"
        scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.875
        scene.render.border_min_y, scene.render.border_max_y = 0.125, 0.75
    plain, grid = grids(scene, group, seeds=4)
    assert abs(grid.mean() / plain.mean() - 1.0) < 0.015
    assert grid.std(axis=0).mean() < 0.95 * plain.std(axis=0).mean()


def test_rays_that_do_not_come_straight_from_the_camera_keep_round_footprints():
    scene, group = stage()
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_distance = 1.0
    scene.camera.data.dof.aperture_fstop = 0.5
    plain, grid = grids(scene, group)
    np.testing.assert_array_equal(grid, plain)


def test_a_mirror_shows_round_footprints():
    scene, group = stage()
    glossy = bpy.data.materials.new("Mirror")
    tree = glossy.node_tree
    tree.nodes.clear()
    closure, output = tree.nodes.new("ShaderNodeBsdfAnisotropic"), tree.nodes.new("ShaderNodeOutputMaterial")
    closure.inputs["Roughness"].default_value = 0.0
    tree.links.new(closure.outputs[0], output.inputs["Surface"])
    # Between the camera and the sheet, facing the sheet's mirror image behind it.
    mirror = cycles.add_plane(scene, 6.0, material=glossy)
    mirror.location = (0, 0, 3)
    scene.camera.location.z, scene.camera.rotation_euler.x = 1.0, np.pi - scene.camera.rotation_euler.x
    plain, grid = grids(scene, group)
    assert plain.max() > 0
    np.testing.assert_array_equal(grid, plain)


def test_maps_that_do_not_repeat_keep_round_footprints():
    scene, group = stage()
    group.nodes[SCRIPT_NODE].inputs["Repeats"].default_value = 0
    plain, grid = grids(scene, group)
    np.testing.assert_array_equal(grid, plain)


def test_other_filters_moving_cameras_and_panoramas_keep_round_footprints():
    scene, group = stage()
    assert driven_value(scene, group) == 1.0
    for owner, name, value in (
        (scene.cycles, "pixel_filter_type", "GAUSSIAN"), (scene.cycles, "pixel_filter_type", "BOX"),
        (scene.cycles, "filter_width", 2.0), (scene.cycles, "filter_width", 1.0),
        (scene.render, "use_motion_blur", True), (scene.camera.data, "type", "PANO"),
    ):
        before = getattr(owner, name)
        setattr(owner, name, value)
        assert driven_value(scene, group) == 0.0, f"{name} = {value}"
        setattr(owner, name, before)
        assert driven_value(scene, group) == 1.0
    scene.camera.data.type = "ORTHO"
    assert driven_value(scene, group) == 1.0
    scene.camera = None
    assert driven_value(scene, group) == 0.0


def test_the_sample_count_may_change_from_frame_to_frame():
    scene, group = stage()
    means = []
    for samples in (2, 4, 7, 8, 50):
        scene.cycles.samples = samples
        means.append(grids(scene, group, seeds=8).mean(axis=(1, 2, 3)))
    plain, grid = np.array(means).T
    np.testing.assert_allclose(grid, plain, rtol=0.02)
    assert grid[0] == plain[0], "below four samples footprints are round"
