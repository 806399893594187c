"""Images of several files: which files they have, how large they are, and what of them is refused or copied."""

import os

import bpy
import pytest

from glint_addon.errors import MapError
from glint_addon.images import (
    Frames,
    data_image,
    image_files,
    image_shape,
    image_state,
    is_data_copy,
    is_several,
    normal_map_image,
    sequence_frames,
)
from tests.helpers import map_sets
from tests.helpers.extension import data_names

KINDS = {"TILED": map_sets.udim_set, "SEQUENCE": map_sets.sequence}
NAMES = {
    "TILED": ["flakes.1001.png", "flakes.1002.png", "flakes.1011.png"],
    "SEQUENCE": [f"flakes_{number:04d}.png" for number in map_sets.FRAMES],
}


@pytest.mark.parametrize("source", KINDS)
def test_the_files_of_an_image_in_their_order(scene, tmp_path, source):
    for name in ("flakes.1012.txt", "flakes_0004.exr", "other_0004.png", "flakes_0004_old.png"):
        (tmp_path / name).touch()
    image = KINDS[source](tmp_path)
    assert is_several(image) and [file.name for file in image_files(image)] == NAMES[source]
    largest = 128 if source == "TILED" else 64
    assert image_shape(image)[:2] == (largest, largest) and image_shape(image)[2] >= 3


def test_tiles_named_by_their_column_and_row(scene, tmp_path):
    image = map_sets.udim_set(tmp_path)
    for column, row in ((1, 1), (1, 2)):
        map_sets.write_flakes(tmp_path / f"other_u{column}_v{row}.png", row)
    image.filepath = str(tmp_path / "other_<UVTILE>.png")
    assert [file.name for file in image_files(image)] == ["other_u1_v1.png", "other_u1_v2.png"]


def test_frames_of_a_sequence_are_all_its_files(scene, tmp_path):
    image = map_sets.sequence(tmp_path)
    assert sequence_frames(image) == Frames(frame_duration=5, frame_start=1, frame_offset=2)
    (tmp_path / "flakes_0010.png").touch()
    assert sequence_frames(image).frame_duration == 8
    image.source = "FILE"
    assert sequence_frames(image) is None


def test_a_sequence_whose_name_has_no_number_is_its_one_file(scene, tmp_path):
    file = map_sets.write_flakes(tmp_path / "flakes.png", 1)
    image = bpy.data.images.load(str(file))
    image.source = "SEQUENCE"
    assert image_files(image) == [file] and sequence_frames(image) == Frames()


def test_a_path_with_udim_opens_the_set_as_data_once(scene, tmp_path):
    bpy.data.images.remove(map_sets.udim_set(tmp_path))
    image = normal_map_image(tmp_path / "flakes.<UDIM>.png")
    assert image.source == "TILED" and image.colorspace_settings.is_data
    assert tuple(tile.number for tile in image.tiles) == map_sets.TILES
    assert normal_map_image(str(tmp_path / "flakes.<UDIM>.png")) == image
    assert normal_map_image(tmp_path / "flakes.1001.png") != image


@pytest.mark.parametrize("folder", ["", "nowhere"])
def test_a_path_with_udim_and_no_tile_is_refused(scene, tmp_path, folder):
    before = data_names()
    with pytest.raises(MapError, match="does not exist: choose"):
        normal_map_image(tmp_path / folder / "none.<UDIM>.png")
    assert data_names() == before


@pytest.mark.parametrize("source", KINDS)
def test_a_set_whose_files_are_gone_is_refused_and_has_no_state(scene, tmp_path, source):
    image = KINDS[source](tmp_path)
    assert image_state(image) != ""
    for file in image_files(image):
        file.unlink()
    image.reload()
    assert image_state(image) == ""
    with pytest.raises(MapError, match="no pixels"):
        normal_map_image(image)


@pytest.mark.parametrize("source", KINDS)
def test_a_set_shown_as_colour_is_copied_and_the_copy_follows_its_files(scene, tmp_path, source):
    image = KINDS[source](tmp_path, is_data=False)
    copy = data_image(image)
    assert copy != image and is_data_copy(copy) and copy.source == source and copy.colorspace_settings.is_data
    assert image_files(copy) == image_files(image) and image.colorspace_settings.name == "sRGB"
    assert data_image(image, copy) == copy
    before = image_state(image)
    if source == "TILED":
        map_sets.write_flakes(tmp_path / "flakes.1003.png", 3)
        image.tiles.new(1003)
    else:
        os.utime(image_files(image)[-1], (1, 1))
    assert image_state(image) != before
    assert data_image(image, copy) == copy and image_files(copy) == image_files(image)


def test_a_set_shown_as_data_is_read_itself_and_needs_no_look_at_its_files(scene, tmp_path):
    image = map_sets.udim_set(tmp_path)
    before = image_state(image)
    os.utime(image_files(image)[-1], (1, 1))
    assert data_image(image) == image and image_state(image) == before


def test_a_painted_set_that_is_shown_as_colour_is_refused(scene, tmp_path):
    image = map_sets.udim_set(tmp_path, is_data=False)
    image.pixels[0] = 0.3
    image.update()
    assert image.is_dirty
    before = data_names()
    with pytest.raises(MapError, match="set its Color Space"):
        data_image(image)
    assert data_names() == before
    image.colorspace_settings.name = "Non-Color"
    assert data_image(image) == image
