"""The demo: scenes build and are lit, measures and pictures are right, stored truths are what they say."""

import re
from importlib import import_module
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import glint_addon
from demo_scenes import comparison, maps, measure, picture, report, stage, stored_truth, three_ways
from demo_scenes.__main__ import COMPARISONS, FIGURES
from demo_scenes.truth import truth_material
from tests.helpers.cycles import read_image
from tests.helpers.stress_marks import thinned

LARGEST_PICTURE = 300_000  # bytes: a clone must stay small
GRAY = np.full((4, 4, 3), 0.5)


def scene_module(name):
    return import_module(f"demo_scenes.{name}")


@pytest.mark.parametrize("name", thinned(FIGURES, set(FIGURES) - {"image_sphere"}, "the dearest demo render"))
def test_a_seed_figure_builds_and_is_lit(name):
    scene = stage.empty_scene((16, 16), 1)
    scene_module(name).build(scene)
    glint_addon.prepare_scene(scene)
    pixels = measure.rendered(scene)
    assert np.isfinite(pixels).all()
    assert 0.05 < measure.luminance(pixels).mean() < 2


def test_the_checker_sphere_bleeds_red_onto_the_wall_beside_it():
    """Bounced light alone on the white left wall near the sphere is redder than far from it."""
    both = []
    for bounces in (4, 0):
        scene = stage.empty_scene((24, 24), 32)
        scene_module("checker_sphere").build(scene, bounces=bounces)
        both.append(measure.rendered(scene))
    bounced = both[0] - both[1]
    near, far = bounced[6:10, 1:3].mean(axis=(0, 1)), bounced[12:18, 20:22].mean(axis=(0, 1))
    assert near[0] / near[2] > 1.2 * far[0] / far[2]
    # Without the sphere's colours all is white: what bleeds is red.
    assert far[0] > far[2]


@pytest.mark.parametrize("name", thinned(COMPARISONS, list(COMPARISONS)[:1], "stored truths"))
def test_a_stored_truth_is_the_mean_of_blenders_nodes_on_todays_scene(name):
    """A fresh render of another seed has the same mean within five standard errors of the pixels' differences."""
    module = scene_module(name)
    truth = stored_truth.stored_truth(name)
    scene = stage.empty_scene(comparison.SIZE, 32)
    image = maps.blender_image("Normal map", module.normal_map())
    module.build(scene, truth_material("Truth", image, **module.SURFACE))
    difference = measure.luminance(measure.rendered(scene)) - measure.luminance(truth.pixels)
    assert abs(difference.mean()) < 5 * difference.std() / np.sqrt(difference.size)
    assert truth.spp == module.TRUTH_SPP
    assert 0 < truth.noise < 0.5


@pytest.mark.parametrize("name", thinned(["flakes_close", "scratches_close"], ["flakes_close"], "a stored truth"))
def test_the_lobe_of_a_close_view_has_the_truths_energy(name):
    """Mean over the picture within five standard errors of its own noise (differences of two seeds)."""
    module = scene_module(name)
    truth = stored_truth.stored_truth(name)
    scene = stage.empty_scene(comparison.SIZE, 4)
    image = maps.blender_image("Normal map", module.normal_map())
    module.build(scene, glint_addon.create_glint_material("Glint", image, **module.SURFACE))
    glint_addon.prepare_scene(scene)
    difference = measure.luminance(measure.rendered(scene)) - measure.luminance(truth.pixels)
    assert abs(difference.mean()) < 5 * difference.std() / np.sqrt(difference.size)


def test_the_error_measures_are_those_of_known_pictures():
    truth = np.full((8, 8, 3), 2.0)
    noise = np.where(np.indices((8, 8)).sum(axis=0) % 2, 0.5, -0.5)[..., None]
    assert measure.relative_rmse(truth + noise, truth) == pytest.approx(0.25)
    assert measure.bias(truth + noise, truth) == pytest.approx(0.0)
    assert measure.bias(truth * 1.1, truth) == pytest.approx(0.1)
    assert measure.luminance(truth) == pytest.approx(np.full((8, 8), 2.0))


def test_the_noise_of_a_truth_is_found_from_its_parts(tmp_path, monkeypatch):
    """Parts of unit mean and standard deviation s make a mean of noise s / sqrt(parts)."""
    monkeypatch.setattr(stored_truth, "FOLDER", tmp_path)
    rng = np.random.default_rng(1)
    deviation = 0.4
    parts = [np.repeat(rng.normal(1, deviation, (64, 64, 1)), 3, axis=2) for _ in range(stored_truth.PARTS)]
    truth = stored_truth.store_truth(SimpleNamespace(NAME="test", TRUTH_SPP=64), parts)
    # 4096 pixels: the standard deviation is known to one percent.
    assert truth.noise == pytest.approx(deviation / np.sqrt(stored_truth.PARTS), rel=0.05)
    assert np.allclose(truth.pixels, np.mean(parts, axis=0), rtol=1e-3)


def test_a_picture_shows_linear_values_in_the_standard_view(tmp_path):
    assert picture.standard_view([0.0, 0.001, 0.5, 1.0, 7.0]).tolist() == [0, 3, 188, 255, 255]
    picture.save_side_by_side(tmp_path / "a.png", [("left", GRAY), ("right\nline", GRAY * 2)], title="Title", scale=8)
    written = read_image(tmp_path / "a.png") * 255
    bottom = picture.MARGIN + 2 * picture.LINE_HEIGHT
    assert written.shape[1] == 2 * 4 * 8 + 3 * picture.MARGIN
    assert written.shape[0] == 4 * 8 + 2 * picture.MARGIN + 3 * picture.LINE_HEIGHT
    left = written[bottom : bottom + 32, picture.MARGIN : picture.MARGIN + 32, :3]
    assert np.allclose(left, 188, atol=0.01)
    # Letters are there, in the label and in the title.
    assert written[:bottom].max() > 200 and written[-picture.LINE_HEIGHT :].max() > 200


def test_the_view_of_a_picture_is_blenders_standard(tmp_path):
    """Blender's own save through the scene's view transform gives the same bytes, up to one of rounding."""
    values = np.array([0.0, 0.002, 0.05, 0.5, 0.9, 1.0, 1.5], np.float32)
    scene = stage.empty_scene((4, 4), 1)
    scene.render.image_settings.file_format = "PNG"
    scene.render.dither_intensity = 0
    image = bpy.data.images.new("View", len(values), 1, float_buffer=True)
    image.pixels.foreach_set(np.stack([values, values, values, np.ones_like(values)], axis=1).ravel())
    image.save_render(str(tmp_path / "view.png"), scene=scene)
    shown = read_image(tmp_path / "view.png")[0, :, 0] * 255
    assert np.allclose(shown, picture.standard_view(values), atol=1)


def test_the_readme_block_is_replaced_and_nothing_else(tmp_path, monkeypatch):
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n", encoding="utf-8")
    monkeypatch.setattr(report, "README", readme)
    monkeypatch.setattr(report, "DOCS", tmp_path / "docs")
    rows = [comparison.Measurement("a", "Glint", 4, 1.25, 0.5, -0.011)]
    report.update_readme(report.table(rows), tmp_path)
    text = readme.read_text(encoding="utf-8")
    assert "| a | Glint | 4 | 1.25 | 0.500 | -1.1% |" in text
    assert text.startswith("before\n") and text.endswith("\nafter\n") and "old" not in text
    readme.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match="put the marks back"):
        report.update_readme("table", tmp_path)


def test_a_truth_material_refuses_an_image_shown_as_colour():
    image = bpy.data.images.new("Colour", 4, 4)
    with pytest.raises(ValueError, match="Non-Color"):
        truth_material("Truth", image)


def test_three_ways_have_one_mean_and_their_order_of_noise():
    """The brushed disc converges soonest."""
    module, truth = scene_module("brushed_far"), stored_truth.stored_truth("brushed_far").pixels
    pictures = [three_ways.rendered(module, osl, spp=64) for osl in three_ways.WAYS.values()]
    errors = [measure.relative_rmse(pixels, truth) for pixels in pictures]
    assert errors[0] < errors[1] < 0.5 * errors[2]
    assert all(abs(measure.bias(pixels, truth)) < 0.05 for pixels in pictures)


def test_rows_of_panels_stand_under_each_other(tmp_path):
    rows = [("One", [("a", GRAY), ("b", GRAY)], 1.0), ("Two", [("c", GRAY), ("d", 0 * GRAY)], 1.0)]
    picture.save_rows(tmp_path / "rows.png", rows, scale=16)
    picture.save_rows(tmp_path / "row.png", rows[:1], scale=16)
    both, first = read_image(tmp_path / "rows.png"), read_image(tmp_path / "row.png")
    assert both.shape[0] == 2 * first.shape[0] and both.shape[1] == first.shape[1]
    np.testing.assert_array_equal(both[first.shape[0]:], first)


def test_every_picture_the_readme_shows_is_there_and_small():
    shown = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", report.README.read_text(encoding="utf-8"))
    assert len(shown) >= 5
    for name in shown:
        assert (report.README.parent / name).stat().st_size < LARGEST_PICTURE, name


def test_the_readme_has_numbers_of_every_comparison():
    block = report.README.read_text(encoding="utf-8").split(report.BEGIN)[1].split(report.END)[0]
    rows = [line.split("|")[1:3] for line in block.splitlines() if line.startswith("|")][2:]
    assert [(name.strip(), method.strip()) for name, method in rows if "truth" not in method] == [
        (name, method) for name in COMPARISONS for method in ("Blender's nodes", "Glint")
    ]
