"""Image data-blocks as normal maps: their pixels are those Cycles shows; what cannot be used is refused in words."""

import bpy
import numpy as np
import pytest

from glint_addon.errors import MapError
from glint_addon.images import image_pixels, image_stamp, normal_map_image
from tests.helpers import cycles
from tests.helpers.extension import data_names, write_flake_map

SIZE = 16
BYTE = 1 / 255


@pytest.fixture
def flake_map(scene, tmp_path):
    return write_flake_map(tmp_path / "flakes.png", SIZE)


def new_image(name="Painted", size=(SIZE, SIZE), *, is_float=False, is_data=True, fill=(0.5, 0.5, 1.0, 1.0)):
    """A generated image of one colour, but for a first texel that differs."""
    image = bpy.data.images.new(name, *size, float_buffer=is_float, is_data=is_data, alpha=True)
    pixels = np.tile(np.float32(fill), (size[0] * size[1], 1))
    pixels[0, :3] = (0.75, 0.5, 0.75)
    image.pixels.foreach_set(pixels.ravel())
    return image


def refusal(function, *arguments) -> str:
    """The sentence of a MapError that leaves the file as it was."""
    before = data_names()
    with pytest.raises(MapError) as error:
        function(*arguments)
    assert data_names() == before
    sentence = str(error.value)
    assert sentence.endswith(".") and ": " in sentence and "\n" not in sentence
    return sentence


def shown_by_cycles(image):
    """What an Image Texture node reads at each texel of a SIZE x SIZE image: (SIZE, SIZE, 3)."""
    material, color = cycles.emission_material()
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    tree.links.new(texture.outputs["Color"], color)
    scene = bpy.context.scene
    cycles.set_up_cycles(scene, size=(SIZE, SIZE), osl=False)
    cycles.box_filter(scene, 0.01)
    cycles.add_plane(scene, 1.0, material=material)
    cycles.add_camera(scene, (0, 0, 1), width=1.0)
    return cycles.rendered(scene)[..., :3]


def written(file, file_format, alpha):
    """An image file of random colours with transparency `alpha`, loaded as data."""
    pixels = np.random.default_rng(3).uniform(0.3, 0.7, (SIZE * SIZE, 4)).astype(np.float32)
    pixels[:, 3] = alpha
    source = bpy.data.images.new("Source", SIZE, SIZE, alpha=True, float_buffer=file_format == "OPEN_EXR", is_data=True)
    source.pixels.foreach_set(pixels.ravel())
    source.file_format, source.filepath_raw = file_format, str(file)
    source.save()
    bpy.data.images.remove(source)
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = "Non-Color"
    return image


@pytest.mark.parametrize("alpha_mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize(("file_format", "suffix", "alpha"),
                         [("PNG", ".png", 1.0), ("PNG", ".png", 0.5), ("OPEN_EXR", ".exr", 0.5)])
def test_the_pixels_are_those_an_image_texture_shows(scene, tmp_path, file_format, suffix, alpha, alpha_mode):
    image = written(tmp_path / f"map{suffix}", file_format, alpha)
    image.alpha_mode = alpha_mode
    np.testing.assert_allclose(image_pixels(image)[..., :3], shown_by_cycles(image), rtol=0, atol=1e-6)


def test_rows_count_from_the_bottom_and_columns_from_the_left(scene):
    image = new_image(size=(5, 3), is_float=True)
    pixels = image_pixels(image)
    assert pixels.shape == (3, 5, 4)
    np.testing.assert_array_equal(pixels[0, 0, :3], [0.75, 0.5, 0.75])
    assert (pixels[..., 0] == 0.75).sum() == 1


def test_a_path_is_loaded_once_and_read_as_data(flake_map):
    image = normal_map_image(flake_map)
    assert image.colorspace_settings.name == "Non-Color" and image.size[:] == (SIZE, SIZE)
    assert normal_map_image(str(flake_map)) == image
    assert len(bpy.data.images) == 1


def test_an_image_that_is_data_already_is_used_itself(flake_map):
    image = bpy.data.images.load(str(flake_map))
    image.colorspace_settings.name = "Non-Color"
    assert normal_map_image(image) == image


def test_an_image_that_is_open_already_is_used_as_it_is(flake_map):
    image = bpy.data.images.load(str(flake_map))
    assert normal_map_image(image) == image and normal_map_image(flake_map) == image
    assert image.colorspace_settings.name == "sRGB" and len(bpy.data.images) == 1


def test_a_missing_file_is_refused(scene, tmp_path):
    assert "does not exist" in refusal(normal_map_image, tmp_path / "nothing.png")
    assert "does not exist" in refusal(normal_map_image, tmp_path)


@pytest.mark.parametrize("content", [b"", b"this is a text", b"\x89PNG\r\n\x1a\n" + bytes(40)])
def test_a_file_that_is_no_image_is_refused(scene, tmp_path, content):
    file = tmp_path / "text.png"
    file.write_bytes(content)
    assert "text.png" in refusal(normal_map_image, file)


def test_a_file_cut_short_is_refused(flake_map):
    flake_map.write_bytes(flake_map.read_bytes()[:200])
    assert "flakes.png" in refusal(normal_map_image, flake_map)


def test_a_data_block_whose_file_is_gone_is_refused(flake_map):
    image = bpy.data.images.load(str(flake_map))
    flake_map.unlink()
    image.reload()
    assert "missing or not an image" in refusal(normal_map_image, image)


def test_a_single_pixel_is_refused_and_a_single_row_is_not(scene):
    dot, row = new_image("dot", (1, 1)), new_image("row", (4, 1))
    assert "single pixel" in refusal(normal_map_image, dot)
    assert normal_map_image(row) == row


def test_a_movie_is_refused(flake_map):
    image = bpy.data.images.load(str(flake_map))
    image.source = "MOVIE"
    assert "movie" in refusal(normal_map_image, image)


def test_the_render_result_is_refused(scene):
    cycles.add_camera(scene)
    bpy.ops.render.render()
    assert "viewer" in refusal(normal_map_image, bpy.data.images["Render Result"])


def test_a_grey_image_is_refused(scene, tmp_path):
    image = bpy.data.images.load(str(grey_png(tmp_path / "grey.png")))
    if image.channels < 3:
        assert "no colour channels" in refusal(normal_map_image, image)
    else:
        # Blender gives most grey files three channels: then it is a map of equal channels like any other.
        assert image_pixels(image).shape[2] >= 3


def grey_png(file):
    """A grey image file of SIZE x SIZE."""
    image = new_image("grey")
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_mode = "PNG", "BW"
    image.save_render(str(file), scene=bpy.context.scene)
    bpy.data.images.remove(image)
    return file


def test_the_stamp_changes_with_the_file_and_is_empty_without_one(flake_map):
    image = bpy.data.images.load(str(flake_map))
    stamp = image_stamp(image)
    assert stamp and image_stamp(image) == stamp
    write_flake_map(flake_map, 2 * SIZE)
    assert image_stamp(image) not in ("", stamp)
    image.pack()
    assert image_stamp(image) == ""
    assert image_stamp(new_image()) == ""
    flake_map.unlink()
    assert image_stamp(bpy.data.images[image.name]) == ""


def test_a_painted_image_has_no_stamp(flake_map):
    image = bpy.data.images.load(str(flake_map))
    pixels = image_pixels(image)
    image.pixels.foreach_set(pixels.ravel())
    assert image.is_dirty and image_stamp(image) == ""
