"""The panel: what it says for each state of the file, and that drawing reads no file and changes no data."""

import sys
from types import SimpleNamespace

import bpy
import pytest

from glint_addon.nodes import GROUPS
from glint_addon.operators.scene_state import store_report
from glint_addon.shading_system import LEFT_OFF
from glint_addon.ui import menus, text
from glint_addon.ui.panel import GLINT_PT_lights, GLINT_PT_material, GLINT_PT_tables
from tests.helpers import cycles
from tests.helpers.extension import data_names, write_flake_map

pytestmark = pytest.mark.usefixtures("registered")

REPORT = {
    "hints": ["Sun"],
    "skipped_lights": [["Lamp", "it is too large for glints"]],
    "hints_by_material": {},
    "left_by_material": {},
    "baked": ["/somewhere/glint_tables/new.exr"],
    "reused": ["/somewhere/glint_tables/old.exr"],
    "unseen": ["Hidden away"],
    "osl": True,
    "device": "CPU",
    "warnings": ["Simplify limits the texture size."],
    "notes": [],
}
# Without a window Blender's own interface scale is 0.
SCREEN = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))

_opened = []
_listening = []
# Python cannot take an audit hook away again, so it stays for the run and listens only while asked to.
sys.addaudithook(lambda event, args: _opened.append((event, args)) if _listening and is_disk(event) else None)


def is_disk(event: str) -> bool:
    """Whether an audit event is about files."""
    return event == "open" or event.startswith(("os.", "shutil.", "tempfile."))


class Layout:
    """Stands in for Blender's layout: takes the same calls and keeps what would be seen."""

    def __init__(self, seen=None):
        self.seen = [] if seen is None else seen

    def column(self, **_settings):
        return Layout(self.seen)

    row = box = column

    def separator(self, **_settings):
        pass

    def label(self, *, text="", icon="NONE"):
        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items, icon
        self.seen.append(text)

    def prop(self, owner, name):
        self.seen.append(f"[{owner.bl_rna.properties[name].name}]")

    def operator(self, name, *, text="", icon="NONE"):
        self.seen.append(f"[{text or name}]")
        return SimpleNamespace()

    def template_ID(self, data, name, **_settings):  # noqa: N802  (Blender's name)
        assert hasattr(data, name)
        self.seen.append(f"<{name}>")


def drawn(panel, *, width=400) -> list[str]:
    """What `panel` shows in a region `width` pixels wide; drawing must touch neither disk nor data."""
    context = SimpleNamespace(
        scene=bpy.context.scene,
        object=bpy.context.object,
        material=bpy.context.object.active_material if bpy.context.object else None,
        region=SimpleNamespace(width=width),
        preferences=SCREEN,
    )
    layout = Layout()
    panel.draw(SimpleNamespace(layout=layout), context)  # imports what it needs
    layout.seen.clear()
    before = data_names()
    _opened.clear()
    _listening.append(True)
    try:
        panel.draw(SimpleNamespace(layout=layout), context)
    finally:
        _listening.clear()
    assert not _opened and data_names() == before
    return layout.seen


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
    assert drawn(GLINT_PT_material) == ["Normal Map:", "<normal_map>", "[glint.add_material]", "[glint.prepare]"]


def test_before_preparing_the_panel_says_so(glinting):
    seen = drawn(GLINT_PT_material)
    assert seen[:3] == ["flakes.png", "Beckmann, Closest, OpenGL", "Not prepared yet"]
    assert "[glint.change_map]" in seen and "[glint.add_material]" not in seen
    assert any(line.startswith("This scene is not prepared") for line in seen)


def test_after_preparing_the_panel_names_the_table_osl_and_device(glinting):
    bpy.ops.glint.prepare()
    seen = drawn(GLINT_PT_material)
    assert seen[2].endswith(".exr") and "OSL on, CPU" in seen
    assert "Not prepared yet" not in seen


def test_the_panel_says_why_osl_is_off(glinting):
    bpy.context.scene.cycles.shading_system = False
    bpy.ops.glint.prepare()
    seen = drawn(GLINT_PT_material, width=4000)
    assert "OSL off, CPU" in seen and LEFT_OFF in seen


def add_lights(*names):
    """Lights of these names: what is no longer there is not shown."""
    for name in names:
        thing = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
        bpy.context.scene.collection.objects.link(thing)


def test_the_panel_shows_every_part_of_the_report(glinting):
    add_lights("Sun", "Lamp")
    store_report(bpy.context.scene, REPORT)
    assert "Simplify limits the texture size." in drawn(GLINT_PT_material)
    lights = drawn(GLINT_PT_lights)
    assert "Sun" in lights and "Lamp: it is too large for glints" in lights
    tables = drawn(GLINT_PT_tables)
    assert "new.exr (baked)" in tables and "old.exr (reused)" in tables
    assert "[Also Bake Unseen]" in tables and "Hidden away: no camera sees it, so it has no table" in " ".join(tables)


def test_the_panel_shows_the_lights_of_the_shown_material_and_which_are_left_to_chance_there(glinting):
    shown = glinting.active_material.name
    add_lights("Moon", "Sun", *(f"Lamp {number}" for number in range(6)))
    far = [[f"Lamp {number}", "too dim"] for number in range(6)]
    store_report(bpy.context.scene, {
        **REPORT, "hints": ["Moon", "Sun"],
        "hints_by_material": {shown: ["Moon"], "Other": ["Sun"]},
        "left_by_material": {shown: [["Sun", "out of reach"], *far], "Other": []},
    })
    lights = drawn(GLINT_PT_lights, width=900)
    assert lights[:2] == ["Moon", "Left to chance on this material:"]
    assert "Sun: out of reach" in lights and "Sun" not in lights
    assert "Lamp 0, Lamp 1, Lamp 2, Lamp 3 and 2 more: too dim" in lights


def test_a_new_report_replaces_the_old_one(glinting):
    store_report(bpy.context.scene, REPORT)
    store_report(bpy.context.scene, {**REPORT, "hints": [], "warnings": [], "baked": [], "reused": [], "unseen": []})
    assert not bpy.context.scene.glint.warnings
    assert "No light makes glints" in drawn(GLINT_PT_lights)[0]
    assert drawn(GLINT_PT_tables) == ["No table is needed", "[Also Bake Unseen]", "[Table Budget (MiB)]"]


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
    bpy.context.scene.render.engine = "BLENDER_EEVEE"
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
    store_report(bpy.context.scene, {**REPORT, "warnings": [sentence]})
    for width in (250, 400, 900):
        seen = drawn(GLINT_PT_material, width=width)
        lines = seen[seen.index("OSL on, CPU") + 1 :]
        assert " ".join(lines) == sentence
        limit = text.line_length(SimpleNamespace(region=SimpleNamespace(width=width), preferences=SCREEN))
        assert max(map(len, lines)) <= limit
    assert len(lines) == 1


def test_every_group_is_in_exactly_one_add_menu(scene):
    layout = Layout()
    for draw in (menus.draw_inputs, menus.draw_shaders, menus.draw_textures):
        draw(SimpleNamespace(layout=layout), bpy.context)
    assert sorted(layout.seen) == sorted(f"[{name}]" for name in GROUPS)


def test_bsdfs_are_in_the_shader_menu_and_textures_in_the_texture_menu(scene):
    shaders, textures = Layout(), Layout()
    menus.draw_shaders(SimpleNamespace(layout=shaders), bpy.context)
    menus.draw_textures(SimpleNamespace(layout=textures), bpy.context)
    assert "[Glint BSDF]" in shaders.seen and "[Glint Image Texture]" in textures.seen
