"""Take the pictures of the panel, of the node and of EEVEE that the documents show, in the Blender application.

    .venv/bin/python tools/screenshots.py FOLDER        # makes and prepares the scenes with the bpy module
    blender --factory-startup --window-geometry 0 0 1300 1000 --python tools/screenshots.py -- FOLDER

The second command opens FOLDER/scene.blend, arranges the window, writes FOLDER/panel.png and FOLDER/node.png, renders
FOLDER/plain.blend and FOLDER/glint.blend in EEVEE, writes both to FOLDER/eevee.png, and quits.
`--grab "import -window root"` after `--` names a command that writes a picture of the whole screen to the file
at its end: under software OpenGL Blender's own screenshots are black.

In a Blender that was built without Open Shading Language the panel would speak of that alone. The scene is prepared by
the bpy module, which has it, and here the extension is told that this Blender has it too: the panel then draws what
users of the official Blender see. Nothing is prepared or rendered in that state.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
import traceback
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
SCENE, MAP = "scene.blend", "flakes.png"
EEVEE_SCENES = {"plain.blend": "Blender's plain nodes", "glint.blend": "Glint, by nodes"}
EEVEE_SIZE, EEVEE_SPP, EEVEE_SCALE = (96, 96), 64, 3
PAUSE = 2.0  # seconds for Blender to draw; software OpenGL takes that long
PANEL_WIDTH = 0.46  # of the 3D viewport
MARGIN = 14  # pixels left around what a picture shows
# All else in the Material tab, which a user would scroll past.
SHOWN_PANELS = {"CYCLES_PT_context_material", "EEVEE_MATERIAL_PT_context_material", "CYCLES_MATERIAL_PT_surface"}


def main() -> int:
    """Make the scene without a window, take the pictures with one."""
    words = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]
    parser = argparse.ArgumentParser(prog="screenshots", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the scene and the pictures go")
    parser.add_argument("--grab", default="", help="command that writes a picture of the screen to the file at its end")
    arguments = parser.parse_args(words)
    sys.path.insert(0, str(ROOT))
    if bpy.app.background:
        make_scene(arguments.folder.resolve())
        make_eevee_scenes(arguments.folder.resolve())
    else:
        bpy.app.timers.register(Steps(pictures(arguments.folder.resolve(), arguments.grab)), persistent=True)
    return 0


# --- the scene ---


def make_scene(folder: Path):
    """Save a prepared scene in `folder`: a ball of car paint under a sun, a small lamp and a softbox."""
    import glint_addon
    from demo_scenes import maps, stage

    folder.mkdir(parents=True, exist_ok=True)
    scene = stage.empty_scene((200, 200), 64)
    glint_addon.register()
    ball = stage.add_sphere(scene, None, repeats=(10, 5))
    ball.name = "Ball"
    stage.add_camera(scene, (0, -6, 1), (0, 0, 0.6), angle=0.3)
    stage.add_sun(scene, (0.5, -1, 0.6), strength=3.0)
    stage.add_lamp(scene, "POINT", (-2, -3, 3), power=200, shadow_soft_size=0.02).name = "Lamp"
    stage.add_lamp(scene, "AREA", (2, -1, 2), (0, 0, 0.6), power=100, size=4).name = "Softbox"
    scene.cycles.use_denoising = True  # Blender's default
    image = maps.blender_image("flakes", maps.flakes(256, std=0.3))
    image.save(filepath=str(folder / MAP))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / SCENE))
    select(ball)
    bpy.ops.glint.add_material(
        filepath=str(folder / MAP), name="Car paint", interpolation="CLOSEST", roughness=0.12, color=(0.8, 0.1, 0.05))
    bpy.ops.file.make_paths_relative()
    bpy.ops.glint.prepare()
    bpy.ops.wm.save_mainfile()


def make_eevee_scenes(folder: Path):
    """Save the demo's far view of flakes in `folder`, for EEVEE, with plain nodes and with Glint."""
    import glint_addon
    from demo_scenes import flakes_far
    from demo_scenes.comparison import scene_of
    from demo_scenes.truth import truth_material

    for name, make in zip(EEVEE_SCENES, (truth_material, glint_addon.create_glint_material), strict=True):
        scene = scene_of(flakes_far, make, EEVEE_SPP, EEVEE_SIZE)
        scene.render.engine, scene.eevee.taa_render_samples = "BLENDER_EEVEE", EEVEE_SPP
        bpy.data.images["Normal map"].pack()
        glint_addon.prepare_scene(scene)
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / name))


def select(thing):
    """Make an object the active one."""
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)


# --- the window ---


class Steps:
    """Goes on with a generator at each tick of a timer, and quits Blender at its end; yields are seconds to wait."""

    def __init__(self, steps):
        self.steps = steps

    def __call__(self):
        try:
            return next(self.steps)
        except StopIteration:
            pass
        except Exception:  # a window that stays open would wait for ever; the traceback is all there is to say
            traceback.print_exc()
        bpy.ops.wm.quit_blender()
        return None


def pictures(folder: Path, grab: str):
    """Open the scenes and take all pictures: a generator for `Steps`."""
    preferences = bpy.context.preferences
    preferences.view.show_splash = False
    preferences.view.use_save_prompt = False
    register_for_pictures()
    hidden = [panel for panel in bpy.types.Panel.__subclasses__() if is_scrolled_past(panel)]
    for panel in hidden:
        bpy.utils.unregister_class(panel)
    yield PAUSE
    bpy.ops.wm.open_mainfile(filepath=str(folder / SCENE), load_ui=False)
    yield PAUSE
    select(bpy.data.objects["Ball"])
    window().cursor_warp(0, 0)  # a pointer over a socket would show what that holds
    yield from node_picture(folder / "node.png", grab)
    yield from panel_picture(folder / "panel.png", grab)
    yield from eevee_picture(folder)
    # Blender takes them away itself when it quits; a panel within another comes after that.
    for panel in sorted(hidden, key=lambda panel: hasattr(panel, "bl_parent_id")):
        bpy.utils.register_class(panel)


def node_picture(file: Path, grab: str):
    """The material's nodes in the Shader Editor."""
    editor = area_of("VIEW_3D")
    editor.ui_type = "ShaderNodeTree"
    yield PAUSE
    space, region = editor.spaces.active, region_of(editor)
    space.show_region_toolbar = space.show_region_ui = space.overlay.show_context_path = False
    yield PAUSE
    with bpy.context.temp_override(window=window(), area=editor, region=region):
        bpy.ops.node.select_all(action="DESELECT")
        bpy.ops.node.view_all()
    yield PAUSE
    pixels = shown_in(region, file, grab)
    left, bottom, right, top = box_of(space.edit_tree.nodes, region)
    save(pixels[max(bottom - MARGIN, 0):top + MARGIN, max(left - MARGIN, 0):right + MARGIN], file)


def panel_picture(file: Path, grab: str):
    """The Material tab, in an editor of its own."""
    editor = split_off(area_of("NODE_EDITOR"), PANEL_WIDTH)
    editor.ui_type = "PROPERTIES"
    yield PAUSE
    editor.spaces.active.context = "MATERIAL"
    yield 4 * PAUSE  # the extension looks at the files, Blender renders the icon of the material
    save(trimmed(shown_in(region_of(editor), file, grab)), file)


def eevee_picture(folder: Path):
    """What EEVEE renders with plain nodes and with Glint, side by side."""
    from demo_scenes import measure, picture

    panels = []
    for name, label in EEVEE_SCENES.items():
        bpy.ops.wm.open_mainfile(filepath=str(folder / name), load_ui=False)
        yield PAUSE
        pixels = measure.rendered(bpy.context.scene)
        light = measure.luminance(pixels)
        panels.append((f"{label}\nmean {light.mean():.3f}, deviation {light.std() / light.mean():.1f} of it", pixels))
    title = f"EEVEE, {EEVEE_SPP} samples, about 1400 flakes in a pixel"
    picture.save_side_by_side(folder / "eevee.png", panels, title=title, scale=EEVEE_SCALE)


def register_for_pictures():
    """Register the extension with its list of lights open, as if this Blender had Open Shading Language."""
    import glint_addon
    from glint_addon.nodes import script_node
    from glint_addon.ui.lights_panel import GLINT_PT_lights

    GLINT_PT_lights.bl_options = set()
    glint_addon.register()
    if not bpy.app.build_options.cycles_osl:
        script_node.bpy = BlenderWithOsl()


class BlenderWithOsl:
    """Blender's module as one that was built with Open Shading Language has it: the same in all else."""

    app = SimpleNamespace(build_options=SimpleNamespace(cycles_osl=True))

    def __getattr__(self, name):
        return getattr(bpy, name)


def is_scrolled_past(panel) -> bool:
    """Whether a panel of the Material tab is not in the picture."""
    is_shown = panel.__name__ in SHOWN_PANELS or panel.__name__.startswith("GLINT_PT")
    return getattr(panel, "bl_context", "") == "material" and panel.is_registered and not is_shown


def window():
    """Blender's window; a timer has none in its context."""
    return bpy.context.window_manager.windows[0]


def area_of(kind: str):
    """The largest area of that type."""
    return max((area for area in window().screen.areas if area.type == kind), key=lambda area: area.width * area.height)


def region_of(area):
    """The main region of an area."""
    return next(region for region in area.regions if region.type == "WINDOW")


def split_off(area, part: float):
    """A new area that takes `part` of the width of `area`, at its right."""
    before = set(window().screen.areas)
    with bpy.context.temp_override(window=window(), area=area, region=region_of(area)):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=1.0 - part)
    return max({*before, *window().screen.areas} - (before - {area}), key=lambda each: each.x)


# --- the pictures ---


def shown_in(region, file: Path, grab: str) -> np.ndarray:
    """Pixels (height, width, 4) of what a region shows, from the bottom, by way of a file beside `file`."""
    whole = file.with_name("screen.png")
    if grab:
        subprocess.run([*shlex.split(grab), str(whole)], check=True)
    else:
        with bpy.context.temp_override(window=window()):
            bpy.ops.screen.screenshot(filepath=str(whole))
    screen = bpy.data.images.load(str(whole), check_existing=False)
    pixels = np.array(screen.pixels[:], np.float32).reshape(screen.size[1], screen.size[0], 4)
    bpy.data.images.remove(screen)
    whole.unlink()
    return pixels[region.y:region.y + region.height - 1, region.x + 1:region.x + region.width - 1]


def box_of(nodes, region) -> tuple[int, int, int, int]:
    """Left, bottom, right and top of the nodes in a region's pixels."""
    scale = bpy.context.preferences.system.ui_scale
    corners = []
    for node in nodes:
        x, y = node.location_absolute * scale
        for corner in ((x, y), (x + node.dimensions.x, y - node.dimensions.y)):
            corners.append(region.view2d.view_to_region(*corner, clip=False))
    (left, bottom), (right, top) = np.min(corners, axis=0), np.max(corners, axis=0)
    return int(left), int(bottom), int(right), int(top)


def trimmed(pixels: np.ndarray, margin: int = MARGIN) -> np.ndarray:
    """Pixels (height, width, 4) without rows and columns of the colour of the first pixel, but for a margin.

    Raises ValueError if there is nothing else.
    """
    differs = np.abs(pixels[..., :3] - pixels[0, 0, :3]).max(axis=2) > 0.02
    rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
    if not len(rows):
        raise ValueError("The picture is empty: give a command that takes pictures of this screen with --grab.")
    return pixels[max(rows[0] - margin, 0):rows[-1] + 1 + margin, max(columns[0] - margin, 0):columns[-1] + 1 + margin]


def save(pixels: np.ndarray, file: Path):
    """Write a picture as PNG; its values are those of the screen."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(file.stem, width, height)
    image.pixels.foreach_set(np.ascontiguousarray(pixels).ravel())
    image.filepath_raw, image.file_format = str(file), "PNG"
    image.save()
    bpy.data.images.remove(image)


if __name__ == "__main__":
    sys.exit(main()) if bpy.app.background else main()
