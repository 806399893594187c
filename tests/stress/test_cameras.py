"""Stress of cameras and film: lenses, panoramas, blur, borders, aspect, distance, against Blender's own nodes."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Vector

from tests.helpers import cycles
from tests.helpers.stress import FLOOR, compare
from tests.helpers.stress_marks import stress
from tests.helpers.stress_stage import MIDDLE, add_lamp, add_sky, add_square, sunny_square

pytestmark = stress("every camera against Blender's nodes", fast=[
    "stress/test_one_of_each.py::test_a_case_of_each_group_agrees_with_blenders_nodes",
])

CENTRE = Vector((0, 0, 0))


def seen_by(change, scene_of=sunny_square):
    """A build function: the sunny square after change(scene, camera)."""

    def build(scene, material):
        scene_of(scene, material)
        change(scene, scene.camera)

    return build


def lens(degrees):
    def change(scene, camera):
        # Blender holds lenses, not angles; its own range of angles is narrower.
        camera.data.lens = camera.data.sensor_width / 2 / math.tan(math.radians(degrees) / 2)

    return change


def panorama(kind, **settings):
    def change(scene, camera):
        camera.data.type, camera.data.panorama_type = "PANO", kind
        for name, value in settings.items():
            setattr(camera.data, name, value)
        camera.location = (0, -0.5, 0.5)

    return change


def orthographic(width):
    def change(scene, camera):
        camera.data.type, camera.data.ortho_scale = "ORTHO", width

    return change


def move_away(distance):
    """Look from `distance` metres at the same part of the square."""

    def change(scene, camera):
        lens(math.degrees(0.6) * math.sqrt(8) / distance)(scene, camera)
        camera.location = Vector((0, -1, 1)).normalized() * distance
        camera.data.clip_end = 10 * distance

    return change


def shift(scene, camera):
    camera.data.shift_x, camera.data.shift_y = 0.3, -0.2


def clip(scene, camera):
    """Cut the square before and behind the middle."""
    camera.data.clip_start, camera.data.clip_end = 2.5, 3.1


def scale_unevenly(scene, camera):
    camera.scale = (1.0, 2.0, 0.5)


def turn_a_parent(scene, camera):
    parent = bpy.data.objects.new("Parent", None)
    scene.collection.objects.link(parent)
    parent.rotation_euler = (0, 0, 0.3)
    camera.parent = parent


VIEWS = {
    "perspective of 0.001 degrees": lens(0.001),
    "perspective of 1 degree": lens(1),
    "perspective of 120 degrees": lens(120),
    "perspective of 170 degrees": lens(170),
    "orthographic": orthographic(1.5),
    "orthographic of a tenth of a millimetre": orthographic(1e-4),
    "equirectangular": panorama("EQUIRECTANGULAR"),
    "fisheye equidistant": panorama("FISHEYE_EQUIDISTANT", fisheye_fov=math.pi),
    "fisheye equisolid": panorama("FISHEYE_EQUISOLID", fisheye_fov=math.radians(120), fisheye_lens=10.5),
    "mirror ball": panorama("MIRRORBALL"),
    "cylinder": panorama("CENTRAL_CYLINDRICAL"),
    "shifted": shift,
    "clipped": clip,
    "scaled": scale_unevenly,
    "parented": turn_a_parent,
    "from 1000 metres": move_away(1e3),
    "from a million metres": move_away(1e6),
}


@pytest.mark.parametrize("view", VIEWS)
def test_view(stress_record, view):
    # Half of what is seen is the square's edge: more samples find the same pixels on both sides.
    compare(stress_record, seen_by(VIEWS[view]), lobe=(64, 2))


def defocus(scene, camera):
    camera.data.dof.use_dof = True
    camera.data.dof.focus_distance = 1.5
    camera.data.dof.aperture_fstop = 0.5


def defocus_through_blades(scene, camera):
    defocus(scene, camera)
    camera.data.dof.aperture_blades, camera.data.dof.aperture_ratio = 5, 2.0


def move(scene, thing, offset):
    """Move an object by `offset` metres within the shutter's time, half before and half after the frame."""
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 1.0
    place = thing.location.copy()
    for frame, side in ((0, -1), (2, 1)):
        thing.location = place + side * Vector(offset)
        thing.keyframe_insert("location", frame=frame)
    scene.frame_set(1)


def move_camera(scene, camera):
    move(scene, camera, (0.3, 0, 0.1))


def roll_the_shutter(scene, camera):
    move_camera(scene, camera)
    scene.cycles.rolling_shutter_type, scene.cycles.rolling_shutter_duration = "TOP", 0.2


def zoom(scene, camera):
    scene.render.use_motion_blur = True
    for frame, length in ((0, 40), (2, 70)):
        camera.data.lens = length
        camera.data.keyframe_insert("lens", frame=frame)
    scene.frame_set(1)


def move_square(scene, camera):
    move(scene, next(thing for thing in scene.objects if thing.type == "MESH"), (0.2, 0.1, 0))


def turn_square(scene, camera):
    move_square(scene, camera)
    square = next(thing for thing in scene.objects if thing.type == "MESH")
    for frame, angle in ((0, -0.1), (2, 0.1)):
        square.rotation_euler = (angle, 0, angle)
        square.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)


def move_lamp(scene, camera):
    """Cycles does not blur lights: both stand where they are at the frame."""
    move(scene, next(thing for thing in scene.objects if thing.type == "LIGHT"), (0.5, 0, 0))


@pytest.mark.parametrize("blur", [defocus, defocus_through_blades, move_camera, roll_the_shutter, zoom, move_square,
                                  turn_square, move_lamp])
def test_blur(stress_record, blur):
    def lamp_lit(scene, material):
        add_square(scene, material)
        add_lamp(scene, location=MIDDLE, shadow_soft_size=0.15)

    scene_of = lamp_lit if blur is move_lamp else sunny_square
    compare(stress_record, seen_by(blur, scene_of), nodes=(1024, 2), lobe=(64, 2))


def border(scene, camera):
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.25, 0.75


def crop(scene, camera):
    border(scene, camera)
    scene.render.use_crop_to_border = True


def half_resolution(scene, camera):
    scene.render.resolution_percentage = 50


def double_resolution(scene, camera):
    scene.render.resolution_percentage = 200


def tall_pixels(scene, camera):
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.0, 4.0


def one_row(scene, camera):
    scene.render.resolution_y = 2
    scene.render.resolution_x = 72


def transparent_film(scene, camera):
    scene.render.film_transparent = True


def exposure(scene, camera):
    scene.cycles.film_exposure = 3.0


def pixel_filter(kind, width):
    def change(scene, camera):
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = kind, width

    change.__name__ = f"{kind.lower()} filter of {width:g} pixels"
    return change


@pytest.mark.parametrize(
    "film",
    [border, crop, half_resolution, double_resolution, tall_pixels, one_row, transparent_film, exposure,
     pixel_filter("BOX", 1.0), pixel_filter("GAUSSIAN", 10.0),
     pixel_filter("BLACKMAN_HARRIS", 4.0)],
    ids=lambda change: change.__name__,
)
def test_film(stress_record, film):
    # One sample at the centre of each pixel has no pixel to blur: more samples make the footprint small.
    compare(stress_record, seen_by(film), nodes=(1024, 2), lobe=(64, 2))


def test_filter_narrower_than_the_footprint(stress_record):
    """Light is kept, but blurred over a footprint, which supposes a filter about a pixel wide."""
    outcome = compare(stress_record, seen_by(pixel_filter("GAUSSIAN", 0.01)), lobe=(64, 2),
                      finite_only="glints are blurred over a footprint, which supposes a filter about a pixel wide")
    assert outcome.energy == pytest.approx(1.0, abs=2 * FLOOR)


def test_camera_inside_an_object(stress_record):
    def build(scene, material):
        cycles.add_sphere(scene, 1.0, material=material)
        cycles.add_camera(scene, (0.2, -0.1, 0.1), (0, 1, 0.3), angle=1.2)
        # A sky shows through nothing: the sphere is closed.
        add_sky(scene)
        add_lamp(scene, location=(0, 0.3, 0.4), shadow_soft_size=0.05)

    scene_bounces = seen_by(lambda scene, camera: setattr(scene.cycles, "max_bounces", 2), build)
    compare(stress_record, scene_bounces)


def test_stereo(stress_record):
    """Both eyes side by side in one picture."""

    def build(scene, material):
        sunny_square(scene, material)
        scene.camera.data.stereo.convergence_distance = 2.8
        scene.render.use_multiview = True
        settings = scene.render.image_settings
        settings.views_format = "STEREO_3D"
        settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
        settings.stereo_3d_format.use_squeezed_frame = False

    outcome = compare(stress_record, build, lobe=(64, 2))
    assert outcome.lobe.shape[2] == 2 * outcome.lobe.shape[1]
    left, right = np.split(outcome.lobe, 2, axis=2)
    assert not np.allclose(left, right, rtol=0.05)
