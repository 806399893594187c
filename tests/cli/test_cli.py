"""The command line: results on standard output, one sentence and exit code 1 for what cannot be done, 2 for misuse."""

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from glint_addon.cli import command as cli
from glint_addon.cli import pictures
from glint_addon.errors import SceneError
from glint_addon.images import image_pixels
from glint_addon.prepare.shading_system import LEFT_OFF
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def blend(scene, registered, tmp_path) -> Path:
    """A saved file: a plane with a Glint material, a sun and a camera."""
    scene = cycles.empty_scene(size=(16, 16))
    plane = cycles.add_plane(scene)
    bpy.context.view_layer.objects.active = plane
    bpy.ops.glint.add_material(filepath=str(write_flake_map(tmp_path / "flakes.png")))
    cycles.add_sun(scene, (0, 0, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 3))
    file = tmp_path / "glints.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    return file


@pytest.fixture
def quick(scene, registered, tmp_path) -> Path:
    """A saved file of a camera alone, without Open Shading Language: a frame of it takes no time."""
    scene = cycles.empty_scene(size=(16, 16), osl=False)
    cycles.add_camera(scene, (0, 0, 3))
    file = tmp_path / "quick.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    return file


def run(capfd, *words) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command in this process."""
    capfd.readouterr()
    code = cli.main([str(word) for word in words])
    output, errors = capfd.readouterr()
    return code, output, errors


def refused(capfd, *words) -> str:
    """The sentence with which a command refuses."""
    code, output, errors = run(capfd, *words)
    assert code == 1 and output == ""
    sentence = next(line for line in errors.splitlines() if line.startswith("glint: "))
    assert sentence.endswith(".") and "Traceback" not in errors
    return sentence


def test_prepare_saves_what_it_found(capfd, blend):
    code, output, errors = run(capfd, "prepare", blend)
    assert code == 0, errors
    # 32 texels over a few of 16 pixels: the index of the middle distance is baked beside the table.
    summary, counts, saved = output.splitlines()
    assert (summary, saved) == ("Glint: 1 light found, 1 table baked, 0 reused, OSL on.", f"Saved {blend}")
    assert re.fullmatch(r"Tables: 1 baked \((.+ MiB)\), 1 in use \(\1\), 1 image read\.", counts), counts
    assert "%]" in errors
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert bpy.context.scene.glint.prepared and bpy.context.scene.cycles.shading_system
    assert [file.suffix for file in (blend.parent / "glint_tables").iterdir()] == [".exr"]


def test_prepare_again_bakes_nothing(capfd, blend):
    run(capfd, "prepare", blend)
    assert "0 tables baked, 1 reused" in run(capfd, "prepare", blend)[1]


def test_interrupted_while_baking_nothing_has_changed(capfd, blend, monkeypatch):
    """Ctrl-C comes once the pixels are read; the next report of progress ends the bake."""

    def read(image):
        signal.raise_signal(signal.SIGINT)
        return image_pixels(image)

    monkeypatch.setattr("glint_addon.prepare.map_bake.image_pixels", read)
    content, before = blend.read_bytes(), signal.getsignal(signal.SIGINT)
    assert "Stopped with Ctrl-C: nothing has changed" in refused(capfd, "prepare", blend)
    assert blend.read_bytes() == content and not (blend.parent / "glint_tables").exists()
    assert signal.getsignal(signal.SIGINT) == before
    assert not bpy.context.scene.glint.prepared


def test_info_tells_materials_and_lights_before_and_after(capfd, blend):
    content = blend.read_bytes()
    code, output, _ = run(capfd, "info", blend)
    assert code == 0
    lines = ["Material Glint flakes: map flakes.png, table not baked", "Scene Scene: not prepared"]
    assert output.splitlines() == lines
    assert blend.read_bytes() == content
    run(capfd, "prepare", blend)
    lines = run(capfd, "info", blend)[1].splitlines()
    assert "glint_tables" in lines[0] and lines[1] == "Scene Scene: OSL on, CPU, lights: Sun"


def test_info_advises_on_denoising_once_the_scene_is_prepared(capfd, blend):
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.context.scene.cycles.use_denoising = True
    bpy.ops.wm.save_mainfile()
    assert "Advice" not in run(capfd, "info", blend)[1]
    run(capfd, "prepare", blend)
    assert "Advice: Denoising by normals softens glints" in run(capfd, "info", blend)[1].splitlines()[-1]


def test_prepare_and_info_say_where_osl_is_of_no_use(capfd, blend):
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.data.objects.remove(bpy.data.objects["Sun"])
    bpy.context.scene.cycles.shading_system = False
    bpy.ops.wm.save_mainfile()
    for command in ("prepare", "info"):
        assert f"Note: {LEFT_OFF}" in run(capfd, command, blend)[1].splitlines()


def test_info_as_json_is_json_and_nothing_else(capfd, blend):
    facts = json.loads(run(capfd, "info", "--json", blend)[1])
    assert facts["materials"] == [{"name": "Glint flakes", "maps": [{"image": "flakes.png", "table": ""}]}]
    assert facts["scenes"][0]["prepared"] is False


def test_info_notices_that_a_table_was_deleted(capfd, blend):
    run(capfd, "prepare", blend)
    for table in (blend.parent / "glint_tables").iterdir():
        table.unlink()
    assert "table not baked" in run(capfd, "info", blend)[1]


@pytest.mark.parametrize("ending", ["png", "exr"])
def test_render_writes_the_picture_and_leaves_the_file_alone(capfd, blend, tmp_path, ending):
    content = blend.read_bytes()
    picture = tmp_path / "pictures" / f"glints.{ending}"
    code, output, errors = run(capfd, "render", blend, "--output", picture, "--samples", 2)
    assert code == 0, errors
    assert output.splitlines()[-1] == f"Rendered {picture}"
    assert cycles.read_image(picture).shape == (16, 16, 4)
    assert blend.read_bytes() == content


def test_render_without_output_writes_where_the_scene_says(capfd, blend, tmp_path):
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.context.scene.render.filepath = "//frames/"
    bpy.ops.wm.save_mainfile()
    code, output, _ = run(capfd, "render", blend, "--frame", 7)
    assert code == 0
    assert output.splitlines()[-1] == f"Rendered {tmp_path / 'frames' / '0007.png'}"
    assert (tmp_path / "frames" / "0007.png").is_file()


@pytest.mark.parametrize("command", ["prepare", "render", "info"])
def test_a_missing_file_is_named(capfd, registered, tmp_path, command):
    assert "gone.blend is not there" in refused(capfd, command, tmp_path / "gone.blend")


def test_a_file_that_is_no_blend_file_is_named(capfd, registered, tmp_path):
    file = tmp_path / "notes.blend"
    file.write_text("not a .blend", encoding="utf-8")
    assert f"cannot open {file}" in refused(capfd, "info", file)


def test_an_unknown_scene_is_refused_with_the_names_there_are(capfd, blend):
    assert 'no scene named "Other": choose one of Scene' in refused(capfd, "prepare", blend, "--scene", "Other")


def test_a_scene_without_camera_is_refused(capfd, blend):
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    bpy.data.objects.remove(bpy.context.scene.camera)
    bpy.ops.wm.save_mainfile()
    assert "has no camera" in refused(capfd, "render", blend)


def test_a_folder_that_cannot_be_written_is_one_sentence(capfd, blend, tmp_path):
    (tmp_path / "taken").write_text("a file where the folder should be", encoding="utf-8")
    assert str(tmp_path / "taken") in refused(capfd, "render", blend, "--output", tmp_path / "taken" / "a.png")


def change(blend, act):
    """Open the file, let `act(scene)` change it, save it."""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    act(bpy.context.scene)
    bpy.ops.wm.save_mainfile()


def rendered(capfd, *words) -> list[Path]:
    """The files that a command says it rendered, all of which exist."""
    code, output, errors = run(capfd, "render", *words)
    assert code == 0, errors
    files = [Path(line.removeprefix("Rendered ")) for line in output.splitlines() if line.startswith("Rendered ")]
    assert all(file.is_file() for file in files)
    return files


def names_in(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_frames_are_numbered_before_the_ending_in_the_folder_of_the_blend_file(capfd, quick):
    files = rendered(capfd, quick, "--frames", "1-2,7", "--output", "//frames/shot.png")
    assert [file.name for file in files] == ["shot0001.png", "shot0002.png", "shot0007.png"]
    assert names_in(quick.parent / "frames") == [file.name for file in files]


def test_frames_below_zero_are_rendered_too(capfd, quick):
    files = rendered(capfd, quick, "--frames=-2-1x3", "--output", "//frames/")
    assert [file.name for file in files] == ["-0002.png", "0001.png"]


@pytest.mark.parametrize(
    ("output", "name"),
    [
        ("//out/still.png", "out/still.png"),
        ("//out/still.EXR", "out/still.EXR"),
        ("//out/a_##.jpg", "out/a_07.jpg"),
        ("//out/a.#####", "out/a.00007.png"),
        ("//out/", "out/0007.png"),
        ("//out/still", "out/still.png"),
        ("//out/shot.v2_", "out/shot.v2_.png"),
        ("//a/../{blend_name}_#.png", "quick_7.png"),
    ],
)
def test_a_still_goes_where_blenders_notation_says(capfd, quick, output, name):
    assert rendered(capfd, quick, "--frame", 7, "--output", output) == [quick.parent / name]


def test_a_still_replaces_the_one_before_whatever_the_scene_says(capfd, quick):
    change(quick, lambda scene: setattr(scene.render, "use_overwrite", False))
    for output in ("//still.png", "//still_##.png"):
        (first,) = rendered(capfd, quick, "--output", output, "--resolution", "8x8")
        assert rendered(capfd, quick, "--output", output) == [first]
        assert cycles.read_image(first).shape == (16, 16, 4)


def test_the_animation_has_the_scenes_range_and_step(capfd, quick):
    def act(scene):
        scene.frame_start, scene.frame_end, scene.frame_step = 2, 6, 3

    change(quick, act)
    files = rendered(capfd, quick, "--animation", "--output", "//frames/a_")
    assert [file.name for file in files] == ["a_0002.png", "a_0005.png"] == names_in(quick.parent / "frames")


def test_frames_that_are_there_stay_where_the_scene_does_not_overwrite(capfd, quick):
    change(quick, lambda scene: setattr(scene.render, "use_overwrite", False))
    rendered(capfd, quick, "--frames", "1", "--output", "//frames/")
    content = (quick.parent / "frames" / "0001.png").read_bytes()
    words = ("--frames", "1-2", "--output", "//frames/", "--resolution", "8x8")
    lines = run(capfd, "render", quick, *words)[1].splitlines()[-2:]
    assert lines[0] == f"Kept {quick.parent / 'frames' / '0001.png'}, because the scene does not overwrite"
    assert lines[1] == f"Rendered {quick.parent / 'frames' / '0002.png'}"
    assert (quick.parent / "frames" / "0001.png").read_bytes() == content


@pytest.mark.parametrize("words", [("--frame", 1), ("--frames", 1)])
@pytest.mark.parametrize(
    ("views_format", "endings"), [("INDIVIDUAL", ["_L.png", "_R.png"]), ("STEREO_3D", [".png"])]
)
def test_stereo_names_the_files_that_it_wrote(capfd, quick, words, views_format, endings):
    def act(scene):
        scene.render.use_multiview = True
        scene.render.image_settings.views_format = views_format

    change(quick, act)
    files = rendered(capfd, quick, *words, "--output", "//eyes/####.png")
    assert [file.name for file in files] == [f"0001{ending}" for ending in endings] == names_in(quick.parent / "eyes")


def test_stereo_of_a_still_without_number_has_a_file_for_each_eye(capfd, quick):
    def act(scene):
        scene.render.use_multiview = True
        scene.render.image_settings.views_format = "INDIVIDUAL"

    change(quick, act)
    assert [file.name for file in rendered(capfd, quick, "--output", "//eyes.png")] == ["eyes_L.png", "eyes_R.png"]


@pytest.mark.parametrize(("output", "name"), [("//a.mp4", "a.mp4"), ("//a_", "a_0002-0004.mkv")])
def test_a_movie_is_named_as_blender_names_it(capfd, quick, output, name):
    def act(scene):
        if output == "//a_":
            scene.render.image_settings.media_type = "VIDEO"

    change(quick, act)
    words = ("--frames", "2-4", "--output", output, "--resolution", "64x64")
    assert rendered(capfd, quick, *words) == [quick.parent / name]


@pytest.mark.parametrize("words", [(), ("--frame", 2), ("--frames", "1-2,9")])
def test_a_movie_is_refused_where_its_frames_are_no_range(capfd, quick, words):
    assert "writes a movie, which holds one range" in refused(capfd, "render", quick, "--output", "//a.mp4", *words)


def test_layers_of_an_exr_are_kept(capfd, quick):
    def act(scene):
        scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"

    change(quick, act)
    rendered(capfd, quick, "--output", "//layers.exr")
    assert bpy.context.scene.render.image_settings.file_format == "OPEN_EXR_MULTILAYER"
    rendered(capfd, quick, "--output", "//flat.png")
    assert bpy.context.scene.render.image_settings.file_format == "PNG"


def test_a_scene_without_frames_is_refused(quick):
    """Blender's own settings never cross; a file may hold it all the same."""
    with pytest.raises(SceneError, match="has no frames"):
        pictures.check_output(bpy.context.scene, [range(5, 5)])


@pytest.mark.parametrize("words", [("--frames", "1-9"), ("--frame", 1)])
def test_a_render_that_writes_nothing_is_an_error(capfd, quick, monkeypatch, words):
    """As when a handler of another extension calls the render off, or a picture of old is all there is."""
    (quick.parent / "a0001.png").write_bytes(b"old")
    monkeypatch.setattr(pictures, "blender", lambda aim, operator, **settings: None)
    sentence = refused(capfd, "render", quick, *words, "--output", "//a.png")
    assert "frame 1, 2, 3 and 6 more" in sentence if words[0] == "--frames" else "wrote no" in sentence


@pytest.mark.parametrize(("words", "shape"), [("24x8", (8, 24, 4)), ("50%", (8, 8, 4))])
def test_resolution_is_pixels_or_a_share_of_the_scenes(capfd, quick, words, shape):
    (file,) = rendered(capfd, quick, "--resolution", words, "--output", "//a.exr")
    assert cycles.read_image(file).shape == shape


def test_pixels_are_pixels_whatever_the_scenes_percentage(capfd, quick):
    change(quick, lambda scene: setattr(scene.render, "resolution_percentage", 50))
    (file,) = rendered(capfd, quick, "--resolution", "24x8", "--output", "//a.exr")
    assert cycles.read_image(file).shape == (8, 24, 4)


def test_engine_options_reach_cycles(capfd, blend):
    words = ("use_denoising=yes", "seed=5", "device=cpu", "blur_glossy=0.25", "pixel_filter_type=BOX")
    options = [word for option in (*words, "film_exposure=0") for word in ("--engine-option", option)]
    (file,) = rendered(capfd, blend, "--output", "//a.exr", *options)
    settings = bpy.context.scene.cycles
    assert (settings.use_denoising, settings.seed, settings.device) == (True, 5, "CPU")
    assert (settings.blur_glossy, settings.pixel_filter_type) == (0.25, "BOX")
    assert cycles.read_image(file)[..., :3].max() == 0.0


def test_only_the_named_view_layers_are_rendered(capfd, blend):
    """The second layer leaves out the only collection with anything in it."""
    def act(scene):
        collection = bpy.data.collections.new("Things")
        scene.collection.children.link(collection)
        for thing in list(scene.collection.objects):
            collection.objects.link(thing)
            scene.collection.objects.unlink(thing)
        layer = scene.view_layers.new("Empty")
        layer.layer_collection.children["Things"].exclude = True

    change(blend, act)
    brightest = {}
    for name in ("ViewLayer", "Empty"):
        (file,) = rendered(capfd, blend, "--view-layer", name, "--output", f"//{name}.exr")
        brightest[name] = cycles.read_image(file)[..., :3].max()
        assert [layer.name for layer in bpy.context.scene.view_layers if layer.use] == [name]
    assert brightest["ViewLayer"] > 0.0 == brightest["Empty"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--output", "//picture.txt"), "does not end like a picture or movie"),
        (("--output", ""), "The output has no name"),
        (("--output", "//{nothing}.png"), "{nothing}.png is no name for a picture"),
        (("--samples", "0"), "0 samples cannot be used: give at least 1"),
        (("--samples", "999999999"), "at most 16777216"),
        (("--frame", "1048575"), "Frame 1048575 is outside Blender's range"),
        (("--frame", "99999999999999999999"), "outside Blender's range"),
        (("--frames", "10-1"), "holds no frame"),
        (("--resolution", "big"), "write it like 1920x1080"),
        (("--resolution", "0x10"), "0 pixels of width cannot be used: give at least 4"),
        (("--resolution", "10x99999"), "99999 pixels of height"),
        (("--resolution", "0%"), "0% of the resolution cannot be used"),
        (("--view-layer", "Sky"), 'no view layer named "Sky": choose among ViewLayer'),
        (("--engine-option", "use_denoising"), "has no value: write NAME=VALUE"),
        (("--engine-option", "use_denoise=1"), "near to it: use_denoising"),
        (("--engine-option", "dicing_camera=Camera"), 'no option named "dicing_camera"'),
        (("--engine-option", "use_denoising=maybe"), 'cannot be "maybe": it is true or false'),
        (("--engine-option", "seed=1.5"), 'cannot be "1.5": it is a whole number'),
        (("--engine-option", "blur_glossy=nan"), 'cannot be "nan": it is a number'),
        (("--engine-option", "blur_glossy=-1"), "give at least 0"),
        (("--engine-option", "device=TPU"), "choose one of CPU, GPU"),
        (("--table-budget", "-1"), "A table budget of -1 MiB cannot be used: give at least 0"),
    ],
)
def test_what_cannot_be_rendered_is_refused(capfd, blend, words, sentence):
    assert sentence in refused(capfd, "render", blend, *words)
    assert names_in(blend.parent) == ["flakes.png", "glints.blend"]  # no table was baked for it


@pytest.mark.parametrize("words", [("--samples", 4), ("--engine-option", "seed=1")])
def test_settings_of_cycles_are_refused_for_another_engine(capfd, quick, words):
    change(quick, lambda scene: setattr(scene.render, "engine", "BLENDER_EEVEE"))
    assert "is rendered by BLENDER_EEVEE, which takes no samples" in refused(capfd, "render", quick, *words)


def test_settings_of_cycles_are_refused_where_it_is_switched_off(blend):
    """In a process of its own: nothing of Cycles comes back as it was."""
    code = ("import bpy, addon_utils, sys, glint_addon; from glint_addon.cli import command; glint_addon.register(); "
            f"addon_utils.disable('cycles'); sys.exit(command.main(['render', {str(blend)!r}, '--samples', '4']))")
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "glint: Cycles is switched off: switch it on in Edit > Preferences > Add-ons" in done.stderr


def test_what_is_baked_may_be_said_and_is_kept_in_the_file(capfd, blend):
    def act(scene):
        bpy.data.objects["Mesh"].location.z = 100.0  # behind the camera

    change(blend, act)
    assert " 0 tables baked" in run(capfd, "prepare", blend)[1]
    assert " 0 tables baked" in run(capfd, "prepare", blend, "--bake-unseen", "--table-budget", 0)[1]
    assert " 0 tables baked" not in run(capfd, "prepare", blend, "--bake-unseen", "--table-budget", 64)[1]
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    state = bpy.context.scene.glint
    assert (state.bake_unseen, state.table_budget) == (True, 64)
    run(capfd, "prepare", blend, "--no-bake-unseen")
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    state = bpy.context.scene.glint
    assert (state.bake_unseen, state.table_budget) == (False, 64)


def test_prepare_can_save_to_a_copy_and_keeps_the_one_before(capfd, blend):
    content, copy = blend.read_bytes(), blend.with_name("glints_prepared.blend")
    code, output, errors = run(capfd, "prepare", blend, "--save-as", copy)
    assert code == 0, errors
    assert output.splitlines()[-1] == f"Saved {copy}"
    assert blend.read_bytes() == content
    first = copy.read_bytes()
    run(capfd, "prepare", blend, "--save-as", copy)
    assert copy.with_suffix(".blend1").read_bytes() == first
    bpy.ops.wm.open_mainfile(filepath=str(copy))
    assert bpy.context.scene.glint.prepared


@pytest.mark.parametrize("name", ["other/copy.blend", "copy.png"])
def test_a_copy_that_would_lose_its_tables_is_refused(capfd, blend, name):
    sentence = refused(capfd, "prepare", blend, "--save-as", blend.parent / name)
    assert "cannot hold the prepared copy" in sentence
    assert names_in(blend.parent) == ["flakes.png", "glints.blend"]


@pytest.mark.parametrize("command", ["prepare", "render"])
def test_a_scene_of_another_file_is_refused_as_in_the_panel(capfd, blend, command):
    change(blend, lambda scene: setattr(scene, "name", "Set"))
    library, shot = blend, blend.with_name("shot.blend")
    cycles.empty_scene()
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.scenes = ["Set"]
    bpy.ops.wm.save_as_mainfile(filepath=str(shot))
    content = shot.read_bytes()
    sentence = refused(capfd, command, shot, "--scene", "Set")
    assert 'Scene "Set" is linked from' in sentence and "glints.blend: prepare it there" in sentence
    assert shot.read_bytes() == content and not (shot.parent / "glint_tables").exists()


def test_of_two_scenes_of_a_name_the_files_own_is_meant(capfd, blend):
    cycles.empty_scene()
    with bpy.data.libraries.load(str(blend), link=True) as (_, wanted):
        wanted.scenes = ["Scene"]
    shot = blend.with_name("shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(shot))
    assert "no camera" in refused(capfd, "render", shot, "--scene", "Scene")


@pytest.mark.parametrize(
    "words",
    [
        [], ["polish"], ["prepare"], ["render", "a.blend", "--samples", "many"],
        ["render", "a.blend", "--frame", "1", "--animation"], ["prepare", "a.blend", "--table-budget", "much"],
    ],
)
def test_misuse_exits_with_2_and_says_how_it_is_used(capfd, registered, words):
    code, output, errors = run(capfd, *words)
    assert code == 2 and output == "" and "usage: blender --command glint" in errors


def test_help_exits_with_0(capfd, registered):
    code, output, _ = run(capfd, "--help")
    assert code == 0 and "prepare" in output and "render" in output and "info" in output


@pytest.mark.parametrize("words", [["--help"], ["prepare", "--help"], ["render", "--help"]])
def test_the_help_shows_the_recipe_for_a_farm_and_its_template(capfd, registered, words):
    output = run(capfd, *words)[1]
    assert "glint prepare FILE.blend" in output and "blender -b FILE.blend -a" in output
    assert Path(re.search(r"\S+\.openjd\.yaml", output)[0]).is_file()


@pytest.mark.parametrize("command", ["prepare", "render"])
def test_every_option_is_in_the_guide_to_farms(capfd, registered, command):
    options = set(re.findall(r"--[a-z-]+", run(capfd, command, "--help")[1])) - {"--help", "--command"}
    guide = (ROOT / "docs" / "farms.md").read_text(encoding="utf-8")
    assert options and not {option for option in options if f"`{option}" not in guide}


def test_the_version_is_the_manifests_beside_blenders(capfd, registered):
    code, output, _ = run(capfd, "--version")
    version = re.search(r'^version = "(.+)"', (ROOT / "blender_manifest.toml").read_text(encoding="utf-8"), re.M)[1]
    assert code == 0 and output == f"Glint {version} (Blender {bpy.app.version_string})\n"


def test_python_m_does_the_same_in_a_process_of_its_own(blend):
    command = [sys.executable, "-m", "glint_addon"]
    done = subprocess.run([*command, "prepare", blend], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == f"Saved {blend}"
    failed = subprocess.run([*command, "info", "gone.blend"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (failed.returncode, failed.stdout) == (1, "")
    assert failed.stderr.splitlines()[-1] == "glint: gone.blend is not there: check the path and try again."
