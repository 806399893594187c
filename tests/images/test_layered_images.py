"""Layered OpenEXR files: Blender gives no pixels of them, yet its nodes show the first layer, and so do the glints."""

import bpy
import numpy as np
import pytest

from glint_addon.bake.openimageio import oiio
from glint_addon.errors import MapError
from glint_addon.images import data_image, image_pixels, image_shape, image_stamp, normal_map_image
from glint_addon.images.stored import stored_image
from glint_addon.materials.create import create_glint_material
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.map_binding import map_of
from tests.helpers.extension import data_names
from tests.helpers.image_copies import follow
from tests.images.test_images import shown_by_cycles

SIZE = 16
RGBA = ("R", "G", "B", "A")

# What a file's parts hold, by name: the channels of each part.
FILES = {
    "render": [[f"ViewLayer.Combined.{channel}" for channel in RGBA]],
    "normals": [[f"ViewLayer.Normal.{axis}" for axis in "XYZ"]],
    "two layers": [[f"{layer}.Combined.{channel}" for layer in "AB" for channel in RGBA]],
    "plain and layer": [[*RGBA, "N.R", "N.G", "N.B"]],
    "layer without alpha": [["N.R", "N.G", "N.B"]],
    "parts": [[f"ViewLayer.Combined.{channel}" for channel in RGBA], ["ViewLayer.Depth.Z"],
              [f"ViewLayer.Normal.{axis}" for axis in "XYZ"]],
    "half floats": [[f"ViewLayer.Combined.{channel}" for channel in RGBA]],
}


def write_layers(file, parts, *, seed=0, half=False):
    """An OpenEXR file of these channels, each random; returns its path."""
    specs = []
    for channels in parts:
        spec = oiio.ImageSpec(SIZE, SIZE, len(channels), oiio.HALF if half else oiio.FLOAT)
        spec.channelnames = channels
        spec.attribute("oiio:subimagename", channels[0].rpartition(".")[0])
        specs.append(spec)
    generator = np.random.default_rng(seed)
    output = oiio.ImageOutput.create(str(file))
    assert output.open(str(file), tuple(specs))
    for number, spec in enumerate(specs):
        assert number == 0 or output.open(str(file), spec, "AppendSubimage")
        assert output.write_image(generator.uniform(0.55, 0.9, (SIZE, SIZE, spec.nchannels)).astype(np.float32))
    assert output.close()
    return file


@pytest.fixture
def layered(scene, tmp_path):
    """A layered file, opened as Blender does: as colour."""
    return bpy.data.images.load(str(write_layers(tmp_path / "layers.exr", FILES["parts"])))


@pytest.mark.parametrize("is_packed", [False, True], ids=["file", "packed"])
@pytest.mark.parametrize("name", FILES)
def test_the_pixels_are_those_that_cycles_shows_of_the_first_layer(scene, tmp_path, name, is_packed):
    file = write_layers(tmp_path / "layers.exr", FILES[name], half=name == "half floats")
    image = bpy.data.images.load(str(file))
    assert 0 in image.size[:]  # Blender gives no pixels: the reason for all this
    if is_packed:
        image.pack()
        file.unlink()
    copy = data_image(image)
    pixels = image_pixels(copy)
    assert copy != image and pixels.std() > 0.05
    assert image_shape(copy) == pixels.shape == (SIZE, SIZE, min(len(FILES[name][0]), 4))
    np.testing.assert_array_equal(pixels[..., :3], shown_by_cycles(copy))


@pytest.mark.parametrize("alpha_mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize("is_packed", [False, True], ids=["file", "packed"])
def test_the_users_own_layered_data_is_read_as_cycles_reads_it(layered, is_packed, alpha_mode):
    layered.colorspace_settings.name, layered.alpha_mode = "Non-Color", alpha_mode
    if is_packed:
        layered.pack()
    np.testing.assert_allclose(image_pixels(layered)[..., :3], shown_by_cycles(layered), rtol=0, atol=1e-6)


def test_a_layered_file_becomes_a_glint_material_by_image_and_by_path(scene, tmp_path, layered):
    for normal_map in (layered, layered.filepath, write_layers(tmp_path / "other.exr", FILES["normals"])):
        (group,) = glint_groups(create_glint_material("Glint", normal_map))
        assert image_shape(map_of(group))[:2] == (SIZE, SIZE)
    assert layered.colorspace_settings.name == "Linear Rec.709"


def test_a_layered_file_that_is_opened_anew_is_data(scene, tmp_path):
    image = normal_map_image(write_layers(tmp_path / "layers.exr", FILES["render"]))
    assert image.colorspace_settings.is_data and data_image(image) == image


def test_the_copy_of_a_layered_file_follows_it(tmp_path, layered):
    copy = data_image(layered)
    before, stamp = image_pixels(copy), image_stamp(layered)
    write_layers(tmp_path / "layers.exr", FILES["normals"], seed=1)
    assert image_stamp(layered) not in ("", stamp) and follow(copy, layered)
    assert image_pixels(copy).shape == (SIZE, SIZE, 3) != before.shape
    np.testing.assert_array_equal(image_pixels(copy), shown_by_cycles(copy))


@pytest.mark.parametrize("parts", [[["A.Y", "B.Y"]], [["ViewLayer.Depth.Z"], ["N.R", "N.G", "N.B"]]],
                         ids=["grey layers", "depth first"])
def test_a_file_whose_first_layer_has_no_colours_is_refused(scene, tmp_path, parts):
    file = write_layers(tmp_path / "grey.exr", parts)
    names = data_names()
    with pytest.raises(MapError, match='"grey.exr" has no colours in its first layer: save the map as its own file.'):
        normal_map_image(file)
    assert data_names() == names


def test_a_layered_file_that_is_cut_short_is_refused_in_one_sentence(tmp_path, layered):
    assert image_shape(layered) == (SIZE, SIZE, 4)
    file = tmp_path / "layers.exr"
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(MapError, match=r"layers.exr cannot be read \(.*\): export it again\.$") as error:
        image_pixels(layered)
    assert "\n" not in str(error.value)


def test_a_layered_file_that_has_gone_is_refused(tmp_path, layered):
    assert image_shape(layered) == (SIZE, SIZE, 4)
    (tmp_path / "layers.exr").unlink()
    assert image_shape(layered) == (0, 0, 0)
    with pytest.raises(MapError, match=r'"layers.exr" has no pixels \(missing or not an image\)'):
        image_pixels(layered)


def test_a_packed_layered_file_that_finds_no_room_to_be_read_is_one_sentence(layered, monkeypatch):
    def full_disk(*arguments):
        raise OSError(28, "No space left on device")

    layered.pack()
    monkeypatch.setattr("pathlib.Path.write_bytes", full_disk)
    with pytest.raises(MapError, match=r"layers.exr cannot be unpacked \(No space left on device\): free some disk"):
        image_pixels(layered)


@pytest.mark.parametrize("alpha_mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize("space", ["Non-Color", "Linear Rec.709", "Linear Rec.2020", "sRGB"])
@pytest.mark.parametrize("is_packed", [False, True], ids=["file", "packed"])
def test_a_mip_pyramid_of_a_layered_file_begins_with_what_cycles_shows(layered, is_packed, space, alpha_mode):
    layered.colorspace_settings.name, layered.alpha_mode = space, alpha_mode
    if is_packed:
        layered.pack()
    stored = stored_image(layered)
    shown = stored.pixels[..., :3]
    if stored.encoded:
        # Where nobody asks for alpha, Cycles decodes associated colours as they are.
        shown = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    # OpenColorIO's powers are fast ones.
    np.testing.assert_allclose(shown, shown_by_cycles(layered), rtol=0, atol=3e-5)
