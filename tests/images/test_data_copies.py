"""Copies that read images as data: they hold the originals' values, follow them, and never touch them."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from glint_addon.bake.image_bytes import image_bytes
from glint_addon.errors import MapError
from glint_addon.images import (
    data_image,
    image_pixels,
    image_state,
    is_data_copy,
    normal_map_image,
    remove_unused_copies,
)
from glint_addon.materials.create import create_glint_material
from tests.helpers import cycles
from tests.helpers.extension import data_names
from tests.helpers.image_copies import follow
from tests.images.test_images import shown_by_cycles

SIZE = 16
BYTE = 1 / 255
CURVES = 3e-5  # OpenColorIO's fast powers, there and back
GREY = (0.25, 0.3, 0.2, 1.0)  # a normal that faces down
KINDS = ("generated", "painted byte", "painted float", "painted file", "painted float file", "packed",
         "painted packed", "clean", "clean float")


def map_pixels(seed=5):
    """A normal map of random facets, (SIZE, SIZE, 4)."""
    slopes = np.random.default_rng(seed).normal(0.0, 0.3, (SIZE, SIZE, 2))
    normals = np.dstack([-slopes, np.ones((SIZE, SIZE))])
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return np.dstack([normals * 0.5 + 0.5, np.ones((SIZE, SIZE))]).astype(np.float32)


def write_file(file, pixels, *, is_float=False) -> Path:
    """`pixels` as they are in a PNG of bytes or an EXR of 32-bit floats."""
    file.write_bytes(image_bytes(pixels, is_float=is_float, name=file.name))
    return file


def paint(image, pixels):
    """What a brush or a script does."""
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    image.update()


def users_image(kind, folder, *, is_data, pixels=None):
    """An image of the user's, of one of KINDS, named "Map", that holds `pixels` where it has been painted."""
    pixels = map_pixels() if pixels is None else pixels
    is_float = "float" in kind
    if kind in ("generated", "painted byte", "painted float"):
        image = bpy.data.images.new("Map", SIZE, SIZE, float_buffer=is_float, is_data=is_data, alpha=True)
        if kind == "generated":
            image.generated_color = (*pixels[0, 0, :3], 1.0)
            return image
        paint(image, pixels)
        return image
    file = write_file(folder / ("Map.exr" if is_float else "Map.png"), pixels[::-1] if "painted" in kind else pixels,
                      is_float=is_float)
    image = bpy.data.images.load(str(file))
    image.name = "Map"
    image.colorspace_settings.name = "Non-Color" if is_data else "sRGB"
    if "packed" in kind:
        image.pack()
    if "painted" in kind:
        paint(image, pixels)
    return image


def snapshot(image) -> dict:
    """All of an image that its user may miss, but for the number of its users."""
    packed = image.packed_file.data if image.packed_file is not None else b""
    names = "name_full source filepath_raw is_dirty alpha_mode use_fake_user is_float file_format"
    values = {name: getattr(image, name) for name in names.split()} | {"properties": list(image.keys())}
    pixels = hashlib.sha256(image_pixels(image).data).hexdigest()
    return values | {"pixels": pixels, "packed": packed, "space": image.colorspace_settings.name}


@pytest.fixture
def plane(registered):
    """The active object: a square with a UV map."""
    thing = cycles.add_plane(bpy.context.scene)
    bpy.context.view_layer.objects.active = thing
    return thing


def material_of_image(image):
    create_glint_material("Glint", image)


def material_of_path(image):
    create_glint_material("Glint", bpy.path.abspath(image.filepath) if image.filepath else image)


def operator_on_the_pick(image):
    bpy.context.scene.glint.normal_map = image
    bpy.ops.glint.add_material()


def operator_on_a_name(image):
    bpy.ops.glint.add_material(image=image.name)


def operator_on_a_file(image):
    path = bpy.path.abspath(image.filepath)
    bpy.ops.glint.add_material(**({"filepath": path} if path else {"image": image.name}))


def change_of_map(image):
    bpy.context.scene.glint.normal_map = image
    bpy.ops.glint.change_map()


WAYS = (material_of_image, material_of_path, operator_on_the_pick, operator_on_a_name, operator_on_a_file,
        change_of_map)


@pytest.mark.parametrize("is_data", [False, True], ids=["colour", "data"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_no_way_of_adding_a_map_changes_the_users_image(plane, tmp_path, way, kind, is_data):
    if way is change_of_map:
        other = bpy.data.images.load(str(write_file(tmp_path / "other.png", map_pixels(6))))
        bpy.ops.glint.add_material(image=other.name)
    image = users_image(kind, tmp_path, is_data=is_data)
    before, users = snapshot(image), image.users
    way(image)
    assert bpy.data.images.get("Map") == image and snapshot(image) == before
    assert image.users >= users


@pytest.mark.parametrize("is_data", [False, True], ids=["colour", "data"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", WAYS[:3], ids=lambda way: way.__name__)
def test_a_refused_map_is_left_as_it_was(plane, tmp_path, way, kind, is_data):
    image = users_image(kind, tmp_path, is_data=is_data, pixels=np.full((SIZE, SIZE, 4), GREY, np.float32))
    before, names = snapshot(image), data_names()
    with pytest.raises((MapError, RuntimeError), match="faces up"):
        way(image)
    assert snapshot(image) == before
    bpy.context.scene.glint.normal_map = None
    assert data_names() == names


@pytest.mark.parametrize("kind", KINDS)
def test_the_copy_renders_the_values_that_the_original_holds(scene, tmp_path, kind):
    image = users_image(kind, tmp_path, is_data=False)
    held = map_pixels()[..., :3]
    if kind == "generated":
        held = image_pixels(image)[..., :3]
    elif kind == "painted float file":
        # A brush's colours are light, which this image's file would hold encoded as sRGB.
        held = np.where(held <= 0.0031308, 12.92 * held, 1.055 * held ** (1 / 2.4) - 0.055)
    copy = data_image(image)
    assert copy != image and copy.colorspace_settings.is_data and is_data_copy(copy) and not is_data_copy(image)
    tolerance = CURVES if copy.is_float else 0.51 * BYTE
    np.testing.assert_allclose(image_pixels(copy)[..., :3], held, rtol=0, atol=tolerance)
    np.testing.assert_allclose(shown_by_cycles(copy), held, rtol=0, atol=tolerance)


@pytest.mark.parametrize("alpha_mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize("space", ["sRGB", "Linear Rec.709", "Linear Rec.2020", "Gamma 2.2 Encoded Rec.709"])
def test_texels_of_a_file_that_nobody_painted_keep_the_values_of_the_file(scene, tmp_path, space, alpha_mode):
    pixels = map_pixels()
    pixels[..., 3] = 0.5
    image = bpy.data.images.load(str(write_file(tmp_path / "Map.exr", pixels, is_float=True)))
    image.colorspace_settings.name, image.alpha_mode = space, alpha_mode
    shown = image_pixels(image)
    shown[0, 0] = (0.1, 0.2, 0.3, 1.0)
    paint(image, shown)
    np.testing.assert_allclose(image_pixels(data_image(image))[1:, :, :3], pixels[1:, :, :3], rtol=0, atol=CURVES)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "generated"])
def test_the_copy_keeps_its_values_in_the_saved_file_to_the_last_bit(scene, tmp_path, kind):
    copy = data_image(users_image(kind, tmp_path, is_data=False))
    values, name, copy.use_fake_user = image_pixels(copy), copy.name, True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    copy = bpy.data.images[name]
    assert is_data_copy(copy)
    np.testing.assert_array_equal(image_pixels(copy), values)


@pytest.mark.parametrize("kind", KINDS)
def test_an_image_that_did_not_change_is_copied_once(scene, tmp_path, kind):
    image = users_image(kind, tmp_path, is_data=False)
    copy = data_image(image)
    assert copy.name == "Map (Non-Color)"
    assert not follow(copy, image) and data_image(image) == copy and data_image(image, copy) == copy
    assert len(bpy.data.images) == 2


def test_an_image_read_as_data_is_its_own(scene, tmp_path):
    for kind in KINDS:
        image = users_image(kind, tmp_path, is_data=True)
        assert data_image(image) == image and not is_data_copy(image)


def repainted(image, folder):
    paint(image, map_pixels(8))


def saved_over(image, folder):
    write_file(folder / "Map.png", map_pixels(8))
    image.reload()


def given_another_file(image, folder):
    image.filepath = str(write_file(folder / "Another.png", map_pixels(8)))


def painted_and_packed(image, folder):
    paint(image, map_pixels(8))
    image.pack()


def painted_and_saved(image, folder):
    paint(image, map_pixels(8))
    if not image.filepath:
        image.filepath_raw, image.file_format = str(folder / "Saved.png"), "PNG"
    image.save()


@pytest.mark.parametrize(("kind", "change"), [
    *((kind, change) for kind in ("generated", "painted byte", "painted file", "packed", "painted packed", "clean")
      for change in (repainted, painted_and_packed)),
    *(("clean", change) for change in (saved_over, given_another_file, painted_and_saved)),
    ("painted file", painted_and_saved), ("painted byte", painted_and_saved),
])
def test_the_copy_follows_what_happens_to_the_original(scene, tmp_path, kind, change):
    image = users_image(kind, tmp_path, is_data=False)
    copy = data_image(image)
    change(image, tmp_path)
    before = snapshot(image)
    assert follow(copy, image) and not follow(copy, image)
    assert snapshot(image) == before and is_data_copy(copy) and data_image(image) == copy
    np.testing.assert_allclose(image_pixels(copy), map_pixels(8), rtol=0, atol=0.51 * BYTE)
    np.testing.assert_allclose(shown_by_cycles(copy), map_pixels(8)[..., :3], rtol=0, atol=0.51 * BYTE)


def test_a_copy_follows_back_from_painted_to_the_file(scene, tmp_path):
    image = users_image("clean", tmp_path, is_data=False)
    copy = data_image(image)
    paint(image, map_pixels(8))
    assert follow(copy, image) and copy.packed_file is not None and copy.filepath == ""
    image.reload()
    assert follow(copy, image) and copy.packed_file is None and copy.filepath == image.filepath
    np.testing.assert_allclose(image_pixels(copy), map_pixels(), rtol=0, atol=0.51 * BYTE)


def test_the_state_of_an_image_changes_with_its_pixels_alone(scene, tmp_path):
    for kind in KINDS:
        image = users_image(kind, tmp_path, is_data=True)
        state = image_state(image)
        image.name, image.use_fake_user = "Renamed", True
        assert state and image_state(image) == state
        paint(image, map_pixels(8))
        assert image_state(image) != state


def test_a_copy_is_left_alone_where_the_originals_file_is_missing(scene, tmp_path):
    image = users_image("clean", tmp_path, is_data=False)
    copy = data_image(image)
    (tmp_path / "Map.png").unlink()
    image.reload()
    state = snapshot_of_copy(copy)
    assert image_state(image) == "" and not follow(copy, image) and snapshot_of_copy(copy) == state


def snapshot_of_copy(copy):
    return copy.filepath, copy.packed_file, dict(copy.items())


def test_a_copy_that_cannot_be_made_is_a_sentence_and_leaves_nothing(scene, tmp_path, monkeypatch):
    image = users_image("painted byte", tmp_path, is_data=False)
    before, names = snapshot(image), data_names()
    monkeypatch.setattr("glint_addon.bake.image_bytes.TemporaryDirectory", full_disk)
    with pytest.raises(MapError, match=r'"Map" cannot be copied \(No space left on device\): free some disk space\.'):
        data_image(image)
    assert snapshot(image) == before and data_names() == names


def test_a_colour_space_that_cannot_be_undone_is_a_sentence_and_leaves_nothing(scene, tmp_path, monkeypatch):
    image = users_image("painted float file", tmp_path, is_data=False)
    before, names = snapshot(image), data_names()
    monkeypatch.setenv("OCIO", str(tmp_path / "gone.ocio"))
    with pytest.raises(MapError, match=r'Image "Map" cannot be converted from "Linear Rec.709" to "sRGB" \('):
        data_image(image)
    assert snapshot(image) == before and data_names() == names


def test_a_copy_that_cannot_follow_is_as_it_was(scene, tmp_path, monkeypatch):
    image = users_image("painted byte", tmp_path, is_data=False)
    copy = data_image(image)
    paint(image, map_pixels(8))
    monkeypatch.setattr("glint_addon.bake.image_bytes.TemporaryDirectory", full_disk)
    with pytest.raises(MapError, match="free some disk space"):
        follow(copy, image)
    np.testing.assert_allclose(image_pixels(copy), map_pixels(), rtol=0, atol=0.51 * BYTE)


def full_disk(**options):
    raise OSError(28, "No space left on device")


def test_an_image_of_the_user_with_the_name_of_a_copy_is_not_taken_over(scene, tmp_path):
    own = bpy.data.images.new("Map (Non-Color)", SIZE, SIZE, is_data=True)
    paint(own, map_pixels(9))
    before = snapshot(own)
    copy = data_image(users_image("clean", tmp_path, is_data=False))
    assert copy != own and snapshot(own) == before and not follow(own, bpy.data.images["Map"])


def test_a_copy_that_somebody_painted_on_is_theirs(scene, tmp_path):
    image = users_image("painted byte", tmp_path, is_data=False)
    copy = data_image(image)
    paint(copy, map_pixels(9))
    painted = snapshot(copy)
    paint(image, map_pixels(8))
    assert not is_data_copy(copy) and not follow(copy, image) and data_image(image) != copy
    copy.pack()
    assert not is_data_copy(copy)
    remove_unused_copies()
    assert snapshot(copy)["pixels"] == painted["pixels"]


def test_a_renamed_copy_and_a_renamed_original_stay_together(scene, tmp_path):
    image = users_image("painted byte", tmp_path, is_data=False)
    copy = data_image(image)
    copy.name, image.name = "My data", "My map"
    assert data_image(image, copy) == copy
    paint(image, map_pixels(8))
    assert follow(copy, image) and len(bpy.data.images) == 2


def test_a_copy_never_follows_another_image(scene, tmp_path):
    image = users_image("painted byte", tmp_path, is_data=False)
    copy = data_image(image)
    other = users_image("painted byte", tmp_path, is_data=False, pixels=map_pixels(8))
    assert not follow(copy, other) and data_image(other, copy) != copy
    np.testing.assert_allclose(image_pixels(copy), map_pixels(), rtol=0, atol=0.51 * BYTE)


def test_images_of_one_name_from_two_libraries_have_each_their_own_copy(scene, tmp_path):
    for seed, name in enumerate(("one", "two")):
        cycles.empty_scene()
        folder = tmp_path / name
        folder.mkdir()
        users_image("clean", folder, is_data=False, pixels=map_pixels(seed)).use_fake_user = True
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{name}.blend"), relative_remap=True)
    cycles.empty_scene()
    (tmp_path / "shot").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot" / "shot.blend"))
    for name in ("one", "two"):
        with bpy.data.libraries.load(str(tmp_path / name / f"{name}.blend"), link=True) as (_, found):
            found.images = ["Map"]
    for seed, name in enumerate(("one", "two")):
        image = next(image for image in bpy.data.images if image.library and image.library.name.startswith(name))
        assert normal_map_image(image) == image
        copy = data_image(image)
        assert copy.library is None and data_image(image) == copy and not follow(copy, image)
        np.testing.assert_allclose(image_pixels(copy), map_pixels(seed), rtol=0, atol=0.51 * BYTE)
        assert image.colorspace_settings.name == "sRGB"
    assert len(bpy.data.images) == 4


def test_the_copy_of_a_relative_path_moves_with_the_folder(scene, tmp_path):
    first = tmp_path / "first"
    first.mkdir()
    image = users_image("clean", first, is_data=False)
    bpy.ops.wm.save_as_mainfile(filepath=str(first / "scene.blend"))
    image.filepath = "//Map.png"
    copy = data_image(image)
    image.use_fake_user = copy.use_fake_user = True
    bpy.ops.wm.save_mainfile()
    first.rename(tmp_path / "second")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "second" / "scene.blend"))
    image, copy = bpy.data.images["Map"], bpy.data.images["Map (Non-Color)"]
    assert is_data_copy(copy) and data_image(image, copy) == copy
    np.testing.assert_allclose(image_pixels(copy), map_pixels(), rtol=0, atol=0.51 * BYTE)


def test_only_copies_that_nothing_uses_are_removed(scene, tmp_path):
    image = users_image("painted byte", tmp_path, is_data=False)
    other = users_image("clean", tmp_path, is_data=False)
    unused, used = data_image(image), data_image(other)
    bpy.data.materials.new("Other").node_tree.nodes.new("ShaderNodeTexImage").image = used
    unused_name = unused.name
    remove_unused_copies()
    assert unused_name not in bpy.data.images and {image, other, used} == set(bpy.data.images)


def test_a_file_that_is_open_only_as_a_copy_is_opened_itself(scene, tmp_path):
    image = users_image("clean", tmp_path, is_data=False)
    copy = data_image(image)
    bpy.data.images.remove(image)
    assert normal_map_image(tmp_path / "Map.png") != copy


RAW_CONFIGURATION = """
import sys
import bpy
sys.path.insert(0, {root!r})
import glint_addon
from glint_addon.materials.create import create_glint_material
from glint_addon.materials.find import glint_groups
from glint_addon.images import data_image
bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
glint_addon.register()
probe = bpy.data.images.new("Probe", 4, 4)
assert "Non-Color" not in [item.identifier for item in probe.colorspace_settings.bl_rna.properties["name"].enum_items]
mesh = bpy.data.meshes.new("Plane")
mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
mesh.uv_layers.new(name="UVMap")
plane = bpy.data.objects.new("Plane", mesh)
bpy.context.scene.collection.objects.link(plane)
bpy.context.view_layer.objects.active = plane
image = bpy.data.images.load({file!r})
assert not image.colorspace_settings.is_data
bpy.context.scene.glint.normal_map = image
bpy.ops.glint.add_material()
bpy.ops.glint.change_map(image=image.name, interpolation="CLOSEST")
bpy.data.images.remove(image)
bpy.ops.glint.add_material(filepath={file!r})
(group,) = glint_groups(plane.active_material)
from glint_addon.nodes.map_binding import image_read
assert image_read(group).colorspace_settings.name == "Raw"
create_glint_material("Glint", bpy.data.images.load({file!r}))
painted = bpy.data.images.new("Painted", 4, 4)
painted.pixels = [0.5, 0.5, 1.0, 1.0] * 16
assert data_image(painted).colorspace_settings.name == "Raw"
glint_addon.unregister()
"""


def test_maps_are_read_as_data_where_no_colour_space_is_named_non_color(scene, tmp_path):
    blenders = Path(bpy.utils.system_resource("DATAFILES")) / "colormanagement"
    folder = tmp_path / "colormanagement"
    folder.mkdir()
    for part in blenders.iterdir():
        if part.is_dir():
            (folder / part.name).symlink_to(part, target_is_directory=True)
    words = (blenders / "config.ocio").read_text(encoding="utf-8").replace("Non-Color", "Raw")
    (folder / "config.ocio").write_text(words, encoding="utf-8")
    file = write_file(tmp_path / "Map.png", map_pixels())
    script = RAW_CONFIGURATION.format(root=str(Path(__file__).parents[2]), file=str(file))
    environment = os.environ | {"OCIO": str(folder / "config.ocio")}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
