"""Which tables prepare_scene bakes, keeps and leaves out: levels by what the camera sees, memory by the budget."""

from pathlib import Path

import bpy
import numpy as np
import pytest

import glint_addon
from glint_addon import create_glint_material, prepare_scene
from glint_addon.bake import counts, slope_index
from glint_addon.bake.normal_map import decoded_normals
from glint_addon.errors import CancelledError
from glint_addon.images import image_pixels
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import glint_bsdf
from glint_addon.nodes.builder import STAMP
from glint_addon.nodes.map_binding import map_of
from glint_addon.paths import TABLE_FOLDER_NAME, disk_path
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.old_group import make_old
from tests.prepare.test_prepare import plain, state, tables

SIDE = 256  # texels; the map's blocks are 32, 64 and 128 wide
BLOCKS = [32, 128]
PLANE = 2.0  # metres
PIXELS = 32
MIB = 2**20
TABLE = SIDE * SIDE * 16  # bytes of a Closest table of normals
INDEX = np.prod(slope_index.index_shape(SIDE, SIDE)) * 16  # bytes


@pytest.fixture
def plane(scene, tmp_path):
    """A square with glints under a sun, in a saved file."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 3), width=1.0)
    flakes = write_flake_map(tmp_path / "flakes.png", SIDE)
    return cycles.add_plane(
        scene, PLANE, material=create_glint_material("Sparkle", flakes, interpolation="CLOSEST")
    )


def look(scene, texels):
    """Let the camera see `texels` to a pixel."""
    scene.camera.data.ortho_scale = texels * PIXELS * PLANE / SIDE


def group_of(plane, slot=0):
    (group,) = glint_groups(plane.material_slots[slot].material)
    return group


def shown(group) -> dict:
    """What the shader is told of the counts."""
    inputs = group.nodes[glint_bsdf.SCRIPT_NODE].inputs
    names = ("CountsTable", "CountsFirst", "CountsLevels", "BinLow", "BinHigh")
    found = {name: plain(inputs[name].default_value) for name in names}
    return found | {"CountsTable": str(disk_path(found["CountsTable"])) if found["CountsTable"] else ""}


def counts_files(report, kind) -> list[str]:
    return [path for path in report[kind] if path.rpartition(".")[0].endswith(("_64", "_128"))]


# --- levels ---


def test_a_near_view_bakes_no_counts_and_a_far_one_bakes_the_levels_it_reaches(scene, plane):
    look(scene, 1)
    assert prepare_scene(scene)["levels"] == {"flakes.png": None}
    assert shown(group_of(plane)) == {
        "CountsTable": "", "CountsFirst": 0, "CountsLevels": 0, "BinLow": (0, 0, 0), "BinHigh": (0, 0, 0)}
    look(scene, 64)
    report = prepare_scene(scene)
    (path,) = counts_files(report, "baked")
    assert report["levels"] == {"flakes.png": BLOCKS} and path.endswith("_32_128.exr")
    # And the index; the table of normals was there.
    assert report["counts"]["tables_baked"] == 2 and report["counts"]["tables_in_use"] == 3
    index = group_of(plane).nodes[glint_bsdf.SCRIPT_NODE].inputs["IndexTable"].default_value
    assert str(disk_path(index)) in report["baked"] and index.startswith("//")
    low, high = counts.slope_box(decoded_normals(image_pixels(map_of(group_of(plane)))))
    assert shown(group_of(plane)) == {
        "CountsTable": path, "CountsFirst": 32, "CountsLevels": 3, "BinLow": (*low, 0), "BinHigh": (*high, 0)}


def test_prepared_again_the_counts_are_found_without_reading_the_image(scene, plane, tmp_path):
    look(scene, 64)
    first = prepare_scene(scene)
    before, files = state(scene), tables(tmp_path / TABLE_FOLDER_NAME)
    second = prepare_scene(scene)
    assert second["reused"] == first["baked"] and not second["baked"] and second["levels"] == first["levels"]
    assert second["counts"] == first["counts"] | {"tables_baked": 0, "bytes_baked": 0, "images_read": 0}
    assert state(scene) == before and tables(tmp_path / TABLE_FOLDER_NAME) == files


def test_counts_of_more_levels_than_needed_are_kept_and_of_fewer_are_baked_again(scene, plane):
    look(scene, 600)
    assert prepare_scene(scene)["levels"] == {"flakes.png": [128, 128]}
    look(scene, 64)
    wide = prepare_scene(scene)
    assert wide["levels"] == {"flakes.png": BLOCKS} and len(wide["baked"]) == 1
    look(scene, 600)
    report = prepare_scene(scene)
    assert report["levels"] == {"flakes.png": BLOCKS} and not report["baked"]
    look(scene, 1)
    assert prepare_scene(scene)["levels"] == {"flakes.png": None} and shown(group_of(plane))["CountsTable"] == ""


def test_a_deleted_file_is_baked_again_and_nothing_else(scene, plane):
    look(scene, 64)
    baked = prepare_scene(scene)["baked"]
    for path in (*counts_files({"baked": baked}, "baked"), str(disk_path(group_of(plane)["glint_index"]))):
        Path(path).unlink()
        report = prepare_scene(scene)
        assert report["baked"] == [path] and sorted(report["reused"]) == sorted(set(baked) - {path})


def test_materials_that_read_a_map_alike_share_its_counts(scene, plane, tmp_path):
    look(scene, 64)
    plane.data.materials.append(
        create_glint_material("GGX", tmp_path / "flakes.png", interpolation="CLOSEST", distribution="GGX"))
    report = prepare_scene(scene)
    assert len(report["baked"]) == 3 and sorted(report["reused"]) == sorted(report["baked"])
    assert report["counts"]["images_read"] == 1 and shown(group_of(plane, 0)) == shown(group_of(plane, 1))
    assert prepare_scene(scene)["counts"]["tables_in_use"] == 3


def test_each_way_of_reading_a_map_is_named_in_the_report(scene, plane, tmp_path):
    look(scene, 64)
    plane.data.materials.append(create_glint_material("Smooth", tmp_path / "flakes.png"))
    assert prepare_scene(scene)["levels"] == {group_of(plane, 0).name: BLOCKS, group_of(plane, 1).name: [16, 128]}


def test_two_scenes_keep_the_levels_of_both(scene, plane):
    look(scene, 64)
    prepare_scene(scene)
    other = bpy.data.scenes.new("Other")
    cycles.set_up_cycles(other)
    other.collection.objects.link(plane)
    cycles.add_camera(other, (0, 0, 3), width=0.5)
    report = prepare_scene(other)
    assert report["levels"] == {"flakes.png": BLOCKS} and not report["baked"]


def test_a_changed_map_has_its_counts_baked_again(scene, plane, tmp_path):
    look(scene, 64)
    old = prepare_scene(scene)["baked"]
    write_flake_map(tmp_path / "flakes.png", SIDE // 2)
    report = prepare_scene(scene)
    assert len(report["baked"]) == 3 and not set(report["baked"]) & set(old)
    assert shown(group_of(plane))["CountsTable"] == counts_files(report, "baked")[0]


def test_a_group_of_another_version_gets_fresh_tables(scene, plane):
    look(scene, 64)
    first = prepare_scene(scene)
    before = shown(group_of(plane))
    make_old(group_of(plane))
    report = prepare_scene(scene)
    # Their names are their contents: the files are the same, but the map was read to find that out.
    assert report["reused"] == first["baked"] and report["counts"]["images_read"] == 1
    assert shown(group_of(plane)) == before and group_of(plane)[STAMP] == glint_bsdf.VERSION


def test_a_group_of_another_version_that_no_camera_sees_stays_as_it_is(scene, plane):
    """Its shader may lack inputs of this version."""
    group = group_of(plane)
    make_old(group)
    group.nodes.remove(group.nodes[glint_bsdf.SCRIPT_NODE])
    group.nodes.new("ShaderNodeScript").name = glint_bsdf.SCRIPT_NODE
    plane.location.z = 50.0
    assert prepare_scene(scene)["unseen"] == ["Sparkle"]
    assert group_of(plane)[STAMP] == 9 and not group_of(plane).nodes[glint_bsdf.SCRIPT_NODE].inputs
    plane.location.z = 0.0
    assert prepare_scene(scene)["unseen"] == [] and "Visits" in group_of(plane).nodes[glint_bsdf.SCRIPT_NODE].inputs


def test_a_missing_map_keeps_its_counts(scene, plane, tmp_path):
    look(scene, 64)
    first = prepare_scene(scene)
    (tmp_path / "flakes.png").unlink()
    map_of(group_of(plane)).reload()
    before = shown(group_of(plane))
    assert sorted(prepare_scene(scene)["reused"]) == sorted(first["baked"]) and shown(group_of(plane)) == before


# --- cancelling ---


@pytest.mark.parametrize("kind", [CancelledError, KeyboardInterrupt])
@pytest.mark.parametrize("when", ["at once", "half-way", "in the counts", "at the end"])
def test_cancelled_at_any_time_nothing_has_changed(scene, plane, tmp_path, kind, when):
    look(scene, 64)
    before = state(scene)

    def progress(fraction, text):
        late = {"at once": 0.0, "half-way": 0.1, "in the counts": 0.5, "at the end": 1.0}[when]
        if fraction >= late:
            raise kind("stopped")

    with pytest.raises(kind):
        prepare_scene(scene, progress=progress)
    assert state(scene) == before and not (tmp_path / TABLE_FOLDER_NAME).exists()


def test_cancelling_takes_back_only_what_was_baked_now(scene, plane, tmp_path):
    prepare_scene(scene)
    before, files = state(scene), tables(tmp_path / TABLE_FOLDER_NAME)
    look(scene, 64)

    def progress(fraction, text):
        if fraction > 0.5:
            raise CancelledError("stopped")

    with pytest.raises(CancelledError):
        prepare_scene(scene, progress=progress)
    assert state(scene) == before and tables(tmp_path / TABLE_FOLDER_NAME) == files


# --- budget ---


def test_within_the_budget_nothing_is_said(scene, plane):
    look(scene, 64)
    report = prepare_scene(scene, table_budget=16)
    assert report["warnings"] == [] and report["levels"] == {"flakes.png": BLOCKS}


def test_a_small_budget_drops_the_finest_counts_first(scene, plane):
    look(scene, 64)
    columns, rows = counts.file_size(SIDE, SIDE, "CLOSEST", (128, 128))
    report = prepare_scene(scene, table_budget=(TABLE + INDEX + columns * rows * 16) / MIB)
    assert report["levels"] == {"flakes.png": [128, 128]} and shown(group_of(plane))["CountsFirst"] == 128
    (sentence,) = report["warnings"]
    assert "flakes.png" in sentence and "budget" in sentence and "raise Table Budget" in sentence
    assert ": " in sentence and sentence.endswith(".")
    report = prepare_scene(scene, table_budget=(TABLE + INDEX) / MIB)
    assert report["levels"] == {"flakes.png": None} and len(report["warnings"]) == 1 and group_of(plane)["glint_index"]
    report = prepare_scene(scene, table_budget=TABLE / MIB)
    assert len(report["warnings"]) == 1 and group_of(plane)["glint_table"] and not group_of(plane)["glint_index"]
    # With room again, all come back.
    assert prepare_scene(scene, table_budget=16)["levels"] == {"flakes.png": BLOCKS}


@pytest.mark.parametrize("budget", [0, 0.01, 0.99 * TABLE / MIB])
def test_a_budget_too_small_for_the_normals_leaves_blenders_own_nodes(scene, plane, tmp_path, budget):
    report = prepare_scene(scene, table_budget=budget)
    (sentence,) = report["warnings"]
    assert "flakes.png" in sentence and "Blender's own nodes" in sentence and "raise Table Budget" in sentence
    assert not report["baked"] and not report["reused"] and not (tmp_path / TABLE_FOLDER_NAME).exists()
    assert group_of(plane).nodes[glint_bsdf.SCRIPT_NODE].inputs["Table"].default_value == ""
    lit = cycles.rendered(scene)[..., :3]
    assert np.isfinite(lit).all()
    assert prepare_scene(scene)["warnings"] == [] and group_of(plane)["glint_table"]


def test_the_largest_map_goes_without_a_table_first(scene, plane, tmp_path):
    small = write_flake_map(tmp_path / "small.png", SIDE // 2)
    plane.data.materials.append(create_glint_material("Small", small, interpolation="CLOSEST"))
    (sentence,) = prepare_scene(scene, table_budget=TABLE / MIB)["warnings"]
    assert "flakes.png" in sentence and "small.png" not in sentence
    assert not group_of(plane, 0)["glint_table"] and group_of(plane, 1)["glint_table"]


def test_the_scenes_own_budget_counts_where_the_caller_gives_none(scene, plane):
    glint_addon.register()
    try:
        assert scene.glint.table_budget == 2048
        scene.glint.table_budget = 1
        plane.data.materials.append(create_glint_material("Linear", map_of(group_of(plane))))
        assert prepare_scene(scene)["warnings"] and not prepare_scene(scene, table_budget=16)["warnings"]
    finally:
        glint_addon.unregister()
