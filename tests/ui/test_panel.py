"""The panel: what it says for each state of the file, and that drawing reads no file and changes no data."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import bpy
import pytest

from glint_addon.nodes import GROUPS
from glint_addon.nodes.map_choices import IMAGE_NODE
from glint_addon.nodes.scale import scale_nodes
from glint_addon.operators.scene_state import store_report
from glint_addon.prepare import watch
from glint_addon.prepare.report import Report
from glint_addon.prepare.shading_system import LEFT_OFF, NO_OSL, ON_GPU
from glint_addon.ui import menus, text
from glint_addon.ui.lights_panel import GLINT_PT_lights
from glint_addon.ui.panel import FRAMES, GLINT_PT_material, GLINT_PT_tables
from tests.helpers import cycles, map_sets
from tests.helpers.extension import data_names, write_flake_map
from tests.helpers.no_osl import take_osl_away
from tests.helpers.panel import SCREEN, Layout, words_of

pytestmark = pytest.mark.usefixtures("registered")

REPORT = Report(
    hints=["Sun"],
    skipped_lights=[["Lamp", "it is too large for glints"]],
    hints_by_material={"Glint flakes": ["Sun"]},
    left_by_material={"Glint flakes": []},
    baked=["/somewhere/glint_tables/new.exr"],
    reused=["/somewhere/glint_tables/old.exr"],
    unseen=["Hidden away"],
    osl=True,
    device="CPU",
    warnings=["Simplify limits the texture size."],
    notes=[],
)

_opened = []
_listening = []
# Python cannot take an audit hook away again, so it stays for the run and listens only while asked to.
sys.addaudithook(lambda event, args: _opened.append((event, args)) if _listening and is_disk(event) else None)


def is_disk(event: str) -> bool:
    """Whether an audit event is about files."""
    return event == "open" or event.startswith(("os.", "shutil.", "tempfile."))


def drawn(panel, *, width=400) -> list[str]:
    """What `panel` shows in a region `width` pixels wide; drawing must touch neither disk nor data."""
    words_of(panel, width=width)  # imports what it needs
    before = data_names()
    _opened.clear()
    _listening.append(True)
    try:
        seen = words_of(panel, width=width)
    finally:
        _listening.clear()
    assert not _opened and data_names() == before
    return seen


@pytest.fixture
def plane(scene):
    """The active object, without a material."""
    thing = cycles.add_plane(bpy.context.scene)
    bpy.context.view_layer.objects.active = thing
    return thing


@pytest.fixture
def glinting(plane, tmp_path):
    """The active object with a Glint material."""
    bpy.ops.glint.add_material(filepath=str(write_flake_map(tmp_path / "flakes.png")), interpolation="CLOSEST")
    return plane


def test_without_a_glint_material_the_panel_asks_for_a_map(plane):
    assert drawn(GLINT_PT_material) == [
        "[Add Preset: preset]", "Normal Map:", "<normal_map>", "[glint.add_material]", "[glint.prepare]"]


def test_before_preparing_the_panel_says_so(glinting):
    seen = drawn(GLINT_PT_material)
    assert seen[:3] == ["flakes.png", "Beckmann, Closest, OpenGL", "Not prepared yet"]
    assert "[glint.change_map]" in seen and "[glint.add_material]" not in seen
    assert any(line.startswith("This scene is not prepared") for line in seen)


def test_after_preparing_the_panel_names_the_table_and_the_way(glinting):
    bpy.ops.glint.prepare()
    seen = drawn(GLINT_PT_material)
    assert seen[2].endswith(".exr") and "Glints: plain" in seen
    cycles.add_sun(bpy.context.scene, (0, 0, 1))
    bpy.ops.glint.prepare()
    assert "Glints: exact (OSL)" in drawn(GLINT_PT_material)
    bpy.context.scene.cycles.shading_system = False
    assert "Glints: by nodes (no OSL)" in drawn(GLINT_PT_material)
    assert "Not prepared yet" not in seen


def test_the_panel_says_why_osl_is_off(glinting):
    bpy.context.scene.cycles.shading_system = False
    bpy.ops.glint.prepare()
    seen = drawn(GLINT_PT_material, width=4000)
    assert "Glints: plain" in seen and LEFT_OFF in seen


def add_lights(*names):
    """Lights of these names: what is no longer there is not shown."""
    for name in names:
        thing = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
        bpy.context.scene.collection.objects.link(thing)


def test_the_panel_shows_every_part_of_the_report(glinting):
    add_lights("Sun", "Lamp")
    bpy.data.materials.new("Hidden away")
    store_report(bpy.context.scene, REPORT)
    assert "Simplify limits the texture size." in drawn(GLINT_PT_material)
    lights = drawn(GLINT_PT_lights)
    assert "Sun" in lights and "Lamp: it is too large for glints" in lights
    tables = drawn(GLINT_PT_tables)
    assert "new.exr (baked)" in tables and "old.exr (reused)" in tables
    assert "[Also Bake Unseen]" in tables
    assert "Hidden away: no camera saw it when prepared, so it has no table" in " ".join(tables)


def test_the_panel_shows_the_lights_of_the_shown_material_and_which_are_left_to_chance_there(glinting):
    shown = glinting.active_material.name
    add_lights("Moon", "Sun", *(f"Lamp {number}" for number in range(6)))
    far = [[f"Lamp {number}", "too dim"] for number in range(6)]
    store_report(bpy.context.scene, replace(
        REPORT, hints=["Moon", "Sun"],
        hints_by_material={shown: ["Moon"], "Other": ["Sun"]},
        left_by_material={shown: [["Sun", "out of reach"], *far], "Other": []},
    ))
    lights = drawn(GLINT_PT_lights, width=900)
    assert lights[:2] == ["Moon", "Left to chance on this material:"]
    assert "Sun: out of reach" in lights and "Sun" not in lights
    assert "Lamp 0, Lamp 1, Lamp 2, Lamp 3 and 2 more: too dim" in lights


def test_a_report_of_many_lights_and_materials_is_kept_whole(glinting):
    lights = [f"Lamp {number}" for number in range(1000)]  # so many that Blender moves the lines as they grow
    materials = [f"Material {number}" for number in range(10)]
    store_report(bpy.context.scene, replace(REPORT, hints_by_material=dict.fromkeys(materials, lights),
                                            left_by_material=dict.fromkeys(materials, [["Moon", "too dim"]])))
    stored = [(line.material, line.name, line.detail) for line in bpy.context.scene.glint.material_lights]
    assert stored == [(material, *pair) for material in materials
                      for pair in [*((name, "") for name in lights), ("Moon", "too dim")]]


def test_a_new_report_replaces_the_old_one(glinting):
    store_report(bpy.context.scene, REPORT)
    store_report(bpy.context.scene, replace(REPORT, hints=[], warnings=[], baked=[], reused=[], unseen=[]))
    assert not bpy.context.scene.glint.warnings
    assert "No light makes glints" in drawn(GLINT_PT_lights)[0]
    assert drawn(GLINT_PT_tables) == ["No table is in use", "[Also Bake Unseen]", "[Table Budget (MiB)]"]


def test_the_report_panels_wait_for_the_first_preparation(glinting):
    for panel in (GLINT_PT_lights, GLINT_PT_tables):
        assert not panel.poll(bpy.context)
    store_report(bpy.context.scene, REPORT)
    for panel in (GLINT_PT_lights, GLINT_PT_tables):
        assert panel.poll(bpy.context)


def test_the_panel_advises_against_denoising_by_normals_until_glints_are_kept(glinting):
    store_report(bpy.context.scene, REPORT)
    settings = bpy.context.scene.cycles
    assert not settings.use_denoising and "[glint.keep_glints]" not in drawn(GLINT_PT_material)
    settings.use_denoising = True
    settings.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    seen = drawn(GLINT_PT_material)
    assert "Denoising by normals softens glints" in " ".join(seen) and seen[-1] == "[glint.keep_glints]"
    bpy.ops.glint.keep_glints()
    assert "[glint.keep_glints]" not in drawn(GLINT_PT_material)


def test_a_view_layer_that_is_not_denoised_needs_no_advice(glinting):
    store_report(bpy.context.scene, REPORT)
    bpy.context.scene.cycles.use_denoising = True
    bpy.context.view_layer.cycles.use_denoising = False
    assert "[glint.keep_glints]" not in drawn(GLINT_PT_material)


def test_another_render_engine_is_named_as_the_reason(glinting):
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    assert any("Glints need Cycles" in line for line in drawn(GLINT_PT_material))


def test_a_glint_node_without_a_map_asks_for_one(glinting):
    bpy.data.images.remove(bpy.data.images["flakes.png"])
    assert "No normal map: pick one below" in drawn(GLINT_PT_material)[0]


def test_the_report_is_saved_with_the_file(glinting, tmp_path):
    store_report(bpy.context.scene, REPORT)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert [line.name for line in bpy.context.scene.glint.hints] == ["Sun"]


def test_long_sentences_are_wrapped_to_the_width_of_the_panel(glinting):
    sentence = "The GPU backend has no Open Shading Language: choose CPU or OptiX to render glints."
    store_report(bpy.context.scene, replace(REPORT, warnings=[sentence]))
    for width in (250, 400, 900):
        seen = drawn(GLINT_PT_material, width=width)
        lines = seen[seen.index("Glints: exact (OSL)") + 1 :]
        assert " ".join(lines) == sentence
        limit = text.line_length(SimpleNamespace(region=SimpleNamespace(width=width), preferences=SCREEN))
        assert max(map(len, lines)) <= limit
    assert len(lines) == 1


def test_every_group_is_in_exactly_one_add_menu(scene):
    layout = Layout()
    for draw in (menus.draw_inputs, menus.draw_shaders, menus.draw_textures, menus.draw_vectors):
        draw(SimpleNamespace(layout=layout), bpy.context)
    assert sorted(layout.seen) == sorted(f"[{name}]" for name in GROUPS)


def test_bsdfs_are_in_the_shader_menu_and_textures_in_the_texture_menu(scene):
    shaders, textures = Layout(), Layout()
    menus.draw_shaders(SimpleNamespace(layout=shaders), bpy.context)
    menus.draw_textures(SimpleNamespace(layout=textures), bpy.context)
    assert "[Glint BSDF]" in shaders.seen and "[Glint Image Texture]" in textures.seen


# --- what is shown after the file changed ---


@pytest.fixture
def prepared(glinting, tmp_path):
    """A saved and prepared file: a plane with glints, a sun and a lamp."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "prepared.blend"))
    scene = bpy.context.scene
    cycles.add_sun(scene, (0, 0, 1), angle=0.01)
    add_lights("Lamp")
    bpy.data.objects["Lamp"].location = (0, 0, 2)
    cycles.add_camera(scene, (0, 0, 3))
    bpy.ops.glint.prepare()
    assert drawn(GLINT_PT_lights)[:2] == ["Lamp", "Sun"]
    return scene


def tables_on_disk(folder):
    return sorted((folder / "glint_tables").iterdir())


def words_now(panel, *, width=4000) -> str:
    """What a panel shows once Blender has looked at the scene again."""
    watch.look_at(bpy.context.scene)
    return "\n".join(drawn(panel, width=width))


def test_what_is_prepared_is_shown_without_a_complaint(prepared):
    seen = words_now(GLINT_PT_material)
    assert "Glints: exact (OSL)" in seen and "gone" not in seen and "now" not in seen


def test_tables_that_are_gone_are_said_to_be_gone(prepared, tmp_path):
    names = [table.name for table in tables_on_disk(tmp_path)]
    for table in tables_on_disk(tmp_path):
        table.unlink()
    seen = words_now(GLINT_PT_material)
    assert "A table is gone" in seen and 'Tables of the map "flakes.png" are gone from' in seen
    assert not any(name in seen for name in names)
    for name in names:
        assert f"{name} (gone)" in words_now(GLINT_PT_tables)


def test_damaged_tables_are_said_to_be_damaged(prepared, tmp_path):
    for table in tables_on_disk(tmp_path):
        table.write_bytes(table.read_bytes()[:100])
    assert "A table is damaged" in words_now(GLINT_PT_material)
    for table in tables_on_disk(tmp_path):
        assert f"{table.name} (damaged)" in words_now(GLINT_PT_tables)


def test_one_lost_table_of_several_is_enough_to_be_told(prepared, tmp_path):
    group = next(node.node_tree for node in bpy.context.object.active_material.node_tree.nodes
                 if node.bl_idname == "ShaderNodeGroup")
    prepared.render.resolution_x = prepared.render.resolution_y = 8  # texels become so small that it takes two tables
    bpy.ops.glint.prepare()
    others = [table for table in tables_on_disk(tmp_path) if table.name != bpy.path.basename(group["glint_table"])]
    others[0].unlink()
    assert "A table is gone" in words_now(GLINT_PT_material)
    assert words_now(GLINT_PT_tables).count("(gone)") == 1


def test_tables_are_shown_where_the_file_took_them(prepared, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "elsewhere" / "moved.blend"))
    for table in tables_on_disk(tmp_path):
        table.unlink()
    seen = words_now(GLINT_PT_tables)
    assert f"In {tmp_path / 'elsewhere' / 'glint_tables'}" in seen
    assert "gone" not in seen and "gone" not in words_now(GLINT_PT_material)


def test_deleted_lamps_are_not_listed(prepared):
    for name in ("Lamp", "Sun"):
        bpy.data.objects.remove(bpy.data.objects[name])
        seen = words_now(GLINT_PT_lights)
        assert name not in seen.splitlines()
        assert f'Light "{name}" is gone.' in words_now(GLINT_PT_material)
    assert seen == "Which lights make glints is known after Prepare Glints."
    bpy.ops.glint.prepare()
    assert words_now(GLINT_PT_lights) == "No light makes glints: add a sun or a small light."


def test_a_world_that_begins_like_a_deleted_lamp_does_not_keep_it_in_the_list(prepared):
    bpy.context.scene.world = bpy.data.worlds.new("La")
    bpy.data.objects.remove(bpy.data.objects["Lamp"])
    assert "Lamp" not in words_now(GLINT_PT_lights).splitlines()


def test_a_material_that_was_not_prepared_shows_no_lights_of_others(prepared, tmp_path):
    add = bpy.ops.glint.add_material
    add(filepath=str(write_flake_map(tmp_path / "other.png")), name="Other")
    assert bpy.context.object.active_material.name == "Other"
    assert words_now(GLINT_PT_lights) == "Which lights make glints is known after Prepare Glints."
    assert 'Material "Other" shows glints now.' in words_now(GLINT_PT_material)


def test_warnings_of_the_last_preparation_go_when_what_they_say_may_be_wrong(prepared):
    prepared.render.use_simplify, prepared.cycles.texture_limit_render = True, "128"
    bpy.ops.glint.prepare()
    assert "Simplify limits texture sizes" in words_now(GLINT_PT_material)
    prepared.render.use_simplify = False
    seen = words_now(GLINT_PT_material)
    assert "Simplify limits texture sizes" not in seen
    assert "The texture limit of Simplify: no limit now" in seen


def test_a_gpu_is_warned_about_before_preparing_again(prepared):
    prepared.cycles.device = "GPU"
    seen = words_now(GLINT_PT_material)
    assert "Glints: by nodes (GPU)" in seen and ON_GPU in seen and "Device: GPU now, CPU before." in seen
    bpy.ops.glint.prepare()
    assert words_now(GLINT_PT_material).count(ON_GPU) == 1
    prepared.cycles.device = "CPU"
    assert ON_GPU not in words_now(GLINT_PT_material)


def test_another_engine_is_shown_as_a_change_too(prepared):
    prepared.render.engine = "BLENDER_EEVEE"
    seen = words_now(GLINT_PT_material)
    assert "Render Engine: BLENDER_EEVEE now, CYCLES before." in seen and "Glints: by nodes (EEVEE)" in seen
    prepared.render.engine = "BLENDER_WORKBENCH"
    seen = words_now(GLINT_PT_material)
    assert "Glints need Cycles or EEVEE" in seen and "Glints:" not in seen


def test_a_full_copy_of_the_scene_says_whose_lights_it_looks_for(prepared):
    bpy.ops.scene.new(type="FULL_COPY")
    copy = bpy.context.scene
    assert copy != prepared
    seen = words_now(GLINT_PT_material)
    assert 'Glints look for "Sun" of scene "Scene".' in seen
    assert words_now(GLINT_PT_lights) == "Which lights make glints is known after Prepare Glints."
    bpy.ops.glint.prepare()
    assert "now" not in words_now(GLINT_PT_material)
    assert words_now(GLINT_PT_lights).splitlines()[:2] == ["Lamp.001", "Sun.001"]


def test_another_map_is_named_at_once(prepared, tmp_path):
    group = next(node.node_tree for node in bpy.context.object.active_material.node_tree.nodes
                 if node.bl_idname == "ShaderNodeGroup")
    other = bpy.data.images.load(str(write_flake_map(tmp_path / "other.png", 16)))
    other.colorspace_settings.is_data = True
    group.nodes[IMAGE_NODE].image = other
    seen = words_now(GLINT_PT_material)
    assert seen.startswith("other.png") and 'reads the map "other.png" now, not "flakes.png".' in seen


def test_a_map_that_was_written_anew_is_told_and_one_that_was_moved_with_its_project_is_not(prepared, tmp_path):
    image = next(image for image in bpy.data.images if image.name == "flakes.png")
    (tmp_path / "moved").mkdir()
    (tmp_path / "flakes.png").rename(tmp_path / "moved" / "flakes.png")
    assert 'The file of the map "flakes.png" is gone.' in words_now(GLINT_PT_material)
    image.filepath = str(tmp_path / "moved" / "flakes.png")
    assert "flakes.png" not in words_now(GLINT_PT_material).replace("flakes.png", "", 1)
    write_flake_map(tmp_path / "moved" / "flakes.png", 16)
    assert 'The pixels of the map "flakes.png" changed.' in words_now(GLINT_PT_material)


def test_a_map_that_can_no_longer_be_read_is_told_with_the_reason(prepared):
    group = next(node.node_tree for node in bpy.context.object.active_material.node_tree.nodes
                 if node.bl_idname == "ShaderNodeGroup")
    group.nodes[IMAGE_NODE].interpolation = "Cubic"
    reason = 'Interpolation "CUBIC" is unknown: use one of LINEAR, CLOSEST.'
    seen = words_now(GLINT_PT_material)
    assert reason in seen and "now" not in seen.replace("unknown", "")
    with pytest.raises(RuntimeError, match="is unknown: use one of"):
        bpy.ops.glint.prepare()
    group.nodes[IMAGE_NODE].interpolation = "Linear"
    assert "Interpolation of the map of" in words_now(GLINT_PT_material)


def test_a_blender_without_osl_speaks_of_no_tables(prepared, monkeypatch):
    take_osl_away(monkeypatch)
    seen = words_now(GLINT_PT_material)
    assert NO_OSL in seen and "Glints: by nodes (no OSL)" in seen and ".exr" not in seen and "Not prepared" not in seen
    tables = words_now(GLINT_PT_tables)
    assert "This Blender has no Open Shading Language, which alone reads tables." in tables
    assert "No table" not in tables
    prepared.cycles.use_denoising, prepared.cycles.denoising_input_passes = True, "RGB_ALBEDO_NORMAL"
    bpy.ops.glint.prepare()
    seen = words_now(GLINT_PT_material)
    assert seen.count("no Open Shading Language") == 1 and "[glint.keep_glints]" in seen


def test_the_scale_of_a_material_that_has_one_can_be_set(glinting):
    assert "[Scale]" not in drawn(GLINT_PT_material)
    bpy.ops.glint.add_material(image="flakes.png", scale=0.5)
    assert drawn(GLINT_PT_material).count("[Scale]") == 1
    tree = bpy.context.object.active_material.node_tree
    (node,) = scale_nodes(bpy.context.object.active_material)
    tree.links.new(tree.nodes.new("ShaderNodeValue").outputs[0], node.inputs["Scale"])
    assert "[Scale]" not in drawn(GLINT_PT_material)


def test_places_can_be_set_where_glints_are_rendered_by_nodes(prepared):
    assert "[Places]" not in drawn(GLINT_PT_material)
    prepared.cycles.device = "GPU"
    assert "[Places]" in drawn(GLINT_PT_material)


def test_what_was_prepared_for_a_gpu_is_not_called_exact(prepared):
    prepared.cycles.device = "GPU"
    bpy.ops.glint.prepare()
    prepared.cycles.device, prepared.cycles.shading_system = "CPU", True
    assert "Glints: by nodes" in drawn(GLINT_PT_material)
    bpy.ops.glint.prepare()
    assert "Glints: exact (OSL)" in drawn(GLINT_PT_material)


def test_a_udim_set_and_a_sequence_are_named_with_their_frames(registered, tmp_path):
    for open_map, words in ((map_sets.udim_set, "UDIM set"), (map_sets.sequence, "Image sequence")):
        scene = cycles.empty_scene()
        thing = cycles.add_plane(scene)
        cycles.add_sun(scene, (0, 0, 1))
        cycles.add_camera(scene, (0, 0, 4), width=2.0)
        bpy.context.view_layer.objects.active = thing
        image = open_map(tmp_path)
        bpy.ops.glint.add_material(image=image.name, name="Glint flakes")
        bpy.ops.glint.prepare()
        seen = drawn(GLINT_PT_material)
        assert f"{words}: glints by nodes" in seen and "[Places]" in seen
        frames = {bpy.types.ImageUser.bl_rna.properties[name].name for name in FRAMES}
        assert frames.issubset({line.strip("[]") for line in seen}) == (words == "Image sequence")


def test_a_blender_without_osl_gains_by_preparing_too(glinting, monkeypatch):
    take_osl_away(monkeypatch)
    assert "This scene is not prepared" in words_now(GLINT_PT_material)
    bpy.ops.glint.prepare()
    assert "not prepared" not in words_now(GLINT_PT_material)


def test_files_of_older_versions_are_said_to_be_prepared_by_another(prepared):
    del prepared["glint_prepared"]
    assert "This scene was prepared by another version of Glint." in words_now(GLINT_PT_material)
    assert "not prepared" not in words_now(GLINT_PT_material)


def test_a_damaged_note_of_the_preparation_is_told(prepared):
    prepared["glint_prepared"] = prepared["glint_prepared"].replace("Sun", "Moon")
    assert "What Glint noted of this scene's preparation is damaged." in words_now(GLINT_PT_material)
    bpy.ops.glint.prepare()
    assert "damaged" not in words_now(GLINT_PT_material)
