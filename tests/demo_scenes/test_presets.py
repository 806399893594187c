"""The presets' stage, their thumbnails and contact sheet, the list in the guide, and the three large pictures."""

import re

import numpy as np
import pytest

import glint_addon
from demo_scenes import endless, measure, picture, preset_stage, presets, report, showcase, stage
from demo_scenes.__main__ import ALL, COMPARISONS, DEMO, GALLERY, SHEETS, SHOWCASE
from glint_addon import paths
from tests.helpers.cycles import read_image
from tests.helpers.stress_marks import thinned

THUMBNAILS = 600_000  # bytes of all together: the extension stays small
SHEET = 700_000  # bytes: a clone must stay small
NAMES = tuple(glint_addon.presets())


def ball_of(scene):
    return next(thing for thing in scene.objects if thing.name.startswith("Icosphere"))


@pytest.mark.parametrize("close", [False, True])
@pytest.mark.parametrize("name", ["Metallic Red", "Brushed Aluminium"])
def test_a_preset_on_its_stage_is_lit(name, close):
    scene = preset_stage.build(name, size=(16, 16), spp=4, close=close)
    glint_addon.prepare_scene(scene)
    pixels = measure.rendered(scene)
    assert np.isfinite(pixels).all()
    assert pixels[6:10, 6:10].mean() > 0.005  # the ball is not black, whatever its colour


def test_the_balls_map_has_real_size_on_all_that_the_camera_sees():
    """Lambert's projection keeps areas: the size of a UV unit is a metre within the error of flat triangles."""
    scene = preset_stage.build("Metallic Red", size=(8, 8), spp=1)
    mesh = ball_of(scene).data
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    loops, vertices = np.empty(3 * count, int), np.empty(3 * len(mesh.vertices))
    mesh.loop_triangles.foreach_get("loops", loops)
    mesh.vertices.foreach_get("co", vertices)
    corner_vertex = np.array([loop.vertex_index for loop in mesh.loops])
    uvs = np.array([corner.vector for corner in mesh.uv_layers.active.uv])[loops].reshape(-1, 3, 2)
    places = vertices.reshape(-1, 3)[corner_vertex[loops]].reshape(-1, 3, 3)
    area = np.linalg.norm(np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]), axis=1)
    a, b = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    area_in_uv = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    towards = np.array((preset_stage.CAMERA - preset_stage.CENTRE).normalized())
    is_seen = places.mean(axis=1) @ towards > 0
    assert np.abs(np.sqrt(area / area_in_uv)[is_seen] - 1).max() < 0.02
    # All triangles have one handedness there: no seam, and no mirrored map.
    assert len(np.unique(np.sign(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[is_seen])) == 1


def test_a_close_up_shows_more_of_the_map_the_larger_its_features():
    widths = {name: preset_stage.close_width(glint_addon.presets()[name]) for name in NAMES}
    assert all(preset_stage.NARROWEST <= width <= preset_stage.WIDEST for width in widths.values())
    assert widths["Metallic Red"] < widths["Sand"] < widths["Old Snow"]


def test_the_close_up_lies_beside_the_mirrored_sun():
    place = preset_stage.near_highlight()
    normal = (place - preset_stage.CENTRE) / preset_stage.RADIUS
    assert normal.length == pytest.approx(1, abs=1e-6)
    towards = (preset_stage.CAMERA - preset_stage.CENTRE).normalized()
    middle = (towards + preset_stage.SUN.normalized()).normalized()
    assert normal.angle(middle) == pytest.approx(preset_stage.BESIDE, abs=1e-3)


def test_each_preset_has_a_small_thumbnail_and_nothing_else_is_there():
    files = sorted(paths.preset_folder().glob("*.jpg"))
    assert [file.stem for file in files] == sorted(presets.file_name(name) for name in NAMES)
    assert sum(file.stat().st_size for file in files) < THUMBNAILS
    assert all(read_image(file).shape[:2] == (presets.THUMBNAIL,) * 2 for file in files)


def test_the_files_of_presets_are_named_after_them():
    assert sorted(file.stem for file in paths.preset_folder().glob("*.json")) == sorted(map(presets.file_name, NAMES))


def test_the_contact_sheet_is_there_and_small():
    assert 50_000 < (report.DOCS / "presets.jpg").stat().st_size < SHEET


def test_the_guides_list_is_that_of_the_presets_files():
    text = report.GUIDE.read_text(encoding="utf-8")
    block = text.split(report.PRESETS_BEGIN)[1].split(report.PRESETS_END)[0]
    assert block.strip() == report.preset_list()
    assert len(re.findall(r"^\| \w", block, re.MULTILINE)) == len(NAMES) + 1


def test_the_list_is_written_into_the_guide(tmp_path, monkeypatch):
    guide = tmp_path / "guide.md"
    guide.write_text(f"a\n{report.PRESETS_BEGIN}\n{report.PRESETS_END}\nb\n", encoding="utf-8")
    monkeypatch.setattr(report, "GUIDE", guide)
    report.update_guide()
    assert report.preset_list() in guide.read_text(encoding="utf-8")
    assert guide.read_text(encoding="utf-8").endswith("b\n")


def test_a_smaller_picture_has_the_means_of_the_areas_that_its_pixels_cover():
    pixels = np.random.default_rng(1).random((12, 12, 3))
    np.testing.assert_allclose(presets.smaller(pixels, 4), pixels.reshape(4, 3, 4, 3, 3).mean(axis=(1, 3)))
    # Pixels of 2.4 pixels' width: each mean is over its own area, so that the whole keeps its mean.
    assert presets.smaller(pixels, 5).mean() == pytest.approx(pixels.mean())


def test_highlights_are_compressed_and_nothing_else():
    dim = np.full((1, 1, 3), 0.5)
    np.testing.assert_array_equal(presets.seen(dim), dim)
    shown = [presets.seen(np.array([[[value, 0.1 * value, 0.0]]])).ravel() for value in (0.7, 2.0, 20.0, 2000.0)]
    assert all(np.all(a <= b) and b.max() <= 1 for a, b in zip(shown, shown[1:], strict=False))
    assert shown[-1][2] == 0 and shown[-1][1] < 0.6  # the brightest red is still no white


def test_a_jpeg_is_written_where_the_name_says_so(tmp_path):
    picture.save_picture(tmp_path / "a.jpg", np.full((16, 24, 3), 0.5))
    assert (tmp_path / "a.jpg").read_bytes()[:3] == b"\xff\xd8\xff"
    assert read_image(tmp_path / "a.jpg").shape[:2] == (16, 24)


def test_the_demo_begins_with_what_the_product_is_for_and_leaves_the_slow_ones_to_the_gallery():
    assert DEMO[:3] == SHOWCASE == tuple(showcase.SCENES)
    assert set(DEMO) | set(GALLERY) == set(ALL) and not set(DEMO) & set(GALLERY)
    assert set(GALLERY) < {*COMPARISONS, *SHEETS}
    assert showcase.SIZE[0] >= 960 and showcase.SIZE[1] >= 540


@pytest.mark.parametrize("name", thinned(SHOWCASE, ["car_paint"], "a large map's tables"))
def test_a_large_picture_is_lit_and_its_glints_are_found(name):
    pixels = showcase.rendered(name, (32, 18), 2)
    assert np.isfinite(pixels).all() and 0.02 < measure.luminance(pixels).mean() < 3


@pytest.mark.parametrize("surface", endless.SURFACES)
def test_a_large_surface_is_as_bright_shuffled_as_repeated(surface):
    pictures = [endless.rendered(endless.SURFACES[surface], variation, (24, 14), 4) for variation in endless.VARIATIONS]
    repeat, shuffle = (measure.luminance(each).mean() for each in pictures)
    assert 0.05 < repeat < 3 and shuffle == pytest.approx(repeat, rel=0.05)
    assert (pictures[0] != pictures[1]).any()


def test_a_grids_uvs_are_metres_from_its_middle_column():
    scene = stage.empty_scene((4, 4), 1)
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 5), np.linspace(0.0, 2.0, 4))
    places = np.stack([x, y, 0.5 * y], axis=-1)
    form = showcase.grid_object(scene, "Grid", places, None)
    uvs = np.array([corner.vector for corner in form.data.uv_layers.active.uv])
    assert uvs[:, 1].min() == pytest.approx(-1) and uvs[:, 1].max() == pytest.approx(1)
    assert np.ptp(uvs[:, 0]) == pytest.approx(np.hypot(2.0, 1.0))
