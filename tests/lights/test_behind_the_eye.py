"""A light exactly behind the eye, where there is no plane of incidence, makes glints as quiet as one beside it."""

import numpy as np
import pytest

from demo_scenes import maps
from glint_addon import create_glint_material, prepare_scene
from tests.helpers import cycles

PIXELS = 16
SIDE = 128  # texels
TEXELS = 64  # along a pixel, so that counts answer


def noise(light, *, by_nodes):
    """Relative deviation of the pixels of a plane seen from straight above, at 16 samples."""
    scene = cycles.empty_scene(size=(PIXELS, PIXELS), spp=16)
    cycles.add_camera(scene, (0, 0, 3), width=1.0)
    cycles.add_sun(scene, light, angle=0.05)
    image = maps.blender_image("Flakes", maps.flakes(SIDE, std=0.15))
    material = create_glint_material("Sparkle", image, roughness=0.2, interpolation="CLOSEST")
    plane = cycles.add_plane(scene, 1.0, material=material)
    corners = TEXELS * PIXELS / SIDE * np.float32([0, 0, 1, 0, 1, 1, 0, 1])
    plane.data.uv_layers[0].uv.foreach_set("vector", corners)
    prepare_scene(scene)
    scene.cycles.shading_system = not by_nodes
    pixels = cycles.rendered(scene)[..., 0]
    return pixels.std() / pixels.mean()


@pytest.mark.parametrize("by_nodes", [False, True])
def test_it_is_as_quiet_as_one_beside_it(by_nodes):
    behind, beside = (noise(light, by_nodes=by_nodes) for light in ((0, 0, 1), (0.05, 0, 1)))
    assert behind < 1.3 * beside < 0.6
