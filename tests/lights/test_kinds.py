"""The table of light kinds against Blender's own kinds, their drivers, and what they say of themselves."""

import math

import bpy
import numpy as np
import pytest

from glint_addon.lights.irradiance import irradiances
from glint_addon.lights.kinds import KINDS, kind_of, may_change_cone, may_change_power, may_change_size
from glint_addon.lights.lamps import lamp_hint, reason_to_skip
from glint_addon.nodes.glint_lights import HINT_COUNT, KIND_LOCAL, KIND_SUN
from tests.lights.test_lights import add_lamp, add_reader, connected, slot_values

SIZE_TOLERANCE = 1e-6  # of 32-bit floats
LEFT_OF_A_RIGHT_ANGLE = 1e-3  # radians; cones end at 3.14, a tangent's sign changes behind
SHAPES = ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE")
FORMS = [(kind, {}) for kind in KINDS if kind != "AREA"] + [("AREA", {"shape": shape}) for shape in SHAPES]
# A narrower spread makes an area light brighter, but a light whose spread alone is animated is ranked as it is now.
UNWATCHED = {"spread"}
BOX = np.full((1, 3), -0.5), np.full((1, 3), 0.5)


def add_form(scene, kind, settings, number=0):
    """A light of some kind below the origin's plane, stretched and turned, which shines upwards."""
    sizes = dict.fromkeys(KINDS[kind].sizes, 0.3)
    lamp = add_lamp(scene, f"Lamp {number}", kind, location=(0, 0, -5), **sizes, **settings)
    lamp.rotation_euler, lamp.scale = (3.2, 0.1, 0.4), (2, -3, 5)
    return lamp


def float_properties(light):
    return [entry.identifier for entry in light.bl_rna.properties if entry.type == "FLOAT" and not entry.is_array]


def changing(lamp, read):
    """Properties of the lamp's data that change what `read` says of the lamp."""
    found = set()
    for name in float_properties(lamp.data):
        kept, before = getattr(lamp.data, name), read(lamp)
        setattr(lamp.data, name, kept / 2 + 0.1)
        if read(lamp) != before:
            found.add(name)
        setattr(lamp.data, name, kept)
    return found


def test_the_table_holds_every_kind_of_light_that_blender_has():
    assert set(KINDS) == set(bpy.types.Light.bl_rna.properties["type"].enum_items.keys())
    assert set(SHAPES) == set(bpy.types.AreaLight.bl_rna.properties["shape"].enum_items.keys())


def test_every_kind_has_words_of_its_own():
    assert len({kind.words for kind in KINDS.values()} - {""}) == len(KINDS)


def test_what_is_read_of_each_kind_is_what_its_drivers_say(scene):
    assert len(FORMS) <= HINT_COUNT
    add_reader(scene)
    lamps = [add_form(scene, kind, settings, number) for number, (kind, settings) in enumerate(FORMS)]
    group = connected(scene)
    for factor in (0.3, 0.7, 1.1):
        for lamp in lamps:
            lamp.scale = (2 * factor, -3, 5)
            for name in (*kind_of(lamp).sizes, *kind_of(lamp).cones):
                setattr(lamp.data, name, factor / (2 if name == "size_y" else 1))
        bpy.context.view_layer.update()
        for slot, lamp in enumerate(lamps, 1):
            kind, (_, (code, size, cone)) = kind_of(lamp), slot_values(group, slot)
            assert code == (KIND_SUN if kind.is_distant else KIND_LOCAL), lamp.data.type
            assert size == pytest.approx(kind.size(lamp), rel=SIZE_TOLERANCE) and size > 0.0, lamp.data.type
            assert cone == pytest.approx(kind.cone(lamp) or 0.0, rel=SIZE_TOLERANCE), lamp.data.type
            assert (kind.driven_cone(lamp) is None) == (kind.cone(lamp) is None) == (not kind.cones), lamp.data.type


@pytest.mark.parametrize("degrees", [170.0, 179.95, 180.0])
def test_a_spot_that_is_half_of_all_directions_wide_has_a_cone_as_its_driver_says(scene, degrees):
    add_reader(scene)
    lamp = add_lamp(scene, "Spot", "SPOT", spot_size=math.radians(degrees))
    driven = slot_values(connected(scene), 1)[1][2]
    cone = kind_of(lamp).cone(lamp)
    assert cone == pytest.approx(math.radians(degrees / 2), abs=LEFT_OF_A_RIGHT_ANGLE)
    assert driven == pytest.approx(cone, rel=SIZE_TOLERANCE)


def test_a_spot_of_180_degrees_shines_on_what_is_beside_its_axis(scene):
    lamp = add_lamp(scene, "Spot", "SPOT", location=(4, 0, 3), spot_size=math.pi)
    scene.view_layers[0].update()
    assert irradiances(lamp, *BOX, 1.0)[0] > 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_names_the_properties_that_change_its_size_and_its_cone(scene, kind):
    sizes, cones = set(), set()
    for settings in (settings for name, settings in FORMS if name == kind):
        lamp = add_form(scene, kind, settings)
        scene.view_layers[0].update()
        sizes |= changing(lamp, KINDS[kind].size)
        cones |= changing(lamp, KINDS[kind].cone)
    assert sizes == set(KINDS[kind].sizes)
    assert cones == set(KINDS[kind].cones)


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_names_the_numbers_that_change_how_bright_it_is(scene, kind):
    """Beside its energy, before the light and at the rim of a spot's cone; the colour is no single number."""
    brightening, rim = set(), np.array([[2.6, 0.0, 0.0]])
    for settings in (settings for name, settings in FORMS if name == kind):
        cone = {"spot_size": 1.5} if kind == "SPOT" else {}
        lamp = add_form(scene, kind, settings | cone | {"use_temperature": True})
        scene.view_layers[0].update()
        for box in (BOX, (rim, rim)):
            brightening |= changing(lamp, lambda lamp, box=box: float(irradiances(lamp, *box, 10.0)[0]))
    assert brightening - UNWATCHED == set(KINDS[kind].powers) - {"color"}


@pytest.mark.parametrize("kind", KINDS)
def test_what_animates_a_property_that_a_kind_names_is_found(kind):
    parts = {"sizes": may_change_size, "cones": may_change_cone, "powers": may_change_power}
    for part, may_change in parts.items():
        for name in getattr(KINDS[kind], part):
            light = bpy.data.lights.new("Light", kind)
            assert not may_change(light)
            light.keyframe_insert(name, frame=1)
            assert may_change(light), name
    light = bpy.data.lights.new("Light", kind)
    light.keyframe_insert("energy", frame=1)
    assert not any(may_change(light) for may_change in parts.values())


@pytest.mark.parametrize(("kind", "settings"), FORMS)
@pytest.mark.parametrize("normalize", [True, False])
def test_each_kind_lights_what_is_before_it_and_less_so_from_afar(scene, kind, settings, normalize):
    lamp = add_form(scene, kind, settings | {"energy": 10.0, "normalize": normalize})
    scene.view_layers[0].update()
    near, far = (float(irradiances(lamp, BOX[0] + up, BOX[1] + up, 10.0)[0]) for up in ((0, 0, 0), (0, 0, 9)))
    assert near > 0.0
    assert far == near if KINDS[kind].is_distant else near / 20 < far < near / 2
    hint = lamp_hint("Lamp", lamp, BOX, object=lamp)
    assert (hint.power, hint.size) == (near, KINDS[kind].size(lamp))
    assert reason_to_skip(lamp) == ""


@pytest.mark.parametrize(("kind", "settings"), FORMS)
def test_only_area_lights_leave_dark_what_is_close_behind_them(scene, kind, settings):
    """The cone of a wide light alone does not tell: a box so close reaches into it."""
    lamp = add_form(scene, kind, settings)
    scene.view_layers[0].update()
    box = np.array([[-0.5, -0.5, -5.3]]), np.array([[0.5, 0.5, -5.2]])
    assert (irradiances(lamp, *box, 10.0)[0] == 0.0) == (kind == "AREA")


@pytest.mark.parametrize(("kind", "settings"), [form for form in FORMS if not KINDS[form[0]].is_distant])
def test_from_afar_a_light_looks_no_larger_than_the_ball_around_it(scene, kind, settings):
    lamp = add_form(scene, kind, settings)
    scene.view_layers[0].update()
    section = KINDS[kind].cross_section(lamp)
    assert 0.0 < section <= np.pi * KINDS[kind].size(lamp) ** 2 * (1 + SIZE_TOLERANCE)
    assert KINDS[kind].extent(lamp) in (pytest.approx(section), pytest.approx(4 * section))
