"""Lights belong to their scene: materials bring none along, and renamed, copied and linked scenes find their own."""

import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from glint_addon import create_glint_material, prepare_scene
from glint_addon.errors import SceneError
from glint_addon.materials.find import glint_groups
from glint_addon.nodes import glint_lights, places
from glint_addon.nodes.driven import Keyed, number_at, write_number
from glint_addon.nodes.glint_bsdf import lights_of
from glint_addon.nodes.scene_lights import HOLDER, followed_objects, has_set, lights_entry, own_holder
from glint_addon.prepare.changes import changes_since_prepared
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.stress_stage import add_lamp, add_square

ROOT = Path(__file__).resolve().parents[2]
SIZE = (12, 12)  # pixels
SPP = 1
TOLERANCE = 1e-5  # metres: Blender keeps places in 32-bit floats
PLACE = (0.0, 1.2, 1.2)  # of a lamp
# What a material must not bring along.
KINDS = ("objects", "lights", "cameras", "scenes", "collections", "worlds", "meshes", "actions", "armatures", "curves",
         "lightprobes", "linestyles")


@pytest.fixture
def flake_map(scene, tmp_path):
    cycles.set_up_cycles(scene, size=SIZE, spp=SPP)
    return write_flake_map(tmp_path / "flakes.png")


def stage(scene, flake_map, name="Glitter", location=PLACE):
    """A square of a material and a lamp for a scene; returns both."""
    square = add_square(scene, create_glint_material(name, flake_map, roughness=0.2))
    return square, add_lamp(scene, location=location, name=f"Lamp of {name}", shadow_soft_size=0.02)


def another_scene(name="Other"):
    other = bpy.data.scenes.new(name)
    cycles.set_up_cycles(other, size=SIZE, spp=SPP)
    return other


def lights_found(scene, material=None) -> list[tuple]:
    """Places of the lights that a material finds while `scene` is rendered, as Blender evaluates them."""
    material = material or next(slot.material for thing in scene.objects for slot in thing.material_slots)
    layer = scene.view_layers[0]
    layer.update()
    found = []
    for group in glint_groups(material):
        nodes = lights_of(group).evaluated_get(layer.depsgraph).nodes
        for slot in range(1, 9):
            light, shape = (nodes[f"{name} {slot}"].inputs for name in ("Light", "Shape"))
            if shape["X"].default_value:
                found.append(tuple(light[axis].default_value for axis in "XYZ"))
    return found


def assert_finds(scene, *places, material=None):
    found = lights_found(scene, material)
    assert len(found) == len(places)
    np.testing.assert_allclose(sorted(found), sorted(places), atol=TOLERANCE)


# --- a material does not carry its scene ---


@pytest.fixture
def library(flake_map, tmp_path):
    """A saved file with a prepared material, an asset, in a scene full of what it must not bring along."""
    scene = bpy.context.scene
    square, lamp = stage(scene, flake_map)
    scene.world = bpy.data.worlds.new("World")
    parent = cycles.add_sphere(scene, 0.1, segments=8, rings=4)
    parent.location.z = 5.0
    lamp.parent = parent
    parent.keyframe_insert("location", frame=1)
    lamps = bpy.data.collections.new("Lamps")
    scene.collection.children.link(lamps)
    lamps.objects.link(lamp)
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", lamps
    empty.location.x = 1.0
    scene.collection.objects.link(empty)
    report = prepare_scene(scene)
    assert len(report["hints"]) == 2
    square.active_material.asset_mark()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    return tmp_path / "library.blend"


def appended(library, **options):
    bpy.ops.wm.append(directory=f"{library}/Material/", filename="Glitter", **options)


def loaded(library, **options):
    with bpy.data.libraries.load(str(library), **options) as (_, wanted):
        wanted.materials = ["Glitter"]


BRINGS = {
    "appended": lambda library: appended(library),
    "dragged": lambda library: appended(library, do_reuse_local_id=True, clear_asset_data=True, use_recursive=True),
    "dragged twice": lambda library: [appended(library, do_reuse_local_id=True) for _ in range(2)],
    "not recursive": lambda library: appended(library, use_recursive=False),
    "loaded": lambda library: loaded(library, link=False),
    "asset": lambda library: loaded(library, link=False, assets_only=True, reuse_local_id=True, clear_asset_data=True),
    "linked": lambda library: loaded(library, link=True),
    "packed": lambda library: loaded(library, link=True, pack=True),
}


@pytest.mark.parametrize("bring", BRINGS.values(), ids=BRINGS.keys())
def test_a_material_brings_nothing_of_its_scene_along(library, bring):
    scene = cycles.empty_scene(size=SIZE, spp=SPP)
    square, lamp = add_square(scene, None), add_lamp(scene, location=(0.5, 1, 1), shadow_soft_size=0.02)
    before = {kind: set(getattr(bpy.data, kind)) for kind in KINDS}
    bring(library)
    assert {kind: set(getattr(bpy.data, kind)) for kind in KINDS} == before
    square.data.materials.append(bpy.data.materials["Glitter"])
    assert not any(".Glint Lights of" in group.name for group in bpy.data.node_groups)
    assert_finds(scene)  # nothing: a light of the other file would be noise here
    assert prepare_scene(scene)["hints"] == ["Point"]
    assert_finds(scene, lamp.location)


def test_a_material_made_with_the_lights_of_a_scene_can_be_saved_alone(library, tmp_path):
    bpy.ops.wm.open_mainfile(filepath=str(library))
    bpy.data.libraries.write(str(tmp_path / "alone.blend"), {bpy.data.materials["Glitter"]})
    with bpy.data.libraries.load(str(tmp_path / "alone.blend")) as (found, _):
        assert found.materials == ["Glitter"]
        assert all(getattr(found, kind, []) == [] for kind in KINDS)


def test_in_a_prepared_file_an_appended_material_looks_for_the_lights_there(library, flake_map):
    scene = cycles.empty_scene(size=SIZE, spp=SPP)
    square, lamp = stage(scene, flake_map, "Own", (0.3, 1.1, 1.0))
    prepare_scene(scene)
    appended(library)
    square.data.materials.append(bpy.data.materials["Glitter"])
    for _ in range(2):
        assert_finds(scene, lamp.location, material=bpy.data.materials["Glitter"])
        assert prepare_scene(scene)["hints_by_material"] == {"Own": [lamp.name], "Glitter": [lamp.name]}


# --- which scene ---


def test_of_two_prepared_scenes_one_is_renamed_and_the_other_prepared_again(scene, flake_map):
    other = another_scene()
    _, lamp = stage(scene, flake_map, "One")
    _, second = stage(other, flake_map, "Two", (0.4, 1.0, 1.5))
    for each in (scene, other):
        prepare_scene(each)
    scene.name = "Renamed"
    prepare_scene(other)
    other.name, scene.name = "Scene", "Other"
    for each in (other, scene, other):
        prepare_scene(each)
        assert_finds(scene, lamp.location)
        assert_finds(other, second.location)
        assert changes_since_prepared(scene) == changes_since_prepared(other) == []


def test_a_material_in_two_scenes_finds_the_lights_of_each_by_whatever_order(scene, flake_map):
    square, lamp = stage(scene, flake_map)
    other = another_scene()
    other.collection.objects.link(square)
    other.collection.objects.link(scene.camera)
    other.camera = scene.camera
    second = add_lamp(other, location=(0.4, 1.0, 1.5), name="Second", shadow_soft_size=0.02)
    for each in (scene, other, scene):
        prepare_scene(each)
    assert_finds(scene, lamp.location)
    assert_finds(other, second.location)
    second.location.x = -0.4
    assert_finds(other, second.location)
    assert_finds(scene, lamp.location)


def full_copy(scene):
    bpy.context.window.scene = scene
    bpy.ops.scene.new(type="FULL_COPY")
    return bpy.context.window.scene


def test_a_full_copy_says_that_it_looks_for_the_lights_of_the_original_until_it_is_prepared(farm, flake_map, tmp_path):
    scene = bpy.context.scene
    _, lamp = stage(scene, flake_map)
    prepare_scene(scene)
    copy = full_copy(scene)
    [second] = [thing for thing in copy.objects if thing.type == "LIGHT"]
    assert second != lamp
    words = " ".join(changes_since_prepared(copy))
    assert f'Glints look for "{lamp.name}" of scene "{scene.name}".' in words
    assert f'Light "{second.name}" was added.' in words and f'Light "{lamp.name}" is gone.' in words
    assert changes_since_prepared(scene) == []

    prepare_scene(copy)
    assert copy[HOLDER] != scene[HOLDER] and followed_objects(copy) == {second}
    second.location = (0.3, 1.0, 1.3)
    assert_finds(copy, second.location)
    assert_finds(scene, lamp.location)
    lamp.location.x = -0.5
    assert_finds(copy, second.location)
    assert_finds(scene, lamp.location)
    assert changes_since_prepared(scene) == changes_since_prepared(copy) == []
    picture = cycles.rendered(copy)[..., :3]
    np.testing.assert_array_equal(farm.rendered(tmp_path), picture)
    assert picture.max() > 0


def test_the_original_of_a_full_copy_can_be_prepared_first(flake_map):
    scene = bpy.context.scene
    _, lamp = stage(scene, flake_map)
    prepare_scene(scene)
    copy = full_copy(scene)
    prepare_scene(scene)
    assert_finds(scene, lamp.location)
    assert followed_objects(copy) == {lamp} and changes_since_prepared(copy) != []
    prepare_scene(copy)
    [second] = [thing for thing in copy.objects if thing.type == "LIGHT"]
    second.location.y = 1.0
    assert_finds(copy, second.location)
    assert_finds(scene, lamp.location)


def linked_copy(scene):
    bpy.context.window.scene = scene
    bpy.ops.scene.new(type="LINK_COPY")
    return bpy.context.window.scene


@pytest.mark.parametrize("copied", [linked_copy, lambda scene: scene.copy()], ids=["linked copy", "copy"])
def test_a_copy_that_shares_its_lamps_is_prepared_and_goes_its_own_way(flake_map, copied):
    scene = bpy.context.scene
    _, lamp = stage(scene, flake_map)
    prepare_scene(scene)
    copy = copied(scene)
    assert_finds(copy, lamp.location)
    assert changes_since_prepared(copy) == changes_since_prepared(scene) == []
    extra = add_lamp(copy, location=(0.6, 1.2, 1.2), name="Extra", shadow_soft_size=0.02)
    assert changes_since_prepared(copy) == ['Light "Extra" was added.']
    prepare_scene(copy)
    assert_finds(copy, lamp.location, extra.location)
    assert_finds(scene, lamp.location)
    assert changes_since_prepared(scene) == []


def test_a_copy_that_tells_materials_apart_leaves_the_original_its_lights(flake_map):
    """There both materials read one set; the original, whose data-block is shared until now, needs two from then on."""
    scene = bpy.context.scene
    squares = [stage(scene, flake_map, name)[0] for name in ("One", "Two")]
    lamps = [thing for thing in scene.objects if thing.type == "LIGHT"]
    lamps[1].location.x = 0.5
    prepare_scene(scene)
    copy = scene.copy()
    far = squares[1].copy()
    copy.collection.objects.link(far)
    copy.collection.objects.unlink(squares[1])
    far.location.x = 60.0
    copy.camera = scene.camera.copy()
    copy.camera.location, copy.camera.data = (30, -1, 90), scene.camera.data.copy()
    copy.camera.rotation_euler, copy.camera.data.angle = (0, 0, 0), 1.5
    copy.collection.objects.link(copy.camera)
    for number in range(8):
        add_lamp(copy, location=(60 + 0.1 * number, 0.5, 3), name=f"Far {number}", power=100.0)
    report = prepare_scene(copy)
    assert report["hints_by_material"]["One"] != report["hints_by_material"]["Two"]
    for material in ("One", "Two"):
        assert_finds(scene, *(lamp.location for lamp in lamps), material=bpy.data.materials[material])
    assert changes_since_prepared(scene) == changes_since_prepared(copy) == []


def test_a_scene_that_is_deleted_leaves_the_others_theirs(flake_map):
    scene = bpy.context.scene
    _, lamp = stage(scene, flake_map)
    prepare_scene(scene)
    copy = full_copy(scene)
    prepare_scene(copy)
    holder = copy[HOLDER]
    bpy.data.scenes.remove(copy)
    assert holder.users == 0
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    hidden = {group.name for group in bpy.data.node_groups if group.name.startswith(".")}
    assert hidden == {*places.HIDDEN, scene[HOLDER].name}
    assert_finds(scene, lamp.location)
    prepare_scene(scene)
    assert_finds(scene, lamp.location)


def test_a_scene_whose_data_block_was_deleted_gets_another(flake_map):
    scene = bpy.context.scene
    _, lamp = stage(scene, flake_map)
    prepare_scene(scene)
    bpy.data.node_groups.remove(scene[HOLDER])
    assert_finds(scene)
    prepare_scene(scene)
    assert_finds(scene, lamp.location)


def test_a_linked_scene_finds_the_lights_of_its_file(flake_map, tmp_path):
    scene = bpy.context.scene
    _, lamp = stage(scene, flake_map)
    place = tuple(lamp.location)
    prepare_scene(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    cycles.empty_scene(size=SIZE, spp=SPP)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.scenes = ["Scene"]
    [linked] = wanted.scenes
    assert linked.library is not None
    with pytest.raises(SceneError, match="is linked from .*: prepare it in that file"):
        prepare_scene(linked)
    bpy.context.window.scene = linked
    assert changes_since_prepared(linked) == []
    assert_finds(linked, place)
    # And when the file is opened again, though nobody changed it here.
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert_finds(next(scene for scene in bpy.data.scenes if scene.library), place)


# --- numbers ---


def test_keyed_numbers_need_no_action_and_are_exact_at_every_frame(scene, flake_map):
    square, _ = stage(scene, flake_map)
    prepare_scene(scene)
    keyed = Keyed((1, 3, 4), (0.5, 2.5, -1.0))
    write_number(lights_entry(scene, 1, 1, 0), keyed)
    assert number_at(lights_entry(scene, 1, 1, 0)) == keyed
    assert scene.animation_data is None or scene.animation_data.action is None
    assert scene[HOLDER].animation_data.action is None and not bpy.data.actions
    for frame, value in ((0, 0.5), (1, 0.5), (2, 1.5), (3, 2.5), (4, -1.0), (9, -1.0)):
        scene.frame_set(frame)
        assert lights_found(scene, square.active_material)[0][0] == pytest.approx(value, abs=TOLERANCE)


def test_a_set_that_a_scene_has_not_reads_as_no_light(scene, flake_map):
    stage(scene, flake_map)
    group = glint_lights.build_set(3)
    other = another_scene()
    own_holder(scene, 3)
    assert has_set(scene, 3) and not has_set(other, 3) and not has_set(scene, 1)
    layer = scene.view_layers[0]
    layer.update()
    values = [socket.default_value for node in group.evaluated_get(layer.depsgraph).nodes for socket in node.inputs
              if node.bl_idname == "ShaderNodeCombineXYZ"]
    assert set(values) == {0.0} and len(values) == 8 * 9


# A lamp rides on an object that the scene's frame and samples drive: the scene must not wait for its lights.
RIDE = """
import sys
import bpy
from pathlib import Path
from glint_addon import create_glint_material, prepare_scene
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map
from tests.helpers.stress_stage import add_lamp, add_square
from tests.lights.test_scene_lights import lights_found

scene = cycles.empty_scene(size=(4, 4), spp=3)
add_square(scene, create_glint_material("Glitter", write_flake_map(Path(sys.argv[1]) / "flakes.png"), roughness=0.2))
mover = bpy.data.objects.new("Mover", None)
scene.collection.objects.link(mover)
for axis, path in ((0, "frame_current"), (2, "cycles.samples")):
    driver = mover.driver_add("location", axis).driver
    driver.type = "SCRIPTED"
    variable = driver.variables.new()
    variable.name = "v"
    variable.targets[0].id_type, variable.targets[0].id = "SCENE", scene
    variable.targets[0].data_path = path
    driver.expression = "v / 10"
lamp = add_lamp(scene, location=(0, 1, 1), shadow_soft_size=0.02)
lamp.parent = mover
scene.frame_end = 4
prepare_scene(scene)
if sys.argv[2] == "cycle":
    for thing, other in ((mover, lamp), (lamp, mover)):
        thing.constraints.new("COPY_LOCATION").target = other
for frame in (1, 2, 4, 3):
    scene.frame_set(frame)
    print("found", frame, *lights_found(scene)[0])
"""


@pytest.mark.parametrize("kind", ["free", "cycle"])
def test_objects_that_the_scene_drives_may_carry_lamps(tmp_path, kind):
    result = subprocess.run([sys.executable, "-c", RIDE, str(tmp_path), kind], cwd=ROOT, capture_output=True,
                            text=True, check=False)
    assert result.returncode == 0, result.stderr
    words = (result.stdout + result.stderr).lower()
    assert ("dependency cycle" in words) == (kind == "cycle")
    found = [list(map(float, line.split()[1:])) for line in result.stdout.splitlines() if line.startswith("found")]
    if kind == "free":
        np.testing.assert_allclose(found, [(frame, frame / 10, 1, 1.3) for frame in (1, 2, 4, 3)], atol=TOLERANCE)
