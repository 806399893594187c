"""The tables of lights, of their sizes and of denoising: lights as they say, stored truths, measuring at 8 pixels."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks import denoise, light_case, light_scene, light_size, lights, truth
from benchmarks.cost import Cost
from benchmarks.counters import Counts
from demo_scenes import measure, stage
from tests.helpers.stress_marks import stress, thinned

SIDE = 8  # pixels
SPP = 256  # of Blender's nodes; the mean of 64 pixels is then known to a tenth
FACTOR = 2.0  # lights are "about" as strong as the sun; one that stands elsewhere gives a fifth and less
CASES = {**light_scene.KINDS, **light_size.SUNS}
MACHINE = {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "2000"}


def mean_luminance(scene):
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.cycles.samples = SPP
    return measure.luminance(measure.rendered(scene)).mean()


@pytest.fixture(scope="module")
def brightness_of_the_sun():
    return mean_luminance(light_scene.light_stage(light_scene.sun(0.5)[1]).scene)


@pytest.mark.parametrize("name", thinned(CASES, list(CASES)[:2], "a truth of each light"))
def test_a_light_has_a_quiet_truth_of_its_stage_and_shines_about_as_the_sun(name, brightness_of_the_sun):
    made = light_scene.light_stage(CASES[name])
    stored = truth.read_truth(light_case.truth_file(name))
    assert stored.noise <= light_case.NOISE
    assert stored.seeds >= truth.FEWEST_PARTS
    command = "light_size" if name in light_size.SUNS else "lights"
    assert stored.scene_hash == light_scene.stage_hash(made), f"Run python -m benchmarks.{command} --renew-truth."
    assert 1 / FACTOR < mean_luminance(made.scene) / brightness_of_the_sun < FACTOR


def test_the_suns_of_the_size_table_are_as_wide_as_they_say():
    for degrees, (name, add_light) in zip(light_size.DEGREES, light_size.SUNS.items(), strict=True):
        scene = stage.empty_scene((SIDE, SIDE), 1)
        add_light(scene)
        assert math.degrees(scene.objects["Sun"].data.angle) == pytest.approx(degrees, rel=1e-6)
        assert name == f"sun, {degrees:g} degrees"


def test_the_sun_in_the_hdri_has_an_irradiance_of_one_and_the_lights_direction():
    height = 256
    pixel = math.pi / height  # half as wide as the sun
    radiance = light_scene.hdri(height)[..., 0].astype(float)
    latitude, longitude = np.meshgrid((np.arange(height) + 0.5) * pixel - math.pi / 2,
                                      math.pi - (np.arange(2 * height) + 0.5) * pixel, indexing="ij")
    light = np.where(radiance > 1.0, radiance, 0.0) * np.cos(latitude) * pixel**2
    assert light.sum() == pytest.approx(1.0, rel=1e-3)
    axes = np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)
    assert np.dot([(light * axis).sum() for axis in axes], light_scene.LIGHT) > math.cos(pixel)


def test_tiles_cover_the_picture_once():
    covered = np.zeros((SIDE, SIDE), int)
    for rows, columns in light_scene.tiles(SIDE).values():
        covered[rows, columns] += 1
    np.testing.assert_array_equal(covered, 1)
    assert list(light_scene.tiles(SIDE)) == ["flakes, middle", "flakes, far", "bumps, middle", "bumps, far"]


def test_a_truth_of_another_state_of_the_stage_is_refused(monkeypatch):
    monkeypatch.setattr(light_scene, "ROUGHNESS", 0.5)
    with pytest.raises(ValueError, match="older state of the stage"):
        light_case.case_results("point", light_scene.add_point)


@pytest.fixture(scope="module")
def prepared():
    """The stage with small maps under a wide sun at 8 pixels, and its truth, which is soon quiet."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(light_scene, "MAP_SIDE", 64)
        made = light_scene.light_stage(light_scene.sun(5)[1], SIDE)
    pictures = light_case.pictures(made.scene, SPP, 8)
    mean, variance = pictures.mean(axis=0), pictures.var(axis=0, ddof=1) / len(pictures)
    return made, truth.Truth(mean, variance, SPP, len(pictures), "", "")


@stress("a case of the table", fast=["benchmarks/test_light_benchmarks.py::test_the_tables_say_what_was_measured"])
def test_a_case_has_errors_of_both_methods_and_the_median_of_its_cost_ratios(prepared, monkeypatch):
    costs, guesses = iter([1.0, 3.0, 2.0, 10.0]), []  # nodes and lobe, round by round

    def cost(scene, spp, start_up, *, guess, start_ups):
        guesses.append(guess)
        return Cost(spp, 1, next(costs), start_up)

    monkeypatch.setattr(light_case, "render_cost", cost)
    monkeypatch.setattr(measure, "start_up_seconds", lambda scene, repeats: 2.0)
    monkeypatch.setattr(light_case, "stage_counts", lambda made: {"closures": 2.0})
    monkeypatch.setattr(light_case, "SPP", {4: 1, 64: 1})
    made, right = prepared
    found = light_case.measured(made, right)
    assert found["hints"] == ["Sun"]
    assert (found["ratio"], found["low"], found["high"]) == (4.0, 3.0, 5.0)
    assert guesses == [2.0 * light_case.FIRST_GUESS, 2.0 * light_case.FIRST_GUESS, 1.0, 3.0], "never a pilot"
    nodes, lobe = found["errors"]["nodes"], found["errors"]["lobe"]
    assert lobe["4"]["rmse"] < nodes["4"]["rmse"] / 2
    assert nodes["64"]["rmse"] < nodes["4"]["rmse"]
    squares = np.mean([nodes["4"]["tiles"][name] ** 2 * right.mean[tile].mean() ** 2
                       for name, tile in light_scene.tiles(SIDE).items()])
    assert math.sqrt(squares) / right.mean.mean() == pytest.approx(nodes["4"]["rmse"], rel=1e-6)


def test_counts_are_means_over_the_pixels_of_every_material(monkeypatch):
    def counted(pixels, closures):
        seen = np.arange(4) < pixels
        values = {name: np.where(seen, closures, 99.0) for name in ("visited", "closures", "fetches", "mode", "hints")}
        return Counts(seen=seen, reason=np.zeros(4), **values)

    parts = {"one": counted(1, 4.0), "other": counted(3, 8.0)}
    monkeypatch.setattr(light_case, "counters", lambda scene, material, spp: parts[material])
    made = light_scene.LightStage(None, (), {"lobe": {"flakes": "one", "bumps": "other"}})
    assert light_case.stage_counts(made) == {"closures": 7.0, "visited": 7.0}


def test_every_way_of_denoising_is_rendered_and_mixtures_are_of_two_of_them(prepared, monkeypatch):
    chosen = (denoise.DEFAULT, denoise.ALBEDO, f"default, {denoise.MORE_SPP} spp")
    monkeypatch.setattr(denoise, "SETTINGS", {name: denoise.SETTINGS[name] for name in chosen})
    made, _ = prepared
    made.dress("nodes", osl=False)
    glints = np.zeros((SIDE, SIDE), bool)
    glints[0] = True
    found = denoise.ways(made.scene, glints)
    off, albedo = found[denoise.OFF], found[denoise.ALBEDO]
    assert len({picture.tobytes() for picture in found.values()}) == len(found), "every way gives another picture"
    np.testing.assert_allclose(found[denoise.BLEND], (off + albedo) / 2)
    np.testing.assert_array_equal(found[denoise.MASK][0], off[0])
    np.testing.assert_array_equal(found[denoise.MASK][1:], albedo[1:])
    assert made.scene.cycles.samples == denoise.MORE_SPP
    assert albedo.std() < off.std(), "a denoised picture is smoother"


def test_a_glint_that_lost_half_of_its_light_is_half_kept():
    mean = np.ones((10, 10))
    mean[3, 4] = 100.0
    shown = mean.copy()
    shown[3, 4] = 50.0
    row = denoise.row(np.repeat(shown[..., None], 3, -1), truth.Truth(mean, np.zeros_like(mean), 1, 1, "", ""))
    assert row["kept"] == pytest.approx(0.5)
    assert row["rmse"] == pytest.approx(5.0 / mean.mean())
    assert row["bias"] == pytest.approx(-0.5 / mean.mean())


def error(rmse):
    return {"rmse": rmse, "bias": -0.001, "bias_noise": 0.002, "tiles": dict.fromkeys(light_scene.tiles(), rmse)}


def test_the_tables_say_what_was_measured():
    errors = {"nodes": {"4": error(4.5), "64": error(1.125)}, "lobe": {"4": error(0.25), "64": error(0.0625)}}
    case = {"hints": [], "truth": {"noise": 0.03}, "errors": errors, "counts": {"closures": 12.25},
            "ratio": 3.5, "low": 3.25, "high": 4.0}
    results = {"machine": MACHINE, "rounds": 3, "cases": {"lantern": case, "lamp": {**case, "hints": ["Lamp"]}}}
    for module in (lights, light_size):
        text = module.table(results)
        assert "| lantern | none | 4.500 | 1.125 | 0.250 | 0.062 | 3.50 | 3.25 to 4.00 | -0.10% ± 0.20% |" in text
        assert "| lamp | Lamp |" in text and "| lamp | 1.125, 0.062 | 1.125, 0.062 |" in text and "Abacus" in text


def test_the_denoising_table_has_a_column_for_each_scene():
    ways = (denoise.OFF, denoise.OFF_MORE, *denoise.SETTINGS, denoise.BLEND, denoise.MASK)
    rows = dict.fromkeys(ways, {"rmse": 0.125, "bias": 0.0, "kept": 0.75})
    scene = dict.fromkeys(denoise.OPEN, rows)
    text = denoise.table({"machine": MACHINE, "spp": 16, "scenes": {"one": scene, "two": scene}})
    assert "| Glint | colour alone | 0.125, 75% | 0.125, 75% |" in text
    assert text.count("| Glint |") == len(ways) and "Abacus" in text
