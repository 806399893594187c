"""Stress of geometry: roughness, angles, UVs, sizes, transforms and meshes at their ends."""

from __future__ import annotations

import math

import pytest

from tests.helpers import cycles
from tests.helpers.stress import compare


def plain(scene, material):
    cycles.add_plane(scene, 4.0, material=material, repeats=4.0)
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    cycles.add_sun(scene, (0, 1, 1), angle=math.radians(4))


@pytest.mark.parametrize("distribution", ["BECKMANN", "GGX"])
@pytest.mark.parametrize("alpha", [0.05])
def test_alpha(stress_record, alpha, distribution):
    outcome = compare(stress_record, plain, surface={"roughness": math.sqrt(alpha), "distribution": distribution})
    assert outcome.report["hints"]
