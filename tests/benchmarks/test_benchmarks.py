"""The benchmark: errors and laws against analytic cases, methods that do what they say, reports from results."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

from benchmarks import cost, flip, headline, methods, plots, quick, record, report, run, suite, widened
from benchmarks.__main__ import main
from benchmarks.error import RELATIVE_EPSILON, picture_error
from benchmarks.law import fitted_law, samples_to
from benchmarks.truth import Truth, stored
from demo_scenes import maps, measure, stage
from demo_scenes.truth import truth_material

FLAT = np.full((8, 8), 2.0)
NO_VARIANCE = np.zeros((8, 8))
LARGEST_Z = 4.0  # standard deviations that a mean of noise may be off


# Error


def test_a_picture_ten_percent_too_bright_has_that_error_and_bias():
    error = picture_error([FLAT * 1.1, FLAT * 1.1], FLAT, NO_VARIANCE)
    assert error.rmse == pytest.approx(0.1)
    assert error.bias == pytest.approx(0.1)
    assert error.relmse == pytest.approx(0.01 / (1 + RELATIVE_EPSILON))
    assert error.bias_noise == pytest.approx(0.0, abs=1e-12)


def test_the_truths_own_noise_is_not_the_pictures_error():
    rng = np.random.default_rng(1)
    right = np.full((64, 64), 3.0)
    deviation = 0.6
    noisy_truth = right + rng.normal(0, deviation, right.shape)
    variance = np.full_like(right, deviation**2)
    # The estimate of a variance from n pixels is off by sqrt(2 / n) of it.
    spread = LARGEST_Z * deviation**2 * math.sqrt(2 / right.size) / 9
    assert picture_error([right], noisy_truth, variance).rmse ** 2 < spread
    shifted = picture_error([right + 1.5], noisy_truth, variance)
    assert shifted.rmse == pytest.approx(0.5, rel=0.03)
    assert abs(shifted.bias - 0.5) < LARGEST_Z * shifted.bias_noise * 1.5
    assert shifted.bias_noise == pytest.approx(math.sqrt(2) * deviation / 3 / 64, rel=0.1)


def test_a_picture_of_another_size_and_a_black_truth_are_refused():
    with pytest.raises(ValueError, match="renew the truth"):
        picture_error([np.ones((4, 4))], FLAT, NO_VARIANCE)
    with pytest.raises(ValueError, match="light the scene"):
        picture_error([FLAT], NO_VARIANCE, NO_VARIANCE)


# HDR-FLIP


@pytest.fixture
def dim():
    """A picture of luminance 0.001 to 10, half of it black."""
    picture = np.geomspace(0.001, 10.0, 32 * 32).reshape(32, 32)
    return np.where(np.arange(32) % 2, picture, 0.0)


def noisy(picture, deviation):
    """`picture` with independent relative noise."""
    return np.maximum(picture * (1.0 + deviation * np.random.default_rng(2).standard_normal(picture.shape)), 0.0)


def test_pictures_that_are_equal_have_no_flip_and_it_grows_with_the_noise(dim):
    assert flip.flip_error([dim, dim], dim) == flip.Flip(0.0, 0.0)
    found = [flip.flip_error([noisy(dim, deviation)], dim) for deviation in (0.05, 0.2, 0.8)]
    assert 0.0 < found[0].flip < found[1].flip < found[2].flip < 1.0
    assert all(each.flip < each.flip_99 <= 1.0 for each in found)
    both = flip.flip_error([dim, noisy(dim, 0.2)], dim)
    assert both.flip == pytest.approx(found[1].flip / 2) and both.flip_99 == pytest.approx(found[1].flip_99 / 2)


def test_flip_does_not_depend_on_the_unit_of_light(dim):
    """Exposures follow the truth: a scene of a thousandth of the light has the same error."""
    wanted = flip.flip_error([noisy(dim, 0.3)], dim)
    for unit in (1e-3, 1e3):
        found = flip.flip_error([noisy(dim, 0.3) * unit], dim * unit)
        assert found.flip == pytest.approx(wanted.flip, rel=1e-3)
        start = flip.exposures(dim * unit)["startExposure"] + math.log2(unit)
        assert start == pytest.approx(flip.exposures(dim)["startExposure"], abs=1e-3)


def test_errors_are_seen_at_all_brightnesses_of_the_truth_and_not_in_its_black(dim):
    bright, faint = dim.copy(), dim.copy()
    bright[24:], faint[8:12] = noisy(dim, 0.5)[24:], noisy(dim, 0.5)[8:12]
    assert flip.flip_error([bright], dim).flip > 0.01
    assert flip.flip_error([faint], dim).flip > 0.01
    assert flip.flip_error([dim + 1e-7], dim).flip < 1e-3


def test_the_truths_own_noise_has_a_flip(dim):
    assert flip.truth_flip(dim, np.zeros_like(dim)) == 0.0
    assert flip.truth_flip(dim, (0.05 * dim) ** 2) == pytest.approx(
        flip.flip_error([noisy(dim, 0.05)], dim).flip, rel=0.2
    )


def test_flip_of_a_picture_of_another_size_is_refused(dim):
    with pytest.raises(ValueError, match="renew the truth"):
        flip.flip_error([np.ones((4, 4))], dim)


# Law and headline


def test_the_law_of_an_unbiased_method_is_found():
    law = fitted_law([(spp, 2, 3.0 / math.sqrt(spp)) for spp in (4, 16, 64, 256)])
    assert law.constant == pytest.approx(9.0)
    assert law.exponent == pytest.approx(-0.5)
    assert law.largest == 256
    assert samples_to(law, 0.3) == pytest.approx(100.0)
    assert samples_to(law, 30.0) == 1.0


def test_between_measured_points_they_decide_and_beyond_them_the_law():
    steps = fitted_law([(4, 1, 0.8), (16, 1, 0.2), (64, 1, 0.1)])
    assert samples_to(steps, 0.4) == pytest.approx(8.0)
    assert samples_to(steps, 0.2) == pytest.approx(16.0)
    assert samples_to(steps, 1.6) == pytest.approx(1.0)
    slow = fitted_law([(4, 1, 0.4), (64, 1, 0.2)])
    assert samples_to(slow, 0.1) == pytest.approx(slow.constant / 0.01)


def test_an_error_that_falls_faster_than_the_law_is_let_fall_so():
    law = fitted_law([(spp, 1, 1.0 / spp) for spp in (4, 16, 64)])
    assert samples_to(law, 1.0 / 256) == pytest.approx(256.0)
    assert law.constant / (1.0 / 256) ** 2 > 256.0


def test_an_exponent_that_is_not_the_laws_is_told():
    assert fitted_law([(spp, 1, spp**-0.25) for spp in (1, 16, 256)]).exponent == pytest.approx(-0.25)


def test_few_samples_that_missed_the_bright_paths_hardly_count():
    lucky = [(1, 1, 0.1), *((spp, 1, 3.0 / math.sqrt(spp)) for spp in (64, 256))]
    assert fitted_law(lucky).constant == pytest.approx(9.0, rel=0.01)


def test_a_law_needs_two_errors_above_the_truths_noise():
    with pytest.raises(ValueError, match="two sample counts"):
        fitted_law([(4, 1, 0.1), (16, 1, 0.0)])


def result(*, noise=0.001, lobe_error=0.1, small=True):
    """A stored result of a made-up scene: nodes of error 2 / sqrt(spp) and 1 ms a sample, a lobe of 50 ms at 4 spp."""
    common = {"start_up": 0.1, "repeats": 1, "seeds": 1, "relmse": 0.01, "memory": 20 << 20, "table_bytes": 3000000}

    def row(method, spp, seconds, rmse):
        return {**common, "method": method, "spp": spp, "seconds": seconds, "rmse": rmse, "bias": 0.001 * spp,
                "bias_noise": 0.002, "microseconds": seconds / spp * 1e3}

    rows = [row("nodes", spp, 0.001 * spp, 2.0 / math.sqrt(spp)) for spp in (30, 100, 300, 1000, 3000)]
    rows += [row(name, 100, 0.1, 0.5) for name in ("nodes_cached", "widened", "denoised")]
    rows += [row("lobe", spp, 0.0125 * spp, lobe_error * 2 / math.sqrt(spp)) for spp in (1, 4, 16, 64)]
    machine = {"processor": "Abacus", "cores": 2, "threads": 2, "system": "Linux", "blender": "5.2", "numpy": "2",
               "glint": "1", "date": "2026-01-01"}
    truth = {"spp": 1000, "seeds": 8, "blender": "5.2", "noise": noise, "bias_noise": 0.0005}
    return {"machine": machine, "scene_hash": "abc", "texels": 300.0, "small_lights": small, "truth": truth,
            "nodes_osl_microseconds": 2.5, "rows": rows}


def test_the_speed_up_is_the_nodes_time_to_the_lobes_error():
    line = headline.headline("made_up", result())
    # Error 0.1 takes (2 / 0.1)^2 = 400 samples of 1 ms; the lobe 50 ms.
    assert line.shown == line.speed_ups[4]
    assert line.shown.ratio == pytest.approx(8.0)
    assert not line.shown.extrapolated and not line.shown.is_bound
    assert (line.bias, line.bias_spp) == (pytest.approx(0.064), 64)
    assert line.sample_ratio == pytest.approx(12.5 / 2.5)


def test_each_sample_count_has_its_speed_up_and_one_that_was_not_measured_has_none():
    ups = headline.headline("made_up", result(lobe_error=0.04)).speed_ups
    # Errors 0.08 to 0.01 take 625 to 40,000 samples of 1 ms, of which 3,000 were measured; the lobe 12.5 to 800 ms.
    assert list(ups) == [1, 4, 16, 64]
    assert [each.ratio for each in ups.values()] == pytest.approx([50.0] * 4)
    assert [each.extrapolated for each in ups.values()] == [False, False, True, True]
    assert [each.nodes_seconds for each in ups.values()] == pytest.approx([0.625, 2.5, 10.0, 40.0])


def test_beyond_the_largest_budget_the_speed_up_is_marked_and_never_below_the_truths_noise():
    found = headline.headline("made_up", result(lobe_error=0.01)).shown
    assert found.extrapolated
    assert found.ratio == pytest.approx(800.0)
    floored = headline.headline("made_up", result(lobe_error=0.01, noise=0.1)).shown
    assert floored.error == 0.1 and floored.is_bound
    assert floored.ratio == pytest.approx(8.0)


def test_the_median_speed_up_is_of_the_scenes_that_were_measured():
    lines = [headline.headline(str(error), result(lobe_error=error)) for error in (0.2, 0.1, 0.4)]
    ordered = headline.sorted_speed_ups(lines, 4)
    assert [each.scene for each in ordered] == ["0.4", "0.2", "0.1"]
    assert headline.median_ratio(ordered) == pytest.approx(2.0)
    assert [each.scene for each in headline.middle_speed_ups(ordered)] == ["0.2"]
    assert [each.scene for each in headline.middle_speed_ups(ordered[1:])] == ["0.2", "0.1"]
    del lines[0].speed_ups[4]
    assert headline.median_ratio(headline.sorted_speed_ups(lines, 4)) == pytest.approx((8.0 + 0.5) / 2)
    assert headline.sorted_speed_ups(lines, 256) == []


def with_flips(found):
    """A stored result with an HDR-FLIP of 1 / log2(spp + 1) for each row."""
    found["truth"]["flip"] = 0.0125
    for row in found["rows"]:
        row["flip"] = 1.0 / math.log2(row["spp"] + 1)
        row["flip_99"] = min(2.0 * row["flip"], 1.0)
    return found


def test_flip_is_compared_in_the_same_time_where_it_was_measured():
    rows = [{"seconds": 0.1, "flip": 0.4}, {"seconds": 10.0, "flip": 0.2}, {"seconds": 99.0}]
    assert headline.flip_after(rows, 1.0) == pytest.approx(0.3)
    assert headline.flip_after(rows, 0.09) == 0.4 and headline.flip_after(rows, 11.0) == 0.2
    assert headline.flip_after(rows, 0.05) is None and headline.flip_after(rows, 20.0) is None
    assert headline.flip_after([{"seconds": 1.0}], 1.0) is None


def test_flips_of_the_headline_are_of_the_scenes_that_have_them():
    lines = [headline.headline("new", with_flips(result())), headline.headline("old", result())]
    assert list(lines[0].flips) == [4, 64] and lines[1].flips == {}
    # The lobe's 0.8 s at 64 spp are between the nodes' 300 and 1,000 samples of 1 ms.
    pair = lines[0].flips[64]
    assert pair.lobe == pytest.approx(1 / math.log2(65))
    assert 1 / math.log2(1001) < pair.nodes < 1 / math.log2(301)
    assert headline.median_flips(lines, 64) == (pair, 1)
    assert headline.median_flips(lines[1:], 64) is None


def test_an_incomplete_result_is_refused():
    broken = result()
    broken["rows"] = [row for row in broken["rows"] if row["spp"] != 4]
    with pytest.raises(ValueError, match="incomplete"):
        headline.headline("made_up", broken)


# Report


@pytest.fixture
def measured():
    """Results of two made-up scenes, and their headlines."""
    results = {"scenes": {"one": result(), "two": result(lobe_error=0.01, small=False)}}
    return results, headline.headlines(results)


def test_the_headline_table_has_median_worst_and_marks(measured):
    results, lines = measured
    del lines[1].speed_ups[64]
    table = report.headline_table(lines, results)
    assert "| median of all 2 scenes | median of the 1 lit by small lights only |" in table
    assert "| 4 | **404\\*** | **8** | 8 (one) | 800\\* (two) |" in table
    assert "| 64 | **8\\*** (1 of 2) | **8\\*** | 8\\* (one) | 8\\* (one) |" in table
    assert "| 256 | - | - | - | - |" in table
    assert "in the same time: medians | - | - |" in table
    assert "+6.40% ± 0.20% (one)" in table
    assert "Abacus, 2 threads" in table


def test_an_error_below_the_truths_noise_makes_the_ratio_a_bound():
    table = report.scene_table([headline.headline("one", result(noise=0.1))])
    assert table.splitlines()[-1].startswith("| one | 300 | 8 | 8 | ≥ 2 | ≥ 0.5 | - | - | - | -0.50 |")


def test_every_measurement_is_a_row_of_the_page(measured):
    results, lines = measured
    page = report.page(results, lines)
    assert page.count("| Blender's nodes | 300 | 0.300 | 0.1155 |") == 2
    for row in results["scenes"]["one"]["rows"]:
        label = methods.method(row["method"]).label
        assert f"| {label} | {row['spp']} | {row['seconds']:.3f} | {row['rmse']:.4f} |" in page


def test_tables_show_flip_where_it_was_measured():
    results = {"scenes": {"new": with_flips(result()), "old": result()}}
    lines = headline.headlines(results)
    table = report.headline_table(lines, results)
    assert "Glint at 4 spp / of Blender's nodes in the same time: medians | 0.431 / 0.180 (1 of 2) |" in table
    assert "| 0.431 / 0.180 | 0.166 / 0.104 | -0.50 |" in report.scene_table(lines)
    assert "| 0.0250 | 0.01 | 0.166 | 0.332 | +6.4% |" in report.row_table(results["scenes"]["new"])
    assert "| 0.0250 | 0.01 | - | - | +6.4% |" in report.row_table(results["scenes"]["old"])
    page = report.page(results, lines)
    assert page.count("HDR-FLIP of this noise 0.013") == 1


def test_an_exact_truth_is_called_so_and_draws_no_line_of_noise():
    found = result(noise=0.0)
    found["truth"] |= {"spp": 0, "seeds": 0}
    lines = headline.headlines({"scenes": {"one": found}})
    assert "Truth: exact. Scene abc" in report.page({"scenes": {"one": found}}, lines)
    drawn = plots.scene_figure("one", found, lines[0])
    assert "truth's own noise" not in {line.get_label() for line in drawn.axes[0].lines}


def test_stress_cases_are_listed_whole():
    table = report.stress_table([{"group": "maps", "case": "a|b", "outcome": "agrees", "nodes": 0.25, "lobe": None,
                                  "deviations": 1.23456, "note": "two\nlines"}])
    assert table.splitlines()[-1] == "| maps | a\\|b | agrees | 0.25 |  | 1.235 | two lines |"


def test_results_are_stored_scene_by_scene(tmp_path):
    file = tmp_path / "scenes.json"
    run.store("bumps_close", {"rows": [1]}, file)
    run.store("flakes_far", {"rows": [2]}, file)
    run.store("bumps_close", {"rows": [3]}, file)
    assert record.read_json(file) == {"scenes": {"flakes_far": {"rows": [2]}, "bumps_close": {"rows": [3]}}}
    with pytest.raises(ValueError, match="JSON compliant"):
        run.store("bumps_far", {"rows": [float("nan")]}, file)
    assert len(record.read_json(file)["scenes"]) == 2


def test_the_readmes_block_and_the_page_are_what_the_results_say():
    results = report.stored_results()
    lines = headline.headlines(results)
    readme = report.README.read_text(encoding="utf-8")
    assert report.with_block(readme, report.readme_block(lines, results)) == readme
    assert report.PAGE.read_text(encoding="utf-8") == report.page(results, lines)
    with pytest.raises(ValueError, match="put the marks back"):
        report.with_block("no marks", "table")


def test_a_plot_is_the_same_bytes_each_time_and_has_its_text_as_text(measured, tmp_path, monkeypatch):
    results, lines = measured
    drawn = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        monkeypatch.setattr(plots, "FOLDER", folder)
        monkeypatch.setattr(plots, "SUMMARY", folder / "summary")
        folder.mkdir()
        plots.draw_all(results, lines)
        drawn.append({file.name: file.read_bytes() for file in folder.iterdir()})
    assert drawn[0] == drawn[1]
    assert set(drawn[0]) == {f"{name}.{kind}" for name in ("one", "two", "summary") for kind in ("png", "svg")}
    assert b">relative RMSE</text>" in drawn[0]["one.svg"]
    assert b"extrapolated</text>" in drawn[0]["two.svg"] and b", extrapolated</text>" not in drawn[0]["one.svg"]


def test_an_unknown_scene_is_refused_by_name(capsys, monkeypatch):
    monkeypatch.setenv("BLENDER_USER_RESOURCES", "")
    assert main(["run", "--only", "nowhere"]) == 2
    assert "There is no scene nowhere: choose among" in capsys.readouterr().err


# Methods


def test_the_moments_of_blocks_are_those_of_their_slopes():
    slopes = np.random.default_rng(3).normal(size=(8, 16, 2))
    mean, covariance = widened.block_moments(slopes, 2)
    block = slopes[4:8, 8:12].reshape(-1, 2)
    assert mean.shape == (2, 4, 2)
    assert np.allclose(mean[1, 2], block.mean(axis=0))
    assert np.allclose(covariance[1, 2], np.cov(block.T, bias=True))


def test_the_mip_level_is_that_of_a_pixel_and_within_the_map():
    assert [widened.mip_level(texels, (256, 256)) for texels in (0.1, 1, 16, 1000, 1e9)] == [0, 0, 2, 5, 8]


def test_the_widened_lobe_has_the_sum_of_both_variances():
    alpha, deviation = 0.1, 0.2
    covariance = np.array([[[[0.0, 0.0], [0.0, deviation**2]]]])
    roughness, anisotropy, rotation = widened.lobe_parameters(covariance, alpha)[0, 0]
    # Blender's alpha_x and alpha_y; x is the narrow axis, here u.
    assert roughness**2 * (1 - anisotropy) == pytest.approx(alpha, rel=1e-5)
    assert roughness**2 / (1 - anisotropy) == pytest.approx(math.sqrt(alpha**2 + 2 * deviation**2), rel=1e-5)
    assert math.sin(2 * math.pi * rotation) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("across", [False, True])
def test_a_widened_lobe_reflects_as_much_as_the_texels_it_stands_for(across):
    """Slopes along one diagonal, and a sun whose half vector lies off the normal along it, or across it."""
    slope = np.random.default_rng(4).normal(0.0, 0.15, (64, 64, 1))
    encoded = maps.encoded_normals(slope * np.array([1.0, 1.0]) / math.sqrt(2.0))
    means = []
    # Closest: between texels of independent slopes, interpolation would make them smaller.
    surface = {"roughness": math.sqrt(0.1), "interpolation": "CLOSEST"}
    for make in (truth_material, lambda name, image, **rest: widened.widened_material(image, 4096.0, **rest)):
        scene = stage.empty_scene((8, 8), 256)
        material = make("Lobe", maps.blender_image("Map", encoded), **surface)
        stage.add_sheet(scene, "Sheet", [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], material, repeats=32.0)
        stage.add_camera(scene, (0, 0, 3), (0, 0, 0), angle=0.1)
        stage.add_sun(scene, (0.3, -0.3 if across else 0.3, 1), angle=0.1)
        means.append(measure.luminance(measure.rendered(scene)).mean())
    # What differs: slopes against normals, and shadowing of the lobes (a few percent at these angles).
    assert means[1] == pytest.approx(means[0], rel=0.1)
    # Turned the wrong way, the two lobes would differ by their ratio along and across the diagonal.
    assert means[0] < 0.5 if across else means[0] > 0.5


def test_the_texture_cache_is_used_where_it_is_switched_on():
    generated = measure.rendered(suite.nodes_scene("bumps_far", 4))
    scene = methods.nodes_cached_scene("bumps_far", 4)
    cached, cached_memory = measure.rendered(scene), cost.peak_memory(scene)
    scene.render.use_texture_cache = False
    plain, plain_memory = measure.rendered(scene), cost.peak_memory(scene)
    # The same samples of the same map: a file is as good as a generated image, and only the cache changes the picture.
    assert (plain == generated).all()
    assert np.abs(cached - plain).mean() > 0.1 * plain.mean()
    assert cached_memory < plain_memory


def test_the_denoised_method_has_blenders_own_settings():
    cycles = methods.denoised_scene("flakes_close").cycles
    assert cycles.use_adaptive_sampling and cycles.use_denoising
    assert cycles.adaptive_threshold == pytest.approx(0.01)
    assert (cycles.denoiser, cycles.denoising_input_passes) == ("OPENIMAGEDENOISE", "RGB_ALBEDO_NORMAL")


# Cost and run


def test_pinned_samples_give_the_footprint_of_so_many_samples():
    scene = suite.lobe_scene("flakes_middle", 1)
    scene.render.resolution_percentage = 25
    alone = measure.rendered(scene)
    with cost.pinned_samples(1):
        assert (measure.rendered(scene) == alone).all()
    with cost.pinned_samples(256):
        assert not np.allclose(measure.rendered(scene), alone, rtol=0.1)
    assert (measure.rendered(scene) == alone).all()


def test_a_method_is_measured_at_every_budget_and_the_nodes_at_the_samples_of_the_headline():
    scene = suite.nodes_scene("flakes_close", 64)
    scene.cycles.seed = 77
    mean = measure.luminance(measure.rendered(scene))
    truth = Truth(mean, np.zeros_like(mean), 64, 1, bpy.app.version_string, "")
    rows = run.method_rows(methods.method("nodes"), "flakes_close", truth, (), run.BUDGETS[1])
    assert len(rows) == 3
    assert headline.SHOWN_SPP == rows[0]["spp"] < rows[1]["spp"] < rows[2]["spp"]
    assert rows[0]["rmse"] > rows[1]["rmse"] > rows[2]["rmse"] > 0.0
    assert all(row["repeats"] > 1 and row["seeds"] == 3 and row["memory"] > 0 for row in rows)
    assert all(row["table_bytes"] == 0 for row in rows)
    assert 1.0 > rows[0]["flip"] > rows[2]["flip"] > 0.0


def test_the_sample_counts_of_the_headline_are_measured_whatever_the_largest_budget():
    assert not any(run.is_too_long(spp, 5.0, 0.5) for spp in headline.HEADLINE_SPP)
    assert run.is_too_long(32, 5.0, 0.5) and not run.is_too_long(32, 5.0)
    assert not run.is_too_long(64, 50.0) and run.is_too_long(64, 70.0)
    assert run.is_too_long(256, 11.0)
    assert not run.is_too_long(4, 1000.0, 0.0)


def test_the_quick_benchmark_stays_within_its_limits():
    assert quick.check() == []


def test_counts_above_their_limits_are_told():
    limits = {"visited": 100.0, "share_left_early": 0.5}
    assert quick.complaints("a", {"visited": 100.5, "share_left_early": 0.6}, limits) == []
    told = quick.complaints("a", {"visited": 102.0, "share_left_early": 0.4, "hints": 1.0}, limits)
    assert [sentence.split(":")[1].strip() for sentence in told] == [
        "visited 102 exceeds the limit 100", "share_left_early 0.4 fell below the limit 0.5", "hints 1 has no limit",
    ]


def test_every_stored_result_belongs_to_the_scene_as_it_is():
    results = report.stored_results()["scenes"]
    assert set(results) <= set(suite.NAMES)
    for name, found in results.items():
        assert found["scene_hash"] == stored(name).scene_hash, f"Run make bench ARGS='--only {name}'."
