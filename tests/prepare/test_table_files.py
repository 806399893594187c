"""Tables stay with their .blend file: saved, moved, copied, linked and appended, a farm shows the same picture."""

import errno
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import glint_addon
from glint_addon import create_glint_material, paths, prepare_scene
from glint_addon.nodes import image_choice
from glint_addon.nodes.glint_bsdf import is_glint_group
from glint_addon.prepare import file_events, table_files
from glint_addon.prepare.changes import changes_since_prepared
from glint_addon.prepare.table_files import groups_with_tables, table_paths
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.old_group import make_old
from tests.helpers.stress_stage import sunny_square

SIZE = (12, 12)  # pixels
SPP = 2
FILES = 4  # tables of the scene: normals, index, counts, pyramid
FOLDER = paths.TABLE_FOLDER_NAME


@pytest.fixture(scope="module")
def made_once(tmp_path_factory):
    """A prepared file, show/scene.blend, and what it shows."""
    folder = tmp_path_factory.mktemp("made") / "show"
    folder.mkdir()
    flakes = write_flake_map(folder / "flakes.png")
    scene = fresh()
    save(folder / "scene.blend")
    glitter = create_glint_material("Glitter", flakes, interpolation="CLOSEST", roughness=0.2)
    add_set(scene, glitter, shown_image(flakes))
    bpy.ops.file.make_paths_relative()
    assert prepare_scene(scene)["hints"] == ["Sun"] and len(files_in(folder / FOLDER)) == FILES
    picture = cycles.rendered(scene)[..., :3]
    bpy.ops.wm.save_mainfile()
    return SimpleNamespace(folder=folder, picture=picture)


@pytest.fixture
def saved(made_once, tmp_path, registered):
    """The open, prepared file show/scene.blend: its scene, folder and picture, which needs all its tables."""
    folder = tmp_path / "show"
    shutil.copytree(made_once.folder, folder)
    bpy.ops.wm.open_mainfile(filepath=str(folder / "scene.blend"))
    return SimpleNamespace(scene=bpy.context.scene, folder=folder, blend=folder / "scene.blend",
                           picture=made_once.picture)


@pytest.fixture
def prepared(made_once, tmp_path, registered):
    """The same as a file that was never saved, whose tables are in the user's folder."""
    shutil.rmtree(paths.table_folder(), ignore_errors=True)
    paths.table_folder().parent.mkdir(parents=True, exist_ok=True)
    shutil.copytree(made_once.folder / FOLDER, paths.table_folder())
    fresh()
    append(made_once.folder / "scene.blend", ["Scene"], "Scene")
    for group in groups_with_tables():
        table_files.change_paths(group, lambda path: str(paths.table_folder() / Path(path).name))
    bpy.data.scenes.remove(bpy.data.scenes["Scene"])
    [scene] = bpy.data.scenes
    scene.name = "Scene"
    return SimpleNamespace(scene=scene, picture=made_once.picture)


def add_set(scene, glitter, shown):
    """A square of glints under a sun, seen from far, and before it a small square that shows an image."""
    sunny_square(scene, glitter)
    board = cycles.add_plane(scene, 0.4, material=shown, repeats=8.0)
    board.location = (0.5, -0.5, 0.5)


def shown_image(file):
    """A material that shines with a mipmapped image."""
    material, colour = cycles.emission_material("Shown")
    node = image_choice.add_node(material.node_tree, bpy.data.images.load(str(file), check_existing=True))
    material.node_tree.links.new(node.outputs["Color"], colour)
    return material


def save(blend, **options):
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), **options)


def fresh(blend=None):
    """An empty file, saved as `blend` if given."""
    scene = cycles.empty_scene(size=SIZE, spp=SPP)
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    if blend is not None:
        blend.parent.mkdir()
        save(blend)
    return scene


def files_in(folder) -> list[str]:
    return sorted(file.name for file in folder.iterdir()) if folder.is_dir() else []


def named() -> list[str]:
    """All paths that the open file names."""
    return [path for group in groups_with_tables() for path in table_paths(group)]


def assert_beside():
    """The open file names its tables by where they are relative to it, and they are there."""
    assert len(set(named())) == FILES
    for path in named():
        assert path.startswith(f"//{FOLDER}/") and paths.disk_path(path).is_file()


def test_the_picture_needs_its_tables(farm, saved):
    """Or sameness would say nothing."""
    shutil.rmtree(saved.folder / FOLDER)
    difference = np.abs(farm.picture_of(saved.blend) - saved.picture) > 0.1 * saved.picture.mean()
    assert difference.mean() > 0.5


# --- saving ---


def test_tables_of_an_unsaved_file_move_beside_it_when_it_is_saved(farm, prepared, tmp_path):
    assert all(Path(path).parent == paths.table_folder() for path in named())
    np.testing.assert_array_equal(farm.rendered(tmp_path), prepared.picture)
    assert_beside()
    assert files_in(paths.table_folder()) == [] and len(files_in(tmp_path / FOLDER)) == FILES
    assert changes_since_prepared(bpy.context.scene) == []
    assert prepare_scene(bpy.context.scene)["baked"] == []


def test_a_name_without_a_folder_is_one_in_the_working_folder(prepared, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save("scene.blend")
    assert_beside()
    assert files_in(paths.table_folder()) == [] and len(files_in(tmp_path / FOLDER)) == FILES


@pytest.mark.parametrize("has_links", [True, False])
def test_saved_elsewhere_both_files_have_their_tables(saved, tmp_path, monkeypatch, has_links):
    if not has_links:
        monkeypatch.setattr(os, "link", raise_error(errno.EPERM))
    before = {name: (saved.folder / FOLDER / name).read_bytes() for name in files_in(saved.folder / FOLDER)}
    other = tmp_path / "elsewhere"
    other.mkdir()
    save(other / "scene.blend")
    assert_beside()
    for folder in (saved.folder, other):
        assert {name: (folder / FOLDER / name).read_bytes() for name in files_in(folder / FOLDER)} == before
    one, two = (folder / FOLDER / next(iter(before)) for folder in (saved.folder, other))
    assert one.samefile(two) == has_links
    shutil.rmtree(saved.folder)
    bpy.ops.wm.open_mainfile(filepath=str(other / "scene.blend"))
    assert_beside()


def test_the_copy_of_a_saved_file_has_tables_of_its_own(saved, tmp_path):
    before = named()
    (tmp_path / "copies").mkdir()
    save(tmp_path / "copies" / "copy.blend", copy=True)
    assert named() == before and bpy.data.filepath == str(saved.blend)
    assert_beside()
    shutil.rmtree(saved.folder)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "copies" / "copy.blend"))
    assert_beside()


def test_the_copy_of_an_unsaved_file_leaves_that_its_tables(prepared, tmp_path):
    before = named()
    save(tmp_path / "copy.blend", copy=True)
    assert named() == before and all(Path(path).is_file() for path in before)
    shutil.rmtree(paths.table_folder())
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "copy.blend"))
    assert_beside()


@pytest.mark.parametrize("what", ["a folder", "no folder", "a library"])
@pytest.mark.parametrize("is_saved", [False, True])
def test_where_saving_fails_all_is_as_before(prepared, tmp_path, what, is_saved):
    if is_saved:
        save(tmp_path / "scene.blend")
    target = tmp_path / "target" / "scene.blend"
    if what == "a folder":
        target.mkdir(parents=True)
    elif what == "a library":
        target.parent.mkdir()
        bpy.data.libraries.write(str(target), {bpy.data.meshes[0]})
        with bpy.data.libraries.load(str(target), link=True) as (found, wanted):
            wanted.meshes = found.meshes
    before, files = named(), sorted(tmp_path.rglob("*"))
    with pytest.raises(RuntimeError):
        save(target)
    assert named() == before and sorted(tmp_path.rglob("*")) == files
    assert all(paths.disk_path(path).is_file() for path in before)
    save(tmp_path / "again.blend")
    assert_beside()


def test_where_saving_fails_tables_that_were_there_stay(saved, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(saved.folder, other)
    (other / "folder.blend").mkdir()
    before = files_in(other / FOLDER)
    (other / FOLDER / before[0]).unlink()
    with pytest.raises(RuntimeError):
        save(other / "folder.blend")
    assert files_in(other / FOLDER) == before[1:]


def raise_error(number):
    def function(*_, **__):
        raise OSError(number, os.strerror(number))
    return function


@pytest.mark.parametrize("is_saved", [False, True])
@pytest.mark.parametrize("problem", ["full", "read-only"])
def test_where_tables_cannot_be_brought_they_are_named_where_they_are(
        prepared, tmp_path, monkeypatch, problem, is_saved):
    home = paths.table_folder()
    (tmp_path / "target").mkdir()
    if is_saved:
        save(tmp_path / "scene.blend")
        home = tmp_path / FOLDER
    with monkeypatch.context() as patch:
        if problem == "full":
            patch.setattr(os, "link", raise_error(errno.EXDEV))
            patch.setattr(shutil, "copyfile", raise_error(errno.ENOSPC))
        else:
            patch.setattr(Path, "mkdir", raise_error(errno.EACCES))
        save(tmp_path / "target" / "scene.blend")
    assert files_in(tmp_path / "target") == ["scene.blend"]
    assert all(Path(path).parent == home and Path(path).is_file() for path in named())
    # With room again they come along.
    save(tmp_path / "target" / "scene.blend")
    assert_beside()


def test_a_folder_that_may_not_be_looked_into_is_no_error(saved, monkeypatch):
    monkeypatch.setattr(Path, "stat", raise_error(errno.EACCES))
    stored = named()
    assert [table_files._found(path, [saved.folder / FOLDER]) for path in stored] == stored


def test_a_damaged_file_of_that_name_is_replaced(saved, tmp_path):
    other = tmp_path / "other"
    (other / FOLDER).mkdir(parents=True)
    name = files_in(saved.folder / FOLDER)[0]
    (other / FOLDER / name).write_bytes(b"half")
    save(other / "scene.blend")
    assert_beside()
    assert (other / FOLDER / name).read_bytes() == (saved.folder / FOLDER / name).read_bytes()
    assert files_in(other / FOLDER) == files_in(saved.folder / FOLDER)


def test_nothing_happens_for_the_startup_file(prepared):
    before, startup = named(), Path(bpy.utils.user_resource("CONFIG")) / "startup.blend"
    calls = []
    bpy.app.handlers.save_pre.append(lambda file, *_: calls.append(file))
    try:
        bpy.ops.wm.save_homefile()
    finally:
        bpy.app.handlers.save_pre.pop()
        startup.unlink()
    assert calls == [""] and named() == before
    assert all(Path(path).is_file() for path in before) and not (startup.parent / FOLDER).exists()


# --- undoing ---


def test_undoing_and_redoing_past_the_first_save_finds_the_tables(prepared, tmp_path):
    bpy.ops.ed.undo_push(message="prepared")
    prepared.scene["mark"] = 1
    bpy.ops.ed.undo_push(message="later")
    save(tmp_path / "scene.blend")
    bpy.ops.ed.undo()
    assert "mark" not in bpy.context.scene and files_in(paths.table_folder()) == []
    assert_beside()
    bpy.ops.ed.redo()
    assert "mark" in bpy.context.scene
    assert_beside()


def test_undoing_leads_to_tables_that_only_an_earlier_folder_has(saved, tmp_path):
    bpy.ops.ed.undo_push(message="one map")
    old = set(named())
    write_flake_map(saved.folder / "flakes.png", 16)
    assert len(prepare_scene(saved.scene)["baked"]) > 0
    bpy.ops.ed.undo_push(message="another map")
    assert set(named()) - old
    (tmp_path / "elsewhere").mkdir()
    save(tmp_path / "elsewhere" / "scene.blend")
    bpy.ops.ed.undo()
    assert {Path(path).name for path in named()} == {Path(path).name for path in old}
    assert all(Path(path).parent == saved.folder / FOLDER and Path(path).is_file() for path in named())
    save(tmp_path / "elsewhere" / "scene.blend")
    assert_beside()


# --- moving ---


def renamed(folder):
    return folder.rename(folder.with_name("renamed"))


def copied(folder):
    shutil.copytree(folder, folder.with_name("copied"))
    shutil.rmtree(folder)
    return folder.with_name("copied")


def mounted(folder):
    folder.with_name("mount").symlink_to(renamed(folder), target_is_directory=True)
    return folder.with_name("mount")


@pytest.mark.parametrize("move", [renamed, copied, mounted])
def test_a_folder_that_was_moved_shows_the_same_picture_without_the_extension(farm, saved, move):
    folder = move(saved.folder)
    np.testing.assert_array_equal(farm.picture_of(folder / "scene.blend"), saved.picture)


def test_a_file_that_is_prepared_through_a_link_to_its_folder_is_moved_like_any_other(saved, tmp_path):
    (tmp_path / "link").symlink_to(saved.folder, target_is_directory=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "link" / "scene.blend"))
    shutil.rmtree(saved.folder / FOLDER)
    assert len(prepare_scene(bpy.context.scene)["baked"]) == FILES - 1  # without the pyramid
    assert bpy.data.filepath == str(tmp_path / "link" / "scene.blend")
    assert_beside()


def test_a_link_to_a_file_finds_the_tables_beside_what_it_links_to(saved, tmp_path):
    """Blender takes the link's folder for that of the file; when it saves, it replaces the link."""
    other = tmp_path / "other"
    other.mkdir()
    (other / "link.blend").symlink_to(saved.blend)
    bpy.ops.wm.open_mainfile(filepath=str(other / "link.blend"))
    assert {Path(path).parent for path in named()} == {saved.folder / FOLDER}
    np.testing.assert_array_equal(cycles.rendered(bpy.context.scene)[..., :3], saved.picture)
    bpy.ops.wm.save_mainfile()
    assert_beside()
    assert len(files_in(other / FOLDER)) == FILES


@pytest.mark.parametrize("system", ["this", "another"])
def test_old_absolute_paths_of_a_folder_that_moved_are_found_when_the_file_opens(saved, system):
    place_of_old = str(saved.folder / FOLDER) + "/" if system == "this" else f"C:\\show\\{FOLDER}\\"
    for group in groups_with_tables():
        if is_glint_group(group):
            make_old(group)
        table_files.change_paths(group, lambda path: place_of_old + Path(path).name)
    glint_addon.unregister()
    bpy.ops.wm.save_mainfile()
    glint_addon.register()
    folder = renamed(saved.folder)
    bpy.ops.wm.open_mainfile(filepath=str(folder / "scene.blend"))
    assert_beside()


# --- linking ---


def linked(blend, kind="materials", **options):
    """All data-blocks of a kind, linked or appended from a file."""
    with bpy.data.libraries.load(str(blend), **options) as (found, wanted):
        setattr(wanted, kind, list(getattr(found, kind)))
    return {block.name: block for block in getattr(wanted, kind)}


def test_a_farm_looks_for_tables_of_linked_materials_beside_the_file_that_it_renders(farm, saved, tmp_path):
    """Not beside the library, as the file of an image: so they must be at both places."""
    shot = tmp_path / "shot"
    scene = fresh(shot / "scene.blend")
    materials = linked(saved.blend, link=True, relative=True)
    assert all((saved.folder / FOLDER).samefile(Path(path).parent) for path in named())
    add_set(scene, materials["Glitter"], materials["Shown"])
    assert prepare_scene(scene)["baked"] == []
    np.testing.assert_array_equal(farm.rendered(shot), saved.picture)
    assert_beside()
    assert files_in(shot / FOLDER) == files_in(saved.folder / FOLDER)

    # A library that moved is no loss, nor one whose tables are gone.
    saved.folder.rename(tmp_path / "renamed")
    shutil.rmtree(tmp_path / "renamed" / FOLDER)
    [library] = bpy.data.libraries
    library.filepath = "//../renamed/scene.blend"
    library.reload()
    assert_beside()
    assert changes_since_prepared(scene) == []
    np.testing.assert_array_equal(farm.rendered(shot), saved.picture)


def test_linked_materials_are_found_before_the_file_is_saved_and_beside_it_then(saved, tmp_path):
    scene = fresh()
    materials = linked(saved.blend, link=True)
    add_set(scene, materials["Glitter"], materials["Shown"])
    prepare_scene(scene)
    assert all(Path(path).parent == saved.folder / FOLDER for path in named())
    np.testing.assert_array_equal(cycles.rendered(scene)[..., :3], saved.picture)
    save(tmp_path / "scene.blend")
    assert_beside()


def test_a_library_that_was_prepared_again_is_followed_when_the_file_opens(saved, tmp_path):
    shot = tmp_path / "shot"
    scene = fresh(shot / "scene.blend")
    materials = linked(saved.blend, link=True, relative=True)
    add_set(scene, materials["Glitter"], materials["Shown"])
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(saved.blend))
    write_flake_map(saved.folder / "flakes.png", 64)
    prepare_scene(bpy.context.scene)
    bpy.ops.wm.save_mainfile()
    new = set(named())
    bpy.ops.wm.open_mainfile(filepath=str(shot / "scene.blend"))
    assert {Path(path).name for path in named()} == {Path(path).name for path in new}
    assert all(paths.disk_path(path).is_file() for path in named())
    bpy.ops.wm.save_mainfile()
    assert set(named()) == new
    assert_beside()


def test_linked_materials_that_are_packed_into_the_file_have_their_tables_beside_it(saved, tmp_path):
    scene = fresh(tmp_path / "shot" / "scene.blend")
    materials = linked(saved.blend, link=True, pack=True)
    add_set(scene, materials["Glitter"], materials["Shown"])
    prepare_scene(scene)
    bpy.ops.wm.save_mainfile()
    saved.folder.rename(tmp_path / "gone")
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert_beside()


def test_linked_materials_that_are_made_local_keep_their_tables(saved, tmp_path):
    scene = fresh(tmp_path / "shot" / "scene.blend")
    glint_addon.unregister()  # or they are found as soon as they are linked
    materials = linked(saved.blend, link=True)
    glint_addon.register()
    add_set(scene, materials["Glitter"], materials["Shown"])
    for thing in scene.objects:
        thing.select_set(True)
    bpy.ops.object.make_local(type="ALL")
    assert all(group.library is None for group in groups_with_tables())
    bpy.ops.wm.save_mainfile()
    assert_beside()
    assert len(files_in(saved.folder / FOLDER)) == FILES


# --- appending ---


def append(blend, names, kind="Material", **options):
    for name in names:
        bpy.ops.wm.append(directory=f"{blend}/{kind}/", filename=name, **options)


def load(blend, names):
    linked(blend, link=False)


@pytest.mark.parametrize("is_saved", [True, False])
@pytest.mark.parametrize("bring", [append, load])
def test_appended_materials_bring_their_tables(farm, saved, tmp_path, bring, is_saved):
    shot = tmp_path / "shot"
    scene = fresh(shot / "scene.blend" if is_saved else None)
    before = files_in(saved.folder / FOLDER)
    bring(saved.blend, ("Glitter", "Shown"))
    assert not bpy.data.objects and not bpy.data.cameras
    if is_saved:
        assert_beside()
    else:
        shot.mkdir()
        assert {Path(path).parent for path in named()} == {saved.folder / FOLDER}
    add_set(scene, bpy.data.materials["Glitter"], bpy.data.materials["Shown"])
    save(shot / "scene.blend")
    assert_beside()
    # What was appended from keeps what it has.
    assert files_in(saved.folder / FOLDER) == files_in(shot / FOLDER) == before
    report = prepare_scene(scene)
    assert report["baked"] == [] and report["hints"] == ["Sun"]
    if bring is append and not is_saved:
        shutil.rmtree(saved.folder)
        np.testing.assert_array_equal(farm.rendered(shot), saved.picture)


def test_an_appended_scene_shows_the_same_picture(farm, saved, tmp_path):
    fresh(tmp_path / "shot" / "scene.blend")
    append(saved.blend, ["Scene"], "Scene")
    scene = next(scene for scene in bpy.data.scenes if scene.objects)
    bpy.context.window.scene = scene
    shutil.rmtree(saved.folder / FOLDER)
    np.testing.assert_array_equal(farm.rendered(tmp_path / "shot"), saved.picture)
    assert changes_since_prepared(bpy.context.scene) == []


@pytest.mark.parametrize("options", [{"do_reuse_local_id": True}, {"use_recursive": False}], ids=str)
def test_materials_appended_twice_name_tables_beside_the_file(saved, tmp_path, options):
    fresh(tmp_path / "shot" / "scene.blend")
    for _ in range(2):
        append(saved.blend, ("Glitter", "Shown"), **options)
        assert_beside()


def test_materials_of_a_library_of_the_library_bring_their_tables(saved, tmp_path):
    """Glints that a file has linked from another folder are appended along with what shows them."""
    between = tmp_path / "between" / "scene.blend"
    scene = fresh(between)
    materials = linked(saved.blend, link=True, relative=True)
    add_set(scene, materials["Glitter"], materials["Shown"])
    bpy.ops.wm.save_mainfile()
    fresh(tmp_path / "shot" / "scene.blend")
    append(between, [thing.name for thing in scene_meshes(between)], "Object", use_recursive=True)
    assert {group.library for group in bpy.data.node_groups} == {None}
    assert_beside()


def scene_meshes(blend):
    with bpy.data.libraries.load(str(blend)) as (found, _):
        return [SimpleNamespace(name=name) for name in found.objects if name.startswith("Mesh")]


# --- the handlers ---


def test_a_group_of_another_kind_is_left_alone(scene):
    group = bpy.data.node_groups.new("Users own", "ShaderNodeTree")
    group["glint_table"] = "//glint_tables/gone.exr"
    assert table_paths(group) == [] and group not in groups_with_tables()


def test_unregistered_nothing_looks_after_tables_any_more(scene, tmp_path):
    glint_addon.register()
    lists = [handlers for handlers, _ in file_events._handlers()]
    assert all(function in handlers for handlers, function in file_events._handlers())
    cycles.empty_scene()
    assert all(function in handlers for handlers, function in file_events._handlers())  # new files leave them
    save(tmp_path / "scene.blend")
    glint_addon.unregister()
    assert not any(function.__module__ == file_events.__name__ for handlers in lists for function in handlers)
    assert not any((file_events._homes, file_events._before, file_events._made))
