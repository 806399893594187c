"""Kinds of surface: metals whose reflectance is Fresnel's, and nodes that say what kind they are."""

import bpy
import numpy as np
import pytest

from glint_addon.nodes.surface_kinds import KINDS, METALS, add_facets, conductor_reflectance, node_surface
from tests.reference import facet

EDGE = 1 / 7  # cosine of 82 degrees
# Silver reflects more at 82 degrees than Schlick's approximation, which no tint of 1 or less can say.
TINT_LIMIT = 1e-3
# Reflectance of clean metals head-on that handbooks agree on, for red, green and blue light, and how much they differ.
KNOWN = {"Gold": (0.95, 0.77, 0.38), "Silver": (0.96, 0.94, 0.9), "Copper": (0.93, 0.72, 0.52),
         "Aluminium": (0.91, 0.91, 0.92), "Chromium": (0.55, 0.55, 0.55), "Titanium": (0.62, 0.58, 0.54)}
HANDBOOKS = 0.06


@pytest.mark.parametrize("cosine", [1.0, 0.7, EDGE, 0.01, 0.0])
def test_a_conductor_reflects_as_complex_amplitudes_say(cosine):
    for metal in METALS.values():
        for n, k in zip(metal.ior, metal.extinction, strict=True):
            assert conductor_reflectance(cosine, n, k) == pytest.approx(facet.conductor(cosine, n, k), rel=1e-9)


def test_a_conductor_without_extinction_is_a_dielectric():
    assert conductor_reflectance(1.0, 1.5, 0.0) == pytest.approx(0.04)
    assert conductor_reflectance(0.0, 1.5, 0.0) == pytest.approx(1.0)


def test_metals_have_the_colours_of_handbooks():
    assert METALS.keys() == KNOWN.keys()
    for name, color in KNOWN.items():
        np.testing.assert_allclose(METALS[name].base_color, color, atol=HANDBOOKS)


@pytest.mark.parametrize("name", METALS)
def test_base_colour_and_edge_tint_of_a_metal_reflect_as_it_does_head_on_and_at_82_degrees(name):
    metal = METALS[name]
    for n, k, base, edge in zip(metal.ior, metal.extinction, metal.base_color, metal.edge_tint, strict=True):
        assert facet.f82_tint(1.0, base, edge) == pytest.approx(facet.conductor(1.0, n, k))
        assert facet.f82_tint(EDGE, base, edge) == pytest.approx(facet.conductor(EDGE, n, k), rel=TINT_LIMIT)


def test_a_node_says_which_kind_of_surface_it_is(scene):
    group = bpy.data.node_groups.new("Kinds", "ShaderNodeTree")
    assert [node_surface(add_facets(group, surface, surface)) for surface in KINDS] == list(KINDS)
    assert node_surface(group.nodes.new("ShaderNodeBsdfToon")) == "SHADERNODEBSDFTOON"
