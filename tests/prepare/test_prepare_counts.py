"""prepare_scene does no work twice: tables baked, bytes and images read, counted over frames and scenes."""

from pathlib import Path

import bpy
import pytest

from demo_scenes import maps
from glint_addon import create_glint_material, prepare_scene
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
    other.camera = scene.camera
    other.collection.objects.link(bpy.data.objects["Mesh"])
    assert prepare_scene(other)["counts"] == {**first, **IDLE}


def test_a_map_that_no_file_holds_is_read_again_and_baked_once(scene, folder):
    """A painted or generated image does not say whether it changed."""
    image = maps.blender_image("Painted", maps.flakes(MAP_SIDE, std=0.2))
    bpy.data.objects["Mesh"].data.materials.append(create_glint_material("Painted", image))
    assert prepare_scene(scene)["counts"]["tables_baked"] == 2
    assert prepare_scene(scene)["counts"] | {"images_read": 0} == prepare_scene(scene)["counts"] | IDLE


def test_a_scene_with_no_glints_counts_nothing(scene):
    counts = prepare_scene(scene)["counts"]
    assert counts and not any(counts.values())
