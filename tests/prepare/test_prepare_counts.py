"""prepare_scene does no work twice: tables baked, bytes and images read, counted over frames and scenes."""

import sys
from collections import Counter
from pathlib import Path

import bpy
import pytest

from demo_scenes import maps
from glint_addon import create_glint_material, prepare_scene
from glint_addon.errors import MapError
from glint_addon.prepare.changes import changes_since_prepared
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

MAP_SIDE = 32  # texels
# A table is stored as floats, four a texel, compressed: half of that at least, and a few hundred bytes of header.
TABLE_BYTES = MAP_SIDE * MAP_SIDE * 16
IDLE = {"tables_baked": 0, "bytes_baked": 0, "images_read": 0}


@pytest.fixture
def folder(scene, tmp_path) -> Path:
    """The tables' folder; in the scene a square with glints under a sun."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 3))
    material = create_glint_material(
        "Sparkle", write_flake_map(tmp_path / "flakes.png", MAP_SIDE), interpolation="CLOSEST"
    )
    cycles.add_plane(scene, material=material)
    return tmp_path / "glint_tables"


def files(folder) -> dict:
    return {file.name: (file.stat().st_mtime_ns, file.stat().st_size) for file in folder.iterdir()}


def test_the_first_call_counts_what_it_baked_and_the_second_has_nothing_to_do(scene, folder):
    first = prepare_scene(scene)["counts"]
    ((_, size),) = files(folder).values()
    assert first == {"tables_baked": 1, "tables_in_use": 1, "bytes_baked": size, "bytes_in_use": size, "images_read": 1}
    assert TABLE_BYTES / 2 < size < TABLE_BYTES + 1000
    assert prepare_scene(scene)["counts"] == {**first, **IDLE}


def test_an_animations_second_frame_bakes_nothing(scene, folder):
    """Not when it is prepared, and not when it is rendered."""
    square = bpy.data.objects["Mesh"]
    for frame in (1, 2):
        square.location.x = 0.1 * frame
        square.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    first = prepare_scene(scene)["counts"]
    cycles.rendered(scene)
    before = files(folder)
    scene.frame_set(2)
    report = prepare_scene(scene)
    cycles.rendered(scene)
    assert report["counts"] == {**first, **IDLE} and not report["baked"] and files(folder) == before


def test_a_table_that_two_groups_read_counts_once(scene, folder, tmp_path):
    material = create_glint_material(
        "Halo", tmp_path / "flakes.png", interpolation="CLOSEST", distribution="GGX"
    )
    bpy.data.objects["Mesh"].data.materials.append(material)
    counts = prepare_scene(scene)["counts"]
    assert counts["tables_in_use"] == counts["tables_baked"] == len(files(folder)) == 1
    assert counts["bytes_in_use"] == counts["bytes_baked"]


def test_a_second_scene_with_the_same_material_bakes_nothing(scene, folder):
    first = prepare_scene(scene)["counts"]
    other = bpy.data.scenes.new("Other")
    other.render.engine = "CYCLES"
    other.camera = scene.camera
    other.collection.objects.link(bpy.data.objects["Mesh"])
    assert prepare_scene(other)["counts"] == {**first, **IDLE}


def test_a_map_whose_tables_are_there_is_not_even_loaded(scene, folder):
    prepare_scene(scene)
    image = next(image for image in bpy.data.images if image.source == "FILE")
    image.buffers_free()
    assert not image.has_data
    prepare_scene(scene)
    assert not image.has_data


@pytest.mark.parametrize("change", ["GPU", "BLENDER_EEVEE"])
def test_what_renders_by_nodes_bakes_nothing_and_leaves_osl_off(scene, folder, change):
    scene.cycles.shading_system = False
    if change == "GPU":
        scene.cycles.device = change
    else:
        scene.render.engine = change
    report = prepare_scene(scene)
    assert report["hints"] == ["Sun"] and not any(report["counts"].values())
    assert not scene.cycles.shading_system and not report["notes"]


def test_a_map_that_no_file_holds_is_read_again_and_baked_once(scene, folder):
    """A painted or generated image does not say whether it changed."""
    image = maps.blender_image("Painted", maps.flakes(MAP_SIDE, std=0.2))
    bpy.data.objects["Mesh"].data.materials.append(create_glint_material("Painted", image))
    assert prepare_scene(scene)["counts"]["tables_baked"] == 2
    assert prepare_scene(scene)["counts"] | {"images_read": 0} == prepare_scene(scene)["counts"] | IDLE


def test_a_scene_with_no_glints_counts_nothing(scene):
    counts = prepare_scene(scene)["counts"]
    assert counts and not any(counts.values())


# --- the map ---


@pytest.fixture
def work(monkeypatch) -> Counter:
    """How often a map's pixels were "read", to be checked or baked, and "decoded" as a whole."""
    counted = Counter()

    def count(place, name, what):
        original = getattr(sys.modules[place], name)

        def counting(*arguments, **settings):
            counted[what] += 1
            return original(*arguments, **settings)

        monkeypatch.setattr(f"{place}.{name}", counting)

    for place in ("glint_addon.materials.build", "glint_addon.prepare.map_bake"):
        count(place, "image_pixels", "read")
    for place in ("glint_addon.bake.normal_map", "glint_addon.prepare.map_bake"):
        count(place, "decoded_normals", "decoded")
    count("glint_addon.images.state", "read_pixels", "digested")
    count("glint_addon.prepare.uses", "worn_materials", "objects searched")
    return counted


def show(*materials):
    for material in materials:
        bpy.data.objects["Mesh"].data.materials.append(material)


def test_a_map_is_checked_when_its_material_is_made_and_decoded_only_to_be_baked(scene, folder, tmp_path, work):
    new = write_flake_map(tmp_path / "new.png", 2 * MAP_SIDE)
    show(create_glint_material("New", new))
    assert work == {"read": 1}
    prepare_scene(scene)
    assert work["decoded"] == 2 and work["read"] == 3, "the two maps of the scene, each once"


def test_another_material_of_a_map_that_is_baked_does_not_read_it(scene, folder, tmp_path, work):
    prepare_scene(scene)
    work.clear()
    show(create_glint_material("Halo", tmp_path / "flakes.png", interpolation="CLOSEST", distribution="GGX"))
    create_glint_material("Turned", tmp_path / "flakes.png", convention="DIRECTX")
    assert not work
    assert prepare_scene(scene)["counts"]["images_read"] == 0


def test_a_map_that_changed_since_it_was_baked_is_refused_when_its_material_is_made(scene, folder, tmp_path):
    prepare_scene(scene)
    blacken(tmp_path / "flakes.png")
    bpy.data.images["flakes.png"].reload()
    with pytest.raises(MapError, match="no pixel that faces up"):
        create_glint_material("Halo", tmp_path / "flakes.png", distribution="GGX")


def test_a_map_that_changed_unknown_to_blender_is_refused_when_it_is_baked(scene, folder, tmp_path):
    prepare_scene(scene)
    blacken(tmp_path / "flakes.png")
    show(create_glint_material("Halo", tmp_path / "flakes.png", distribution="GGX"))
    with pytest.raises(MapError, match="no pixel that faces up"):
        prepare_scene(scene)


def test_an_unknown_convention_is_refused_of_a_map_that_is_baked_too(scene, folder, tmp_path):
    prepare_scene(scene)
    with pytest.raises(MapError, match='Convention "VULKAN" is unknown'):
        create_glint_material("Halo", tmp_path / "flakes.png", convention="VULKAN")


def test_a_map_that_is_read_in_two_ways_is_decoded_once(scene, folder, tmp_path, work):
    other = write_flake_map(tmp_path / "other.png", 2 * MAP_SIDE)
    show(create_glint_material("Other", other), create_glint_material("Smooth", tmp_path / "flakes.png"))
    work.clear()
    report = prepare_scene(scene)
    assert report["counts"]["images_read"] == work["read"] == work["decoded"] == 2
    assert report["counts"]["tables_baked"] == 3 + len([path for path in report["baked"] if "_index" in path])
    assert len(report["levels"]) == 3


def test_a_map_that_is_read_in_both_conventions_has_tables_of_both(scene, folder, tmp_path, work):
    show(create_glint_material("Turned", tmp_path / "flakes.png", interpolation="CLOSEST", convention="DIRECTX"))
    work.clear()
    report = prepare_scene(scene)
    tables = [path for path in report["baked"] if "_index" not in path]
    assert work["decoded"] == 2 and len(set(tables)) == 2


def test_a_painted_map_that_is_shown_as_colour_is_digested_once_for_all_that_read_it(scene, folder, work):
    image = maps.blender_image("Painted", maps.flakes(MAP_SIDE, std=0.2), is_data=False)
    show(*(create_glint_material(name, image, distribution=name) for name in ("BECKMANN", "GGX")))
    prepare_scene(scene)
    work.clear()
    prepare_scene(scene)
    assert work["digested"] == 1 and changes_since_prepared(scene) == []


def test_the_objects_of_a_scene_are_searched_for_glints_once(scene, folder, work):
    prepare_scene(scene)
    assert work["objects searched"] == len(scene.objects) and changes_since_prepared(scene) == []


def blacken(file):
    """Let the file of a map be a black picture."""
    image = bpy.data.images.new("Black", 8, 8)
    image.filepath_raw, image.file_format = str(file), "PNG"
    image.save()
    bpy.data.images.remove(image)
