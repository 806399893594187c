"""The table of kinds of surface: it has them all, and says what the numbers say."""

import pytest

from benchmarks import surfaces
from glint_addon.nodes.map_choices import SURFACE
from tests.benchmarks.test_generate_benchmark import MACHINE


def test_every_kind_of_surface_is_measured_and_flakes():
    kinds = {case["surface"] for case in surfaces.CASES.values()}
    assert kinds == set(SURFACE.identifiers) and "flakes" in surfaces.CASES


def test_the_gain_is_time_to_equal_error():
    assert surfaces.gain({"nodes": 0.6, "lobe": 0.2, "cost": 3.0}) == pytest.approx(3.0)


def test_the_table_has_a_line_for_each_row():
    spp = {str(count): {"nodes": 0.6, "lobe": 0.2, "cost": 3.0} for count in surfaces.SPPS}
    row = {"case": "metal", "distance": "far", "bias": 0.001, "noise": 0.002, "spp": spp}
    text = surfaces.table({"machine": MACHINE, "rows": [row]})
    assert "| metal | far | +0.10% ± 0.20% | 0.600, 0.200 | 3.0 | 3.0 |" in text and "far 160" in text


@pytest.mark.parametrize("method", ["nodes", "lobe"])
@pytest.mark.parametrize("case", ["flakes", "conductor"])
def test_a_case_is_lit_in_either_method(case, method):
    scene = surfaces.dressed(case, "middle", method)
    (picture,) = surfaces.pictures(scene, 64, 1)
    assert picture.mean() > 0.0 and scene.cycles.shading_system == (method == "lobe")
