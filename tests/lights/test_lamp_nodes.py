"""Lamps with nodes: IES profiles, textures and falloffs as their strength or colour, and what hints make of them."""

import math

import bpy
import pytest

from glint_addon.lights.ies import WITHOUT_PROFILE
from glint_addon.lights.irradiance import irradiance
from glint_addon.lights.receivers import world_bounds
from tests.helpers import cycles
from tests.helpers.scene_hints import scene_hints
from tests.helpers.stress import compare
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import add_lamp, add_square, diffuse_material

# Straight below a lamp an estimate is exact; what is left is the noise and width of the rendered spot.
TOLERANCE = 0.01
NO_LIGHT = "its nodes send out no light"
CANDELA = 40.0
AGAINST_NODES = stress("2,048 samples of Blender's nodes", fast=[
    "lights/test_lamp_nodes.py::test_the_estimated_irradiance_of_a_lamp_with_nodes_is_what_cycles_puts_on_a_white_plane",
    "lights/test_lamp_nodes.py::test_a_lamp_whose_nodes_are_dark_for_good_is_no_hint",
])


def profile(values, *, horizontal=(0,), head="TILT=NONE", multiplier=1.0):
    """Text of an IES profile with rows of candela at equal angles from straight down to straight up."""
    step = 180 / (len(values) - 1)
    return "\n".join([
        "IESNA:LM-63-2002", "[TEST] profile", head,
        f"1 -1 {multiplier} {len(values)} {len(horizontal)} 1 2 0 0 0", "1, 0.5, 100",
        " ".join(f"{step * row:g}" for row in range(len(values))), " ".join(map(str, horizontal)),
        *[" ".join(map(str, values)) for _ in horizontal], "",
    ])


ROUND = profile([CANDELA] * 5)
# A beam of 90 degrees around straight down.
BEAM = profile([CANDELA] * 4 + [CANDELA / 2] + [0.0] * 12)


def add_ies(lamp, text=ROUND, *, file=None, strength=1.0):
    """A profile as the strength of a lamp's Emission; returns its node."""
    tree = lamp.data.node_tree
    node = tree.nodes.new("ShaderNodeTexIES")
    node.inputs["Strength"].default_value = strength
    if file is None:
        node.mode, node.ies = "INTERNAL", bpy.data.texts.new("Profile")
        node.ies.from_string(text)
    else:
        file.write_text(text, encoding="latin-1")
        node.mode, node.filepath = "EXTERNAL", str(file)
    tree.links.new(node.outputs["Factor"], emission(lamp).inputs["Strength"])
    return node


def emission(lamp):
    return lamp.data.node_tree.nodes["Emission"]


def plain(lamp, folder):
    emission(lamp).inputs["Strength"].default_value = 3.0


def coloured(lamp, folder):
    emission(lamp).inputs["Color"].default_value = (0.25, 0.5, 0.1, 1)


def ies(lamp, folder):
    add_ies(lamp)


def ies_file(lamp, folder):
    add_ies(lamp, file=folder / "profile.ies", strength=2.0)


def ies_tilted(lamp, folder):
    add_ies(lamp, profile([CANDELA] * 5, head="TILT=INCLUDE\n1\n2\n0, 90\n1, 1", multiplier=2.0))


def ies_of_many_angles(lamp, folder):
    add_ies(lamp, profile([CANDELA] * 5, horizontal=(0, 90, 180)))


def ies_damaged(lamp, folder):
    add_ies(lamp, ROUND[:-20])


def ies_empty(lamp, folder):
    add_ies(lamp, "")


def ies_missing(lamp, folder):
    add_ies(lamp, file=folder / "gone.ies")
    (folder / "gone.ies").unlink()


def ies_times_a_value(lamp, folder):
    tree = lamp.data.node_tree
    times, value = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeValue")
    times.operation, value.outputs[0].default_value = "MULTIPLY", 0.5
    tree.links.new(add_ies(lamp).outputs["Factor"], times.inputs[0])
    tree.links.new(value.outputs[0], times.inputs[1])
    tree.links.new(times.outputs[0], emission(lamp).inputs["Strength"])


def falloff(lamp, folder):
    node = lamp.data.node_tree.nodes.new("ShaderNodeLightFalloff")
    node.inputs["Strength"].default_value = 7.0
    lamp.data.node_tree.links.new(node.outputs["Quadratic"], emission(lamp).inputs["Strength"])


def without_emission(lamp, folder):
    lamp.data.node_tree.nodes.remove(emission(lamp))


def without_output(lamp, folder):
    lamp.data.node_tree.nodes.remove(lamp.data.node_tree.nodes["Light Output"])


NODES = [plain, coloured, ies, ies_file, ies_tilted, ies_of_many_angles, ies_damaged, ies_empty, ies_missing,
         ies_times_a_value, falloff, without_emission, without_output]


@pytest.mark.parametrize("nodes", NODES)
@pytest.mark.parametrize("kind", ["POINT", "SPOT"])
def test_the_estimated_irradiance_of_a_lamp_with_nodes_is_what_cycles_puts_on_a_white_plane(nodes, kind, tmp_path):
    scene = cycles.empty_scene(size=(4, 4), spp=256, osl=False)
    cycles.add_camera(scene, (0, 0, 1), width=0.005)
    plane = cycles.add_plane(scene, 0.01, material=diffuse_material((1, 1, 1)))
    lamp = add_lamp(scene, kind, (0, 0, 3), shadow_soft_size=0.01)
    nodes(lamp, tmp_path)
    scene.view_layers[0].update()
    expected = math.pi * cycles.rendered(scene)[..., :3].mean((0, 1)).max()
    assert irradiance(lamp, *world_bounds([plane]), lamp.data.energy) == pytest.approx(expected, rel=TOLERANCE)


def test_a_profile_that_cannot_be_read_counts_as_cycles_counts_it(scene):
    lamp = add_lamp(scene)
    before = irradiance(lamp, *world_bounds([]), 1.0)
    add_ies(lamp, "no profile")
    assert irradiance(lamp, *world_bounds([]), 1.0) == pytest.approx(WITHOUT_PROFILE * before)


def dark_strength(lamp):
    emission(lamp).inputs["Strength"].default_value = 0.0


def dark_profile(lamp):
    add_ies(lamp, profile([0.0] * 5))


def dark_later(lamp):
    dark_strength(lamp)
    emission(lamp).inputs["Strength"].keyframe_insert("default_value", frame=1)


def textured(lamp):
    tree = lamp.data.node_tree
    for output, socket in enumerate(("Color", "Strength")):
        texture = tree.nodes.new("ShaderNodeTexChecker")
        tree.links.new(texture.outputs[output], emission(lamp).inputs[socket])


@pytest.mark.parametrize(("nodes", "skipped"), [
    (dark_strength, [("Point", NO_LIGHT)]), (dark_profile, [("Point", NO_LIGHT)]), (dark_later, []), (textured, []),
])
def test_a_lamp_whose_nodes_are_dark_for_good_is_no_hint(scene, nodes, skipped):
    lamp = add_lamp(scene)
    nodes(lamp)
    hints, found = scene_hints(scene)
    assert found == skipped
    assert [hint.name for hint in hints] == ([] if skipped else ["Point"])


@AGAINST_NODES
def test_a_weak_lamp_with_a_bright_profile_is_looked_for_before_a_stronger_one_without(scene, stress_record):
    """A hundred times the power of the lamp comes from its profile, beside nine lamps for eight places."""
    def build(scene, material):
        add_square(scene, material)
        for number in range(9):
            add_lamp(scene, name=f"Plain {number}", location=(0.2 * number - 0.8, 1.2, 1.2), power=0.5)
        add_ies(add_lamp(scene, name="Profile", power=0.1), profile([10000.0] * 5))

    outcome = compare(stress_record, build, nodes=(2048, 2))
    assert "Profile" in outcome.report["hints"]


def light_with_beam(scene, kind):
    lamp = add_lamp(scene, kind, power=10.0, **({"size": 0.3} if kind == "AREA" else {"shadow_soft_size": 0.15}))
    add_ies(lamp, BEAM)


def light_with_texture(scene, kind):
    lamp = add_lamp(scene, kind, power=60.0, **({"size": 0.3} if kind == "AREA" else {"shadow_soft_size": 0.15}))
    tree = lamp.data.node_tree
    texture = tree.nodes.new("ShaderNodeTexGradient")
    geometry = tree.nodes.new("ShaderNodeNewGeometry")
    tree.links.new(geometry.outputs["Incoming"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], emission(lamp).inputs["Color"])


@AGAINST_NODES
@pytest.mark.parametrize("light", [light_with_beam, light_with_texture])
@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA"])
def test_glints_of_a_lamp_with_nodes_are_those_of_blenders_nodes(stress_record, light, kind):
    def build(scene, material):
        add_square(scene, material)
        light(scene, kind)

    outcome = compare(stress_record, build, nodes=(2048, 2), osl_nodes=True, case=f"{light.__name__} {kind}")
    assert outcome.report["hints"] == [kind.title()]
