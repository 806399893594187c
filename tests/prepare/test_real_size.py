"""The sizes of UV maps that objects keep for a Glint Scale: measured at each preparation, with warnings."""

import bpy
import numpy as np
import pytest

from glint_addon import changes_since_prepared, create_glint_material, prepare_scene
from glint_addon.errors import GlintError
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.map_binding import map_of
from glint_addon.nodes.scale import metres_property, scale_nodes
from glint_addon.prepare import scene as preparing
from tests.helpers import cycles
from tests.helpers.extension import write_flake_map

METRES = metres_property("")


@pytest.fixture
def material(scene, tmp_path):
    """A material of repeats of a tenth of a metre, in a saved file with a sun and a camera."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 4), width=2.0)
    flakes = write_flake_map(tmp_path / "flakes.png")
    return create_glint_material("Sparkle", flakes, interpolation="CLOSEST", scale=0.1)


def square(scene, material, name="Square", **options):
    plane = cycles.add_plane(scene, material=material, **options)
    plane.name = name
    return plane


def set_uvs(thing, uvs):
    thing.data.uv_layers[0].uv.foreach_set("vector", np.float32(uvs).ravel())
    thing.data.update()


def of_sizes(sentences):
    """Those of the sentences that speak of UVs."""
    return [sentence for sentence in sentences if "UV" in sentence]


def uneven(scene, material):
    """Two squares of a metre in one mesh, one with three times the UVs of the other."""
    low = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    corner = [(0, 0), (1, 0), (1, 1), (0, 1)]
    uvs = [*corner, *[(3 * u, 3 * v) for u, v in corner]]
    thing = cycles.add_mesh(scene, [*low, *[(x - 1, y, z) for x, y, z in low]], [(0, 1, 2, 3), (4, 5, 6, 7)], uvs=uvs,
                            material=material)
    thing.name = "Uneven"
    return thing


def test_every_object_that_shows_the_material_keeps_the_size_of_its_uvs(scene, material):
    small, large = square(scene, material, size=1.0), square(scene, material, "Large", size=4.0, repeats=2.0)
    large.scale = (3.0, 3.0, 3.0)  # belongs to the object, not to what it keeps
    plain = square(scene, cycles.emission_material()[0], "Plain")
    assert of_sizes(prepare_scene(scene)["warnings"]) == []
    assert (small[METRES], large[METRES]) == pytest.approx((1.0, 2.0)) and METRES not in plain


def test_materials_without_a_scale_leave_objects_as_they_are(scene, material, tmp_path):
    thing = square(scene, create_glint_material("Plain", tmp_path / "flakes.png"))
    prepare_scene(scene)
    assert METRES not in thing


def test_other_uvs_and_shapes_are_told_until_they_are_measured_again_and_scales_are_not(scene, material):
    thing = square(scene, material, size=1.0)
    prepare_scene(scene)
    assert changes_since_prepared(scene) == []
    thing.scale = (5.0, 5.0, 5.0)
    bpy.context.view_layer.update()
    assert changes_since_prepared(scene) == []
    set_uvs(thing, [(0, 0), (4, 0), (4, 4), (0, 4)])
    bpy.context.view_layer.update()
    assert changes_since_prepared(scene) == [
        'The UVs or the shape of "Square" changed: one unit of UV covers 1.25 m now, 5 m before.']
    prepare_scene(scene)
    assert changes_since_prepared(scene) == [] and thing[METRES] == pytest.approx(0.25)
    thing.scale = (5.0, 20.0, 5.0)  # the area in the scene grows by 4, the mean scale by less
    bpy.context.view_layer.update()
    assert "UVs or the shape" in changes_since_prepared(scene)[0]
    prepare_scene(scene)
    mean = np.sqrt((5.0**2 + 20.0**2 + 5.0**2) / 3)
    assert thing[METRES] * mean == pytest.approx(0.25 * 10.0)


def test_the_scale_of_repeats_can_be_set_without_preparing(scene, material):
    square(scene, material)
    prepare_scene(scene)
    scale_nodes(material)[0].inputs["Scale"].default_value = 0.2
    assert changes_since_prepared(scene) == []


def test_uvs_that_vary_by_more_than_two_are_warned_about_and_less_is_not(scene, material):
    uneven(scene, material)
    cycles.add_sphere(scene, material=material)
    assert of_sizes(prepare_scene(scene)["warnings"]) == [
        'UVs of "Uneven" vary in its UV map: glints are 3.0 times larger in some places than in others; unwrap it '
        "evenly (UV > Average Islands Scale) and prepare again."]


def test_uvs_that_vary_are_no_matter_without_a_scale(scene, material, tmp_path):
    uneven(scene, create_glint_material("Plain", tmp_path / "flakes.png"))
    assert of_sizes(prepare_scene(scene)["warnings"]) == []


def test_faces_and_objects_without_area_in_the_uv_map_are_warned_about(scene, material):
    collapsed = uneven(scene, material)
    uvs = np.zeros((8, 2))
    uvs[4:] = [(0, 0), (1, 0), (1, 1), (0, 1)]
    set_uvs(collapsed, uvs)
    nothing = square(scene, material, "Nothing")
    nothing[METRES] = 7.0  # of UVs that it had
    set_uvs(nothing, np.zeros((4, 2)))
    first, second = of_sizes(prepare_scene(scene)["warnings"])
    assert first.startswith('A tenth of "Uneven" or more has no area in its UV map')
    assert second.startswith('Scale cannot measure "Nothing", which has no face with an area in its UV map')
    assert METRES not in nothing and collapsed[METRES] == pytest.approx(1.0)


def test_modifiers_and_text_are_measured(scene, material):
    thing = square(scene, material, size=1.0)
    thing.modifiers.new("Warp", "UV_WARP").scale = (2.0, 2.0)
    data = bpy.data.curves.new("Text", "FONT")
    data.body, data.extrude = "Glint", 0.1
    data.materials.append(material)
    text = bpy.data.objects.new("Text", data)
    scene.collection.objects.link(text)
    prepare_scene(scene)
    assert thing[METRES] == pytest.approx(0.5) and text[METRES] > 0.0


def test_an_error_leaves_objects_as_they_were(scene, material, monkeypatch):
    thing = square(scene, material)

    def fail(*_, **__):
        raise GlintError("The disk is full: make room.")
        yield

    monkeypatch.setattr(preparing, "bake_plan", fail)
    with pytest.raises(GlintError):
        prepare_scene(scene)
    assert METRES not in thing


# --- other files ---


@pytest.fixture
def library(scene, material, tmp_path):
    """A file with a square whose unit of UV is 2 metres; its objects were not prepared."""
    square(scene, material, size=2.0)
    map_of(glint_groups(material)[0]).pack()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    return tmp_path / "library.blend"


def with_linked(library, **options):
    """A new file that shows the library's square; the scene and the square."""
    scene = cycles.empty_scene()
    bpy.ops.wm.save_as_mainfile(filepath=str(library.with_name("user.blend")))
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.objects = ["Square"]
    (thing,) = wanted.objects
    cycles.add_sun(scene, (0.1, 0.2, 1), angle=0.01)
    cycles.add_camera(scene, (0, 0, 4), width=2.0)
    return scene, thing


def test_linked_objects_that_were_not_measured_are_warned_about_and_left_alone(library):
    scene, thing = with_linked(library)
    scene.collection.objects.link(thing)
    (sentence,) = of_sizes(prepare_scene(scene)["warnings"])
    assert sentence.startswith(f'"Square" is linked from {thing.library.filepath}, where its UVs were not measured')
    assert "its glints are 2 times as large as Scale says; prepare it in that file" in sentence
    assert METRES not in thing
    # As the sentence says: in that file.
    bpy.ops.wm.open_mainfile(filepath=str(library))
    prepare_scene(bpy.context.scene)
    bpy.ops.wm.save_mainfile()
    scene, thing = with_linked(library)
    scene.collection.objects.link(thing)
    assert of_sizes(prepare_scene(scene)["warnings"]) == []
    assert thing[METRES] == pytest.approx(2.0)


def test_overrides_and_own_objects_with_a_linked_material_are_measured_here(library):
    scene, thing = with_linked(library)
    override = thing.override_create()
    scene.collection.objects.link(override)
    own = cycles.add_plane(scene, 3.0, material=thing.active_material)
    (sentence,) = of_sizes(prepare_scene(scene)["warnings"])
    assert (override[METRES], own[METRES]) == pytest.approx((2.0, 3.0))
    # Blender keeps no new properties of overrides.
    assert sentence.startswith(f'"Square" overrides an object of {thing.library.filepath}, where its UVs were not')
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert METRES not in bpy.data.objects[("Square", None)]
    assert of_sizes(changes_since_prepared(bpy.context.scene)) == [
        'The UVs of "Square" were not measured for its Scale.']


def test_an_override_of_an_object_that_was_measured_keeps_a_size_of_its_own(library):
    prepare_scene(bpy.context.scene)
    bpy.ops.wm.save_mainfile()
    scene, thing = with_linked(library)
    override = thing.override_create()
    scene.collection.objects.link(override)
    override.modifiers.new("Warp", "UV_WARP").scale = (4.0, 4.0)
    assert of_sizes(prepare_scene(scene)["warnings"]) == []
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert bpy.data.objects[("Square", None)][METRES] == pytest.approx(0.5)
