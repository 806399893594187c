"""Lights and glints of another file: linked, instanced, overridden; what follows them here, and what a farm renders."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Vector

from glint_addon import create_glint_material, prepare_scene
from glint_addon.materials.find import glint_groups
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.stress_marks import thinned
from tests.helpers.stress_stage import add_lamp, add_square
from tests.lights.test_emitters import add_bulb, slot_values

SIZE = (16, 16)  # pixels
SPP = 2
LAST = 3  # frame
# Blender keeps matrices and sockets in 32-bit floats; places here are metres.
PLACE_TOLERANCE = 1e-5
LIBRARY = "//../assets/library.blend"
LAMPS = ("Area", "Bulb", "Point")


def make_library(folder, *, prepared=False):
    """Save assets/library.blend with the collections Lamps and Set, which holds the square "Glitter"."""
    scene = cycles.empty_scene(size=SIZE, spp=SPP)
    (folder / "assets").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "assets" / "library.blend"))
    image = bpy.data.images.load(str(write_flake_map(folder / "assets" / "flakes.png", 64)))
    image.filepath = "//flakes.png"
    square = add_square(scene, create_glint_material("Glitter", image, roughness=0.2))
    square.name = "Glitter"
    lamps = [add_lamp(scene, location=(0.2, 1.2, 1.2), shadow_soft_size=0.02),
             add_lamp(scene, "AREA", location=(-0.4, 1.1, 1.3), size=0.05),
             add_bulb(scene, 0.03, (0, 1.4, 1.0), strength=2000.0)]
    for name, things in (("Lamps", lamps), ("Set", [square])):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        for thing in things:
            collection.objects.link(thing)
            scene.collection.objects.unlink(thing)
    if prepared:
        assert prepare_scene(scene)["hints"] == list(LAMPS)
    bpy.ops.wm.save_mainfile()


def make_shot(folder, *, own_glints=True):
    """Save shots/scene.blend, with a square of its own or only a camera; returns its scene and folder."""
    cycles.empty_scene(size=SIZE, spp=SPP)
    shots = folder / "shots"
    shots.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(shots / "scene.blend"))
    scene = bpy.context.scene
    scene.frame_end = LAST
    if own_glints:
        add_square(scene, create_glint_material("Own", write_flake_map(shots / "own.png", 64), roughness=0.2))
    else:
        cycles.add_camera(scene, (0, -2, 2), angle=0.6)
    return SimpleNamespace(scene=scene, folder=shots)


def linked(kind, name):
    """A data-block of the library, linked by a relative path."""
    library = bpy.path.abspath(LIBRARY)
    with bpy.data.libraries.load(library, link=True, relative=True) as (_, wanted):
        setattr(wanted, kind, [name])
    block = getattr(wanted, kind)[0]
    assert block.library.filepath == LIBRARY
    return block


def keyed(thing):
    """Move an object that can be edited here, from frame to frame."""
    for frame, x in ((1, 0.1), (LAST, -0.3)):
        thing.location.x = x
        thing.keyframe_insert("location", frame=frame)


def instanced(scene, name):
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", linked("collections", name)
    scene.collection.objects.link(empty)
    return empty


def collection(scene):
    scene.collection.children.link(linked("collections", "Lamps"))
    return {name: scene.objects[name] for name in LAMPS}


def instance(scene):
    empty = instanced(scene, "Lamps")
    keyed(empty)
    return {f"{name} in Empty": (empty, empty.instance_collection.objects[name]) for name in LAMPS}


def override(scene):
    lamps = linked("collections", "Lamps")
    own = lamps.override_hierarchy_create(scene, scene.view_layers[0])
    if lamps.name in scene.collection.children and scene.collection.children[lamps.name] == lamps:
        scene.collection.children.unlink(lamps)
    keyed(own.objects["Point"])
    assert all(thing.override_library for thing in own.objects)
    return {name: own.objects[name] for name in LAMPS}


def light_data(scene):
    lamp = bpy.data.objects.new("Local", linked("lights", "Point"))
    lamp.location = (0.2, 1.2, 1.2)
    scene.collection.objects.link(lamp)
    keyed(lamp)
    return {"Local": lamp}


def overridden_light_data(scene):
    found = light_data(scene)
    lamp = found["Local"]
    lamp.data = lamp.data.override_create()
    lamp.data.energy = 90.0
    return found


def place_of(thing):
    """Where an object is, or one that an empty shows."""
    if isinstance(thing, tuple):
        return thing[0].matrix_world @ thing[1].matrix_world.translation
    return thing.matrix_world.translation


FARM = "two renders, one of them on the farm"
WAYS = [collection, instance, override, light_data, overridden_light_data]


@pytest.mark.parametrize("bring", thinned(WAYS, [instance, override, overridden_light_data], FARM))
def test_lights_of_a_library_are_followed_here_and_on_a_farm(farm, bring, tmp_path):
    make_library(tmp_path)
    shot = make_shot(tmp_path)
    lights = bring(shot.scene)
    report = prepare_scene(shot.scene)
    assert report["hints"] == sorted(lights) and not report["warnings"]

    shot.scene.frame_set(LAST)
    places = [Vector(slot_values(slot)[0]) for slot in range(1, len(lights) + 1)]
    for place, name in zip(places, report["hints"], strict=True):
        assert (place - place_of(lights[name])).length < PLACE_TOLERANCE
    picture = cycles.rendered(shot.scene)[..., :3]
    # The file is saved at another frame, where a light is elsewhere: the farm has to follow it.
    shot.scene.frame_set(1)
    assert any(Vector(slot_values(slot)[0]) != place for slot, place in enumerate(places, 1)) or bring is collection
    np.testing.assert_array_equal(farm.rendered(shot.folder, LAST), picture)
    assert picture.max() > 0


def test_lights_of_a_library_that_is_lost_are_no_error(tmp_path):
    make_library(tmp_path)
    shot = make_shot(tmp_path)
    instance(shot.scene)
    light_data(shot.scene)
    prepare_scene(shot.scene)
    bpy.ops.wm.save_mainfile()
    (tmp_path / "assets" / "library.blend").unlink()
    bpy.ops.wm.open_mainfile(filepath=str(shot.folder / "scene.blend"))
    # Blender keeps the lamp, with a plain light in the place of the lost one.
    assert prepare_scene(bpy.context.scene)["hints"] == ["Local"]


def square_in_an_instance(scene):
    instanced(scene, "Set")


def material(scene):
    cycles.add_plane(scene, 4.0, material=linked("materials", "Glitter"), repeats=4.0)


def overridden_material(scene):
    cycles.add_plane(scene, 4.0, material=linked("materials", "Glitter").override_create(), repeats=4.0)


def overridden_square(scene):
    own = linked("objects", "Glitter").override_create()
    scene.collection.objects.link(own)


BRINGS = [square_in_an_instance, material, overridden_material, overridden_square]


@pytest.mark.parametrize("bring", thinned(BRINGS, [square_in_an_instance, overridden_material], FARM))
def test_glints_of_a_library_find_the_lights_of_this_scene(farm, bring, tmp_path):
    """Nothing of the library changes, and its tables are beside both files: Blender looks for them beside this one."""
    make_library(tmp_path, prepared=True)
    shot = make_shot(tmp_path, own_glints=False)
    shot.scene.collection.children.link(linked("collections", "Lamps"))
    bring(shot.scene)
    report = prepare_scene(shot.scene)
    assert report["hints"] == list(LAMPS) and report["warnings"] == []
    tables = {file.name for file in (tmp_path / "assets" / "glint_tables").iterdir()}
    assert report["osl"] and {file.name for file in (shot.folder / "glint_tables").iterdir()} == tables
    for slot, name in enumerate(LAMPS, 1):
        place = Vector(slot_values(slot, of_library=True)[0])
        assert (place - place_of(shot.scene.objects[name])).length < PLACE_TOLERANCE
    picture = cycles.rendered(shot.scene)[..., :3]
    np.testing.assert_array_equal(farm.rendered(shot.folder), picture)
    assert picture.max() > 0


@pytest.mark.parametrize("bring", BRINGS)
def test_one_sentence_says_that_glints_of_a_library_were_not_prepared_there(bring, tmp_path):
    make_library(tmp_path)
    shot = make_shot(tmp_path, own_glints=False)
    shot.scene.collection.children.link(linked("collections", "Lamps"))
    bring(shot.scene)
    [warning] = prepare_scene(shot.scene)["warnings"]
    assert warning.startswith(f'The glints of "Glitter" are linked from {LIBRARY}, where they were not prepared')
    assert warning.endswith("make them local with Object > Relations > Make Local > All.")


@pytest.mark.parametrize("bring", thinned(BRINGS, [square_in_an_instance, overridden_square], FARM))
def test_what_the_sentence_tells_to_do_helps(farm, bring, tmp_path):
    make_library(tmp_path)
    shot = make_shot(tmp_path, own_glints=False)
    shot.scene.collection.children.link(linked("collections", "Lamps"))
    bring(shot.scene)
    assert len(prepare_scene(shot.scene)["warnings"]) == 1
    bpy.ops.object.make_local(type="ALL")
    report = prepare_scene(shot.scene)
    assert report["hints"] == list(LAMPS) and not report["warnings"] and len(report["baked"]) > 0
    shown = {slot.material for thing in bpy.data.objects for slot in thing.material_slots}
    assert all(group.library is None for each in shown if each for group in glint_groups(each))
    picture = cycles.rendered(shot.scene)[..., :3]
    np.testing.assert_array_equal(farm.rendered(shot.folder), picture)


def test_own_glints_are_prepared_beside_those_of_a_library(tmp_path):
    make_library(tmp_path)
    shot = make_shot(tmp_path)
    shot.scene.collection.children.link(linked("collections", "Lamps"))
    guest = instanced(shot.scene, "Set")
    guest.location.z = -1.0
    report = prepare_scene(shot.scene)
    assert report["hints_by_material"] == {"Own": list(LAMPS), "Glitter": list(LAMPS)}
    assert len(report["warnings"]) == 1 and '"Glitter"' in report["warnings"][0]
