"""What hints follow beyond the light's own motion: overrides of linked lights, and the scene that was prepared last."""

from __future__ import annotations

import bpy
import pytest

from demo_scenes import maps
from glint_addon import create_glint_material, prepare_scene
from glint_addon.nodes import glint_lights
from tests.helpers import cycles
from tests.helpers.stress import gentle_bumps
from tests.helpers.stress_stage import add_lamp, add_square, sunny_square

ROUNDING = 1e-5  # metres, of float32


@pytest.fixture
def material(scene):
    return create_glint_material("Glint", maps.blender_image("Map", gentle_bumps()), roughness=0.2)


def place(scene):
    """Numbers of the first light as `scene`'s drivers leave them."""
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        graph = bpy.context.evaluated_depsgraph_get()
        node = glint_lights.build().evaluated_get(graph).nodes[glint_lights.light_name(1)]
        return [node.inputs[axis].default_value for axis in "XYZ"]


def test_an_overridden_light_of_a_library_is_followed_where_its_override_moves_it(scene, material, tmp_path):
    library = str(tmp_path / "lights.blend")
    lamp = add_lamp(scene, shadow_soft_size=0.1)
    bpy.data.libraries.write(library, {lamp})
    bpy.data.objects.remove(lamp)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["Point"]
    scene.collection.objects.link(wanted.objects[0])
    own = wanted.objects[0].override_create(remap_local_usages=True)
    add_square(scene, material)
    assert prepare_scene(scene)["hints"] == ["Point"]
    for x in (0.25, -0.5):
        own.location.x = x
        scene.view_layers[0].update()
        assert place(scene) == pytest.approx(own.matrix_world.translation, abs=ROUNDING)
        assert own.matrix_world.translation.x == pytest.approx(x)


def test_preparing_a_scene_again_brings_its_own_lights_back_to_a_material_that_two_scenes_share(scene, material):
    sunny_square(scene, material)
    second = bpy.data.scenes.new("Second")
    cycles.set_up_cycles(second)
    add_square(second, material)
    add_lamp(second)
    for shown, light in ((scene, "Sun"), (second, "Point"), (scene, "Sun")):
        assert prepare_scene(shown)["hints"] == [light]
