"""Stress of images and of what several materials and scenes share: files, formats, texture settings, color spaces."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
import pytest

import glint_addon
from demo_scenes import maps
from demo_scenes.truth import truth_material
from glint_addon.errors import MapError
from glint_addon.materials.find import is_glint_material
from tests.helpers import cycles
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress

pytestmark = stress("every way to keep a map against Blender's nodes", fast=[
    "prepare/test_prepared_render.py::test_a_texture_size_limit_leaves_blenders_own_nodes_or_a_whole_table",
    "stress/test_one_of_each.py::test_a_case_of_each_group_agrees_with_blenders_nodes",
])

SUN = math.radians(4)  # so large that Blender's nodes find it
SIDE = 64  # texels


def stage(scene, material):
    """A square under a slanted camera, about nine texels a pixel, and a sun."""
    square = cycles.add_plane(scene, 4.0, material=material, repeats=4.0)
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    cycles.add_sun(scene, (0, 1, 1), angle=SUN)
    return square


def pixels(side=SIDE):
    """Encoded smooth bumps of `side` texels, RGBA: (side, side, 4)."""
    normals = maps.bumps(side, std=0.08, width=3.0, seed=4)
    return np.concatenate([normals, np.ones_like(normals[..., :1])], axis=-1)


def write(file, rgba, file_format="PNG", depth="8", mode="RGBA"):
    """Write `rgba` (height, width, 4) as data to a file of this format, bits and channels; returns the file."""
    height, width = rgba.shape[:2]
    image = bpy.data.images.new("Source", width, height, alpha=True, float_buffer=True, is_data=True)
    image.pixels.foreach_set(rgba.astype(np.float32).ravel())
    scene = bpy.data.scenes.new("Writer")
    try:
        settings = scene.render.image_settings
        settings.file_format, settings.color_mode, settings.color_depth = file_format, mode, depth
        scene.view_settings.view_transform = "Raw"
        image.save_render(str(file), scene=scene)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.images.remove(image)
    return file


def loaded(file):
    """The image data-block of a file, as data."""
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = "Non-Color"
    return image


FORMATS = {
    "8-bit PNG": ("PNG", "8", "RGB"),
    "16-bit PNG": ("PNG", "16", "RGB"),
    "half EXR": ("OPEN_EXR", "16", "RGB"),
    "float EXR": ("OPEN_EXR", "32", "RGB"),
    "grey 8-bit PNG": ("PNG", "8", "BW"),
    "grey 16-bit TIFF": ("TIFF", "16", "BW"),
}


@pytest.mark.parametrize("name", FORMATS)
def test_file_format(stress_record, tmp_path, name):
    # A grey map has equal channels: all its normals lean one way, and some lie below the horizon.
    lit = not name.startswith("grey")
    compare(stress_record, stage, lit=lit,
            normal_map=lambda: loaded(write(tmp_path / "map.image", pixels(), *FORMATS[name])))


@pytest.mark.parametrize("alpha_mode", ["STRAIGHT", "CHANNEL_PACKED"])
def test_half_transparent_map(stress_record, tmp_path, alpha_mode):
    rgba = pixels()
    rgba[::2, ::3, 3] = 0.4

    def image():
        block = loaded(write(tmp_path / "map.png", rgba))
        block.alpha_mode = alpha_mode
        return block

    compare(stress_record, stage, normal_map=image)


def test_map_with_nothing_but_alpha(stress_record, tmp_path):
    rgba = np.zeros((8, 8, 4))
    rgba[..., 3] = np.random.default_rng(1).random((8, 8))
    with pytest.raises(MapError, match="no pixel that faces up") as error:
        glint_addon.create_glint_material("Glint", loaded(write(tmp_path / "map.png", rgba)))
    stress_record(outcome=f"refused: {error.value}")


@pytest.mark.parametrize("way", ["packed", "relative path"])
def test_image_kept_with_the_file(stress_record, tmp_path, way):
    def image():
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
        block = loaded(write(tmp_path / "map.png", pixels()))
        if way == "packed":
            block.pack()
            (tmp_path / "map.png").unlink()
        else:
            block.filepath = bpy.path.relpath(block.filepath)
            assert block.filepath == "//map.png"
        return block

    outcome = compare(stress_record, stage, normal_map=image)
    assert {Path(table).parent for table in outcome.report["baked"]} == {tmp_path / "glint_tables"}
    assert outcome.report["hints"] == ["Sun"]


def test_file_that_is_gone_after_baking(stress_record, tmp_path):
    def build(scene, material):
        stage(scene, material)
        if is_glint_material(material):
            glint_addon.prepare_scene(scene)
            (image,) = bpy.data.images
            (tmp_path / "map.png").unlink()
            image.reload()

    outcome = compare(stress_record, build, normal_map=lambda: loaded(write(tmp_path / "map.png", pixels())))
    assert len(outcome.report["reused"]) == 2  # the normals and their counts
    assert any("missing" in warning for warning in outcome.report["warnings"])


def test_two_materials_on_one_map(stress_record):
    def build(scene, material):
        square = stage(scene, material)
        square.location.x = -2
        (image,) = bpy.data.images
        make = glint_addon.create_glint_material if is_glint_material(material) else truth_material
        other = make("Other", image, roughness=0.3, distribution="GGX")
        cycles.add_plane(scene, 4.0, material=other, repeats=4.0).location.x = 2

    outcome = compare(stress_record, build)
    tables = outcome.report["baked"] + outcome.report["reused"]
    # Of normals, and of counts because each square might mirror the other.
    assert len(tables) == 4 and all(tables.count(table) == 2 for table in tables), "the same for both"


@pytest.mark.parametrize("last", ["this scene", "the other scene"])
def test_one_material_in_two_scenes(stress_record, last):
    """Hints of another scene's lights only cost noise, so the other one's sun is elsewhere."""
    def build(scene, material):
        square = stage(scene, material)
        other = bpy.data.scenes.new("Other")
        cycles.set_up_cycles(other)
        other.collection.objects.link(square)
        other.camera = scene.camera
        cycles.add_sun(other, (1, 0.2, 1), angle=SUN)
        for prepared in (other, scene) if last == "this scene" else (scene, other):
            glint_addon.prepare_scene(prepared)

    compare(stress_record, build, prepare=False, lobe=(64, 2))


@pytest.mark.parametrize("side", [SIDE, 256])
@pytest.mark.parametrize("setting", [("texture_limit_render", "128"), ("texture_resolution_render", 0.5)],
                         ids=["limit 128", "half resolution"])
def test_simplified_textures(stress_record, setting, side):
    # Where the table would be shrunk too, the answer is Blender's own nodes', which read a smaller map.
    def build(scene, material):
        stage(scene, material)
        scene.render.use_simplify = True
        setattr(scene.cycles, *setting)

    outcome = compare(stress_record, build, normal_map=pixels(side)[..., :3], lobe=(256, 2))
    assert any("Simplify" in warning for warning in outcome.report["warnings"])


@pytest.mark.parametrize("generate", [False, True], ids=["existing files", "files made on demand"])
def test_texture_cache(stress_record, tmp_path, generate):
    """The nodes read filtered normals then, so the truth is rendered without it; the table stays what it is."""
    def build(scene, material):
        stage(scene, material)
        scene.render.use_texture_cache = is_glint_material(material)
        scene.render.use_auto_generate_texture_cache = generate

    outcome = compare(stress_record, build, normal_map=lambda: loaded(write(tmp_path / "map.png", pixels())))
    assert outcome.report["hints"] == ["Sun"]
    assert any(tmp_path.rglob("*.tx")) == generate, "Cycles keeps its cache beside the image"


@pytest.mark.parametrize("space", ["ACEScg", "Linear Rec.2020"])
def test_working_space(stress_record, tmp_path, space):
    def image():
        # First of all: Blender refuses while images are not saved.
        bpy.ops.wm.set_working_color_space(working_space=space, convert_colors=False)
        assert bpy.data.colorspace.working_space == space
        return loaded(write(tmp_path / "map.exr", pixels(), "OPEN_EXR", "32"))

    try:
        compare(stress_record, stage, normal_map=image)
    finally:
        cycles.empty_scene()
    assert bpy.data.colorspace.working_space == "Linear Rec.709"
