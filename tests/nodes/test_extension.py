"""Maps that do not repeat: inside the lobe, at the edge and beyond exactly what Blender's own nodes show."""

import bpy
import numpy as np
import pytest

from benchmarks.counters import REASONS, counters
from demo_scenes import maps
from glint_addon import create_glint_material, prepare_scene
from glint_addon.errors import MapError
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import glint_bsdf
from glint_addon.nodes.map_choices import EXTENSION
from tests.helpers import cycles

SIDE = 32  # texels
PIXELS = 32  # over a plane of three maps' width: the one in the middle has a third of them
SPP = 64
# Of Blender's nodes with so few samples, in a lobe and light so wide that they converge.
TOLERANCE = 0.05
WIDE = {"roughness": 0.4}


def scene_with(extension, interpolation) -> tuple:
    """(scene, material, plane): UVs -1..2, lit from above, seen from above."""
    scene = cycles.empty_scene(size=(PIXELS, PIXELS), spp=SPP)
    cycles.box_filter(scene)
    cycles.add_camera(scene, (0, 0, 3), width=3.0)
    cycles.add_sun(scene, (0, 0, 1), angle=0.2)
    image = maps.blender_image("Flakes", maps.flakes(SIDE, std=0.1))
    material = create_glint_material("Sparkle", image, extension=extension, interpolation=interpolation, **WIDE)
    plane = cycles.add_plane(scene, 3.0, material=material)
    plane.data.uv_layers[0].uv.foreach_set("vector", np.float32([-1, -1, 2, -1, 2, 2, -1, 2]))
    return scene, material, plane


@pytest.fixture(scope="module",
                params=[("EXTEND", "LINEAR"), ("CLIP", "LINEAR"), ("CLIP", "CLOSEST"), ("MIRROR", "CLOSEST")],
                ids="-".join)
def rendered(request):
    """(extension, picture of the nodes, picture of the lobe, reasons why its samples left early)."""
    scene, material, _ = scene_with(*request.param)
    scene.cycles.shading_system = False
    nodes = cycles.rendered(scene)[..., 0]
    prepare_scene(scene)
    lobe = cycles.rendered(scene)[..., 0]
    return request.param[0], nodes, lobe, counters(scene, material).reason


def test_inside_edge_and_outside_are_as_bright_as_blenders_nodes(rendered):
    extension, nodes, lobe, reason = rendered
    third = PIXELS // 3
    for rows in (slice(0, third), slice(third, 2 * third), slice(2 * third, None)):
        for columns in (slice(0, third), slice(third, 2 * third), slice(2 * third, None)):
            expected = nodes[rows, columns].mean()
            assert lobe[rows, columns].mean() == pytest.approx(expected, rel=TOLERANCE, abs=1e-3), (rows, columns)
    assert (nodes[:third].max() == 0) == (extension == "CLIP")


def test_only_the_inside_is_the_lobes(rendered):
    _, _, _, reason = rendered
    at_edge = np.isin(reason, [key for key, name in REASONS.items() if name == "EDGE"])
    inside = slice(PIXELS // 3 + 2, 2 * PIXELS // 3 - 1)
    assert not at_edge[inside, inside].any()
    outside = at_edge.copy()
    outside[PIXELS // 3 : 2 * PIXELS // 3 + 1, PIXELS // 3 : 2 * PIXELS // 3 + 1] = True
    assert outside.all()


def test_a_repeating_map_has_no_edge():
    scene, material, _ = scene_with("REPEAT", "CLOSEST")
    prepare_scene(scene)
    names = {REASONS[int(reason)] for reason in np.unique(counters(scene, material).reason)}
    assert "EDGE" not in names


def test_maps_that_extend_otherwise_have_groups_of_their_own_and_share_the_table(scene):
    image = maps.blender_image("Flakes", maps.flakes(SIDE, std=0.1))
    materials = [create_glint_material(name, image, extension=name) for name in EXTENSION.identifiers]
    for material in materials:
        cycles.add_plane(scene, material=material)
    groups = [glint_groups(material)[0] for material in materials]
    assert len(set(groups)) == 4 and len({group["glint_table"] for group in groups}) == 1
    natives = [group.nodes["Normal Map Image"].extension for group in groups]
    assert natives == list(EXTENSION.identifiers)
    repeats = [group.nodes[glint_bsdf.SCRIPT_NODE].inputs["Repeats"].default_value for group in groups]
    assert repeats == [1, 0, 0, 0]


def test_an_unknown_extension_is_refused(scene):
    image = maps.blender_image("Flakes", maps.flakes(SIDE, std=0.1))
    with pytest.raises(MapError, match='Extension "WRAP" is unknown: use one of REPEAT'):
        create_glint_material("Sparkle", image, extension="WRAP")
    assert not bpy.data.materials
