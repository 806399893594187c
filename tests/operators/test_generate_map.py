"""Generating maps: what the operators make and refuse, and that a map follows its settings, in a window and without."""

from types import SimpleNamespace

import bpy
import pytest

import glint_addon
from glint_addon.generate import GENERATORS, PRESETS, settings_of
from glint_addon.images import image_pixels, is_preview, parts, recipe_of
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.glint_bsdf import group_binding
from glint_addon.operators import live_map
from glint_addon.operators.generate_map import STARTS, active_map
from glint_addon.operators.generated_settings import KIND_GROUPS, fill, kind_settings, recipe_from
from glint_addon.properties import GENERATED_COLOR, GENERATED_PRESENCE
from glint_addon.ui.generate_panel import GLINT_PT_generate
from tests.helpers import cycles
from tests.helpers.extension import refused
from tests.helpers.panel import words_of

pytestmark = pytest.mark.usefixtures("registered", "scene")


def generated(**settings) -> bpy.types.Image:
    """The map that the operator makes, small unless `settings` say otherwise."""
    assert bpy.ops.glint.generate_map(**{"kind": "BUMPS", "resolution": "64", **settings}) == {"FINISHED"}
    return bpy.context.scene.glint.normal_map


def presence(image) -> float:
    """The part of a map that flakes cover, as its image has it."""
    return float(image_pixels(parts(image)[GENERATED_PRESENCE])[..., 0].mean())


@pytest.mark.parametrize("kind", STARTS)
def test_each_kind_and_set_of_settings_becomes_a_picked_map_with_its_settings(kind):
    image = generated(kind=kind, seed=5)
    recipe = recipe_of(image)
    assert recipe.generator.seed == 5 and recipe.resolution == 64 and image.size[:] == (64, 64)
    assert recipe_from(image.glint) == recipe  # although Blender keeps seven digits
    assert image.name == [*(cls.label for cls in GENERATORS.values()), *PRESETS][list(STARTS).index(kind)]


def test_scripts_give_settings_as_json():
    image = generated(kind="FLAKES", name="Paint", settings='{"coverage": 0.25, "populations": [{"size": 0.0001}]}')
    assert image.name == "Paint" and image.glint.flakes.coverage == 0.25 and presence(image) < 0.4
    assert image.glint.flakes.populations[0].size == pytest.approx(0.0001)


@pytest.mark.parametrize(("settings", "words"), [
    ("{", "cannot be read"), ("3", 'write them as {"coverage": 0.5}'),
    ('{"slope": -1}', "Bumps cannot have the Slope -1"),
    ('{"size": 1}', 'Bumps has no setting "size"'), ('{"wavelength": 0.5}', "do not fit twice into one repeat"),
])
def test_settings_that_cannot_be_are_refused_in_a_sentence(settings, words):
    sentence = refused(bpy.ops.glint.generate_map, kind="BUMPS", resolution="64", settings=settings)
    assert words in sentence and sentence.endswith(".")


def test_facets_are_read_closest_unless_the_user_chooses():
    thing = cycles.add_plane(bpy.context.scene)
    bpy.context.view_layer.objects.active = thing
    for kind, chosen, read in (("FLAKES", {}, "CLOSEST"), ("BUMPS", {}, "LINEAR"),
                               ("FLAKES", {"interpolation": "LINEAR"}, "LINEAR")):
        image = generated(kind=kind)
        bpy.ops.glint.add_material(**chosen)
        (group,) = glint_groups(thing.active_material)
        assert group_binding(group).interpolation == read
        # The pick is spent, and the material's map is the active one.
        assert active_map(bpy.context) == image


def test_without_a_window_a_map_follows_its_settings_at_once():
    image = generated(kind="FLAKES", settings='{"extent": 0.002}')
    image.glint.flakes.coverage = 0.3
    assert 0.2 < presence(image) < 0.4 and image.glint.problem == ""
    image.glint.flakes.populations[0].roughness = 0.1
    assert image_pixels(image)[..., 0].std() < 0.02
    image.glint.coloring.mode = "RAMP"
    assert parts(image)[GENERATED_COLOR].size[:] == (64, 64) and len(image.glint.coloring.stops) == 2
    image.glint.resolution = "128"
    assert image.size[:] == (128, 128) and recipe_of(image) == recipe_from(image.glint)


def test_a_kind_chosen_for_the_first_time_begins_with_its_defaults():
    image = generated(kind="BUMPS")
    image.glint.kind = "FLAKES"
    assert recipe_of(image).generator == GENERATORS["FLAKES"]() and len(image.glint.flakes.populations) == 1
    image.glint.kind = "BUMPS"
    assert recipe_of(image).generator == GENERATORS["BUMPS"]()


def test_a_setting_that_cannot_be_leaves_the_map_and_says_why():
    image = generated(kind="BUMPS")
    before = image_pixels(image)
    image.glint.bumps.wavelength = 0.5
    assert "do not fit twice into one repeat" in image.glint.problem and (image_pixels(image) == before).all()
    image.glint.bumps.wavelength = 0.001
    assert image.glint.problem == "" and (image_pixels(image) != before).any()


def test_a_painted_map_does_not_follow_until_the_user_says_so():
    image = generated(kind="BUMPS")
    image.pixels[0] = 0.0
    image.update()
    image.glint.bumps.slope = 0.3
    assert "was edited after it was generated" in image.glint.problem and image_pixels(image)[0, 0, 0] == 0
    assert "choose Overwrite Edits" in refused(bpy.ops.glint.regenerate_map)
    assert bpy.ops.glint.regenerate_map(overwrite=True) == {"FINISHED"}
    assert image_pixels(image)[0, 0, 0] > 0 and recipe_of(image).generator.slope == pytest.approx(0.3)
    assert image.glint.problem == ""


def test_only_generated_maps_are_made_again():
    assert not bpy.ops.glint.regenerate_map.poll()
    image = generated()
    plain = bpy.data.images.new("Plain", 8, 8)
    plain.glint.kind = "DENTS"  # a setting of an image that was not generated does nothing
    assert plain.size[:] == (8, 8)
    assert 'Image "Plain" is no generated map' in refused(bpy.ops.glint.regenerate_map, image="Plain")
    assert bpy.ops.glint.regenerate_map(image=image.name) == {"FINISHED"}


def test_populations_are_added_like_the_last_and_removed():
    image = generated(kind="FLAKES")
    image.glint.flakes.populations[0].size = 0.0003
    bpy.ops.glint.change_parts(part="populations")
    image.glint.flakes.populations[1].roughness = 0.2
    populations = recipe_of(image).generator.populations
    assert [each.size for each in populations] == [0.0003, 0.0003] and populations[1].roughness == 0.2
    bpy.ops.glint.change_parts(part="populations", remove=0)
    assert recipe_of(image).generator.populations == populations[1:]
    assert "cannot be removed" in refused(bpy.ops.glint.change_parts, part="populations", remove=0)
    image.glint.kind = "DENTS"
    assert "Only flakes have populations" in refused(bpy.ops.glint.change_parts, part="populations")
    bpy.ops.glint.change_parts(part="stops")
    assert len(image.glint.coloring.stops) == 3


@pytest.mark.parametrize("kind", GENERATORS)
def test_properties_have_the_names_ranges_and_defaults_of_the_settings(kind):
    group = getattr(bpy.data.images.new("Any", 8, 8).glint, kind.lower())
    assert set(KIND_GROUPS) == set(GENERATORS)
    for name, described in settings_of(GENERATORS[kind]).items():
        found, default = group.bl_rna.properties[name], getattr(GENERATORS[kind](), name)
        assert found.name == described.label
        if isinstance(default, tuple):
            continue
        assert found.description == described.help and found.default == pytest.approx(default)
        if not described.choices:
            assert (found.hard_min, found.hard_max) == pytest.approx((described.low, described.high))


class Clock:
    """Stands in for `time`, so that a test decides how long a user waits."""

    def __init__(self):
        self.now = 100.0

    def monotonic(self):
        return self.now


@pytest.fixture
def window(monkeypatch):
    """Blender as if it had a window; returns the clock by which its timers go."""
    clock = Clock()
    app = SimpleNamespace(background=False, timers=bpy.app.timers, handlers=bpy.app.handlers,
                          is_job_running=lambda _kind: False)
    context = SimpleNamespace(window_manager=SimpleNamespace(windows=[]))
    monkeypatch.setattr(live_map, "bpy", SimpleNamespace(app=app, data=bpy.data, types=bpy.types, context=context))
    monkeypatch.setattr(live_map, "time", clock)
    monkeypatch.setattr(live_map, "PREVIEW", 64)
    return clock


def wait_for_thread():
    """Let the thread finish, and the timer see it."""
    live_map._making[2].result()
    return live_map.tick()


def test_a_small_map_is_shown_at_once_and_the_full_one_after_a_pause(window):
    image = generated(resolution="256")
    image.glint.bumps.slope = 0.2
    assert "This is a small map: the full one follows" in words_of(GLINT_PT_generate)
    assert image.size[:] == (64, 64) and is_preview(image) and bpy.app.timers.is_registered(live_map.tick)
    window.now += 0.75 * live_map.DELAY
    image.glint.bumps.slope = 0.3
    window.now += 0.75 * live_map.DELAY
    assert 0 < live_map.tick() < live_map.DELAY and image.size[:] == (64, 64)  # counted anew from the last change
    window.now += live_map.DELAY
    assert live_map.tick() == live_map.INTERVAL
    assert live_map.is_coming(image)
    assert wait_for_thread() is None and not live_map.is_coming(image)
    assert image.size[:] == (256, 256) and recipe_of(image).generator.slope == pytest.approx(0.3)


def test_a_change_while_the_full_map_is_made_begins_again(window):
    image = generated(resolution="256")
    image.glint.bumps.slope = 0.2
    window.now += 2 * live_map.DELAY
    live_map.tick()
    image.glint.bumps.slope = 0.3
    assert wait_for_thread() > 0 and is_preview(image)  # what was made is of the old settings
    window.now += 2 * live_map.DELAY
    live_map.tick()
    assert wait_for_thread() is None and recipe_of(image).generator.slope == pytest.approx(0.3)


def test_images_that_go_while_their_map_is_made_are_forgotten(window):
    image = generated(resolution="256")
    image.glint.bumps.slope = 0.2
    window.now += 2 * live_map.DELAY
    live_map.tick()
    bpy.data.images.remove(image)
    assert wait_for_thread() is None


def test_nothing_changes_while_blender_renders(window):
    image = generated(resolution="256")
    image.glint.bumps.slope = 0.2
    window.now += 2 * live_map.DELAY
    live_map.bpy.app.is_job_running = lambda kind: kind == "RENDER"
    assert live_map.tick() == live_map.DELAY and is_preview(image)


def test_a_file_is_saved_with_full_maps(window, tmp_path):
    image = generated(resolution="256")
    image.glint.bumps.slope = 0.2
    assert is_preview(image)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "waves.blend"))
    assert live_map.tick() is None
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "waves.blend"))
    assert bpy.context.scene.glint.normal_map.size[:] == (256, 256) and live_map.tick() is None


def test_small_maps_that_undoing_brings_back_become_full_ones(window):
    image = generated(resolution="256")
    image.glint.bumps.slope = 0.2
    live_map.forget()
    assert live_map.tick() is None and is_preview(image)
    live_map.look()
    window.now += 2 * live_map.DELAY
    live_map.tick()
    assert wait_for_thread() is None and not is_preview(image)


def test_unregistering_ends_the_thread_and_the_timer(window):
    image = generated(resolution="256")
    image.glint.bumps.slope = 0.2
    window.now += 2 * live_map.DELAY
    live_map.tick()
    glint_addon.unregister()
    try:
        assert live_map._making is None and not bpy.app.timers.is_registered(live_map.tick)
    finally:
        glint_addon.register()
    assert bpy.data.images[0].glint.kind == "BUMPS"  # the settings are still in the file


def test_filling_settings_from_a_recipe_makes_no_map():
    image = generated()
    before = image_pixels(image)
    fill(image.glint, recipe_of(generated(kind="DENTS")))
    assert kind_settings(image.glint).depth == pytest.approx(0.0002) and (image_pixels(image) == before).all()
