"""Generated images: ordinary, packed, with their recipe, made anew in place, and never over what a user painted."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from glint_addon.errors import MapError
from glint_addon.generate import GENERATORS, Coloring, Recipe, encoded
from glint_addon.images import (
    check_unchanged,
    image_pixels,
    is_generated_map,
    is_preview,
    new_generated_map,
    parts,
    pictures,
    recipe_of,
    show,
)
from glint_addon.properties import GENERATED, GENERATED_COLOR, GENERATED_PRESENCE

FLAKES = Recipe(GENERATORS["FLAKES"](coverage=0.4, extent=0.002), 64, Coloring(mode="SPREAD", hue=1.0))
BUMPS = Recipe(GENERATORS["BUMPS"](), 64)

pytestmark = pytest.mark.usefixtures("scene")


def paint(image):
    """Change a pixel, as a brush does."""
    image.pixels[0] = 1 - image.pixels[0]
    image.update()


def test_the_normal_map_has_the_generators_normals():
    image = new_generated_map("Paint", FLAKES)
    surface, _ = FLAKES.made(64)
    assert image.name == "Paint" and image.size[:] == (64, 64) and is_generated_map(image)
    assert image.colorspace_settings.is_data and image.packed_file is not None and not image.is_dirty
    # Half a step of 16 bits.
    np.testing.assert_allclose(image_pixels(image)[..., :3], encoded(surface.normals), atol=0.51 / 65535)


def test_presence_is_an_image_of_data_and_colours_are_one_of_colours():
    image = new_generated_map("Paint", FLAKES)
    surface, colors = FLAKES.made(64)
    presence, color = (parts(image)[key] for key in (GENERATED_PRESENCE, GENERATED_COLOR))
    assert (presence.name, color.name) == ("Paint Presence", "Paint Color")
    assert presence.colorspace_settings.is_data and color.colorspace_settings.name == "sRGB"
    assert (image_pixels(presence)[..., 0] == surface.presence).all()
    # Blender keeps 8 bits of a colour as they are in the file, in sRGB.
    stored = image_pixels(color)[..., :3].astype(float)
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(linear, colors, atol=0.005)  # half a step of 8 bits at the steepest
    assert not is_generated_map(presence) and recipe_of(color) == FLAKES


def test_a_map_without_gaps_and_colours_is_one_image():
    before = len(bpy.data.images)
    image = new_generated_map("Waves", BUMPS)
    assert parts(image) == {} and len(bpy.data.images) == before + 1 and recipe_of(image) == BUMPS


def test_images_are_made_anew_in_place():
    image = new_generated_map("Paint", FLAKES)
    image.name = "Renamed"
    presence = parts(image)[GENERATED_PRESENCE]
    presence.use_fake_user = True
    before = len(bpy.data.images)
    denser = replace(FLAKES, generator=replace(FLAKES.generator, coverage=0.9), resolution=128)
    show(image, denser, pictures(denser))
    assert image.name == "Renamed" and image.size[:] == (128, 128) and recipe_of(image) == denser
    assert parts(image)[GENERATED_PRESENCE] == presence and len(bpy.data.images) == before
    assert 0.8 < image_pixels(presence)[..., 0].mean() < 0.97 and recipe_of(presence) == denser


def test_an_image_of_a_part_that_is_gone_is_white():
    image = new_generated_map("Paint", FLAKES)
    show(image, BUMPS, pictures(BUMPS))
    assert all((image_pixels(part) == 1).all() for part in parts(image).values()) and len(parts(image)) == 2


def test_a_part_that_was_removed_is_made_again():
    image = new_generated_map("Paint", FLAKES)
    bpy.data.images.remove(parts(image)[GENERATED_PRESENCE])
    assert GENERATED_PRESENCE not in parts(image)
    show(image, FLAKES, pictures(FLAKES))
    assert parts(image)[GENERATED_PRESENCE].size[:] == (64, 64)


def test_a_preview_is_smaller_than_its_recipe_says():
    large = replace(BUMPS, resolution=256)
    image = new_generated_map("Waves", large)
    assert not is_preview(image)
    show(image, large, pictures(large, 64))
    assert is_preview(image) and image.size[:] == (64, 64) and recipe_of(image).resolution == 256


@pytest.mark.parametrize("key", [None, GENERATED_PRESENCE, GENERATED_COLOR])
@pytest.mark.parametrize("is_packed", [False, True])
def test_painted_images_are_left_alone(key, is_packed):
    image = new_generated_map("Paint", FLAKES)
    part = image if key is None else parts(image)[key]
    paint(part)
    if is_packed:
        part.pack()
    before = image_pixels(part)
    with pytest.raises(MapError, match=f'Image "{part.name}" was edited after it was generated: choose Overwrite'):
        show(image, BUMPS, pictures(BUMPS))
    assert (image_pixels(part) == before).all() and recipe_of(image) == FLAKES
    show(image, FLAKES, pictures(FLAKES), overwrite=True)
    check_unchanged(image)
    assert (image_pixels(part) != before).any()


def test_an_image_with_another_file_counts_as_edited(tmp_path):
    image = new_generated_map("Waves", BUMPS)
    image.filepath_raw = str(tmp_path / "waves.png")
    image.save()
    image.unpack(method="REMOVE")
    with pytest.raises(MapError, match="was edited"):
        check_unchanged(image)
    show(image, BUMPS, pictures(BUMPS), overwrite=True)
    assert image.packed_file is not None and image.filepath == ""


def test_generated_images_come_back_with_the_file(tmp_path):
    image = new_generated_map("Paint", FLAKES)
    image.use_fake_user = True
    before = image_pixels(image)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "paint.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "paint.blend"))
    image = bpy.data.images["Paint"]
    assert (image_pixels(image) == before).all() and recipe_of(image) == FLAKES
    assert set(parts(image)) == {GENERATED_PRESENCE, GENERATED_COLOR}  # they have no other user
    check_unchanged(image)


def test_linked_images_are_not_changed(tmp_path):
    image = new_generated_map("Waves", BUMPS)
    image.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "waves.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "waves.blend"), link=True) as (_, target):
        target.images = ["Waves"]
    with pytest.raises(MapError, match='Image "Waves" is linked from another file: make it local'):
        show(target.images[0], BUMPS, pictures(BUMPS))


def test_an_image_without_a_recipe_that_can_be_read_has_none():
    image = bpy.data.images.new("Plain", 8, 8)
    assert recipe_of(image) is None and recipe_of(None) is None and not is_generated_map(image)
    image[GENERATED] = "{}"
    assert recipe_of(image) is None and not is_preview(image)
