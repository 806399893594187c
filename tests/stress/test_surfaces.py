"""Stress of surfaces and flakes: values at their ends, each against Blender's own nodes."""

from __future__ import annotations

import numpy as np
import pytest

from demo_scenes import maps
from glint_addon.nodes.map_choices import SURFACE
from tests.helpers.stress import SURFACE as DEFAULT
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import sunny_square

pytestmark = stress("every value against Blender's nodes", fast=[
    "osl/test_lobe.py::test_every_surface_has_the_right_mean_in_each_channel",
    "osl/test_flakes.py::test_flakes_have_the_mean_of_blenders_nodes_at_every_distance",
])

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
ENDS = {
    "a black metal with a white edge": {"surface": "METAL", "color": BLACK, "edge_tint": WHITE},
    "a white metal with a black edge": {"surface": "METAL", "color": WHITE, "edge_tint": BLACK},
    "a metal brighter than white": {"surface": "METAL", "color": (3.0, 2.0, 1.0)},
    "a conductor that absorbs nothing": {"surface": "CONDUCTOR", "ior": (1.1, 1.5, 4.0), "extinction": BLACK},
    "a conductor as bright as may be": {"surface": "CONDUCTOR", "ior": BLACK, "extinction": (100.0, 100.0, 100.0)},
    "a dielectric of air": {"surface": "DIELECTRIC", "ior": 1.0001},
    "a dense dielectric": {"surface": "DIELECTRIC", "ior": 100.0},
    "a dielectric without reflection head-on": {"surface": "DIELECTRIC", "ior": 1.5, "color": BLACK},
    "a tint brighter than white": {"surface": "TINT", "color": (20.0, 5.0, 1.0)},
}
SETTINGS = {
    "rough": {"roughness": 1.0},
    "steep": {"strength": 3.0},
    "between texels": {"interpolation": "LINEAR"},
}
SIDE = 64  # texels of maps of flakes


@pytest.mark.parametrize("name", ENDS)
def test_values_at_their_ends_agree_with_the_node(stress_record, name):
    lit = name not in ("a dielectric of air",)
    compare(stress_record, sunny_square, surface=DEFAULT | ENDS[name], lit=lit)


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("surface", [kind for kind in SURFACE.identifiers if kind != "TINT"])
def test_every_surface_agrees_with_its_node_in_extreme_settings(stress_record, surface, name):
    settings = DEFAULT | {"surface": surface, "distribution": "GGX", "interpolation": "CLOSEST"} | SETTINGS[name]
    compare(stress_record, sunny_square, surface=settings)


def images(share, colors):
    """A function that makes the images of flakes that cover `share` of the map; colors (lowest, highest) or None."""
    def made():
        rng = np.random.default_rng(9)
        presence = np.repeat((rng.random((SIDE, SIDE, 1)) < share).astype(float), 3, axis=2)
        presence[0, 0] = 1.0  # at least one
        found = {"presence": maps.blender_image("Presence", presence)}
        if colors is not None:
            low, high = colors
            found["flake_color"] = maps.blender_image("Colors", low + (high - low) * rng.random((SIDE, SIDE, 3)))
        return found
    return made


FLAKES = {
    "a single flake": (0.0, None),
    "nearly all": (0.999, None),
    "half, black and white": (0.5, (0.0, 1.0)),
    "half, brighter than white": (0.5, (0.0, 30.0)),
    "few, of one colour": (0.05, (0.5, 0.5)),
}
WAYS = {
    "tint": {"surface": "TINT", "color": (0.9, 0.6, 0.3)},
    "metal": {"surface": "METAL", "color": (0.9, 0.6, 0.3)},
    "dielectric": {"surface": "DIELECTRIC", "ior": 1.4},
    "half strength": {"strength": 0.5},
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", FLAKES)
def test_flakes_agree_with_blenders_nodes(stress_record, name, way):
    share, colors = FLAKES[name]
    settings = DEFAULT | {"interpolation": "CLOSEST", "base_color": (0.1, 0.2, 0.4)} | WAYS[way]
    compare(stress_record, sunny_square, surface=settings, flakes=images(share, colors),
            normal_map=maps.flakes(SIDE, std=0.1, seed=8))


@pytest.mark.parametrize("name", FLAKES)
def test_flakes_agree_with_blenders_nodes_by_nodes_alone(stress_record, name):
    share, colors = FLAKES[name]
    settings = DEFAULT | {"interpolation": "CLOSEST", "base_color": (0.1, 0.2, 0.4)}
    compare(stress_record, sunny_square, surface=settings, flakes=images(share, colors), by_nodes=True,
            normal_map=maps.flakes(SIDE, std=0.1, seed=8))
