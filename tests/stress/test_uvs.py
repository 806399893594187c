"""Stress of texture coordinates: tiny, huge, far, degenerate, mirrored, torn and missing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from demo_scenes import maps
from tests.helpers import cycles
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress

pytestmark = stress("every kind of UVs against Blender's nodes", fast=[
    "osl/test_lobe.py::test_every_geometry_has_the_right_mean",
])

CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)


def stage(scene, material, *, uvs):
    """A square of four metres with the UVs of its four corners, under a slanted camera and a sun."""
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    square = cycles.add_mesh(scene, corners, [(0, 1, 2, 3)], uvs=uvs, material=material)
    add_view(scene)
    return square


def add_view(scene):
    cycles.add_camera(scene, (0, -2, 2), (0, 0, 0), angle=0.6)
    cycles.add_sun(scene, (0, 1, 1), angle=math.radians(4))


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e2, 1e4, 1e6])
def test_uv_scale(stress_record, scale, interpolation):
    compare(stress_record, lambda scene, material: stage(scene, material, uvs=scale * CORNERS),
            surface={"roughness": 0.25, "interpolation": interpolation}, lobe=(4, 2))


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("offset", [(1e4, -1e4), (1e6, 0), (-1e6, 1e6)], ids=str)
def test_uv_offset(stress_record, offset, interpolation):
    # 1e6 leaves float32 steps of 1/16 in UV: four texels.
    compare(stress_record, lambda scene, material: stage(scene, material, uvs=4 * CORNERS + offset),
            surface={"roughness": 0.25, "interpolation": interpolation}, lobe=(8, 2))


UVS = {
    "all equal": 0 * CORNERS + (0.3, 0.7),
    "on a horizontal line": CORNERS * (4, 0),
    "on a slanted line": CORNERS[:, :1] * (3.7, 1.3),
    "nearly on a slanted line": CORNERS[:, :1] * (3.7, 1.3) + CORNERS[:, 1:] * (1e-6, 1e-5),
    "mirrored": CORNERS * (-4, 4),
    "mirrored twice": CORNERS * (-4, -4),
    "long and thin": CORNERS * (40, 0.01),
    "very long and thin": CORNERS * (4, 1e-5),
    "sheared": CORNERS @ np.array([(4, 0), (40, 4)]),
}


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("uvs", UVS)
def test_uvs(stress_record, uvs, interpolation):
    compare(stress_record, lambda scene, material: stage(scene, material, uvs=UVS[uvs]),
            surface={"roughness": 0.25, "interpolation": interpolation}, nodes=(1024, 2), lobe=(8, 2))


@pytest.mark.parametrize(("layer", "uv_map"), [("UVMap", "Other"), (None, ""), (None, "Other"), ("Other", "Other")])
def test_uv_layer_and_the_name_asked_for(stress_record, layer, uv_map):
    def build(scene, material):
        square = stage(scene, material, uvs=4 * CORNERS)
        if layer is None:
            square.data.uv_layers.remove(square.data.uv_layers[0])
        else:
            square.data.uv_layers[0].name = layer

    compare(stress_record, build, surface={"roughness": 0.25, "uv_map": uv_map})


def test_uv_seams_between_small_faces(stress_record):
    """Twelve by twelve faces about as large as a pixel, each turned and moved in the map as it likes."""

    def build(scene, material):
        rng = np.random.default_rng(1)
        side = np.linspace(-2, 2, 25)
        x, y = (grid.ravel() for grid in np.meshgrid(side, side))
        first = (np.arange(24)[:, None] * 25 + np.arange(24)).ravel()
        faces = np.stack([first, first + 1, first + 26, first + 25], axis=1)
        turn = rng.integers(0, 4, len(faces))
        uvs = np.stack([np.roll(CORNERS, k, axis=0) * rng.choice([-0.2, 0.2], 2) + rng.random(2) for k in turn])
        cycles.add_mesh(scene, np.stack([x, y, 0 * x], axis=1), faces, uvs=uvs.reshape(-1, 2), material=material)
        add_view(scene)

    compare(stress_record, build, normal_map=maps.bumps(64, std=0.08, width=3.0, seed=5))
