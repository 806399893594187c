"""What is read of Blender's cameras: frustum, pixel and lens, at one frame and at all."""

import math

import bpy
import numpy as np
import pytest

from glint_addon.seen.cameras import MARGIN, all_camera_views, camera_views
from tests.helpers import cycles

DIGITS = 1e-6  # of 32-bit floats
WIDTH, HEIGHT = 32, 16


@pytest.fixture
def camera(scene):
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    cycles.add_camera(scene, (1, 2, 5))
    return scene.camera


def view_of(camera, scene):
    return camera_views(camera, scene, [1])[0]


def test_a_pixel_and_the_frustum_of_a_perspective_camera_are_those_at_depth_one(scene, camera):
    camera.data.type, camera.data.angle, camera.data.clip_start, camera.data.clip_end = "PERSP", 1.2, 0.5, 70.0
    view = view_of(camera, scene)
    half = math.tan(0.6)
    assert view.pixel == pytest.approx(2 * half / WIDTH, rel=DIGITS)
    assert view.high == pytest.approx([MARGIN * half] * 2, rel=DIGITS)
    assert view.low == pytest.approx([-MARGIN * half] * 2, rel=DIGITS)
    assert view.least_cosine == pytest.approx(1 / math.sqrt(1 + half**2 * (1 + (HEIGHT / WIDTH) ** 2)), rel=DIGITS)
    assert (view.near, view.far) == (0.5, 70.0)


def test_a_pixel_and_the_frustum_of_an_orthographic_camera_are_the_same_at_every_depth(scene, camera):
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    view = view_of(camera, scene)
    assert (view.pixel, view.least_cosine) == (pytest.approx(4.0 / WIDTH), 1.0)
    assert view.high == pytest.approx([MARGIN * 2.0] * 2, rel=DIGITS)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_planes_part_what_is_inside_the_frustum(scene, camera, kind):
    camera.data.angle, camera.data.type, camera.data.ortho_scale = math.pi / 2, kind, 2.0
    planes = view_of(camera, scene).planes()
    for x, y in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        assert (planes @ [0.99 * MARGIN * x, 0.99 * MARGIN * y, -1, 1] > 0).all()
        assert not (planes @ [1.01 * MARGIN * x, y, -1, 1] > 0).all()
        assert not (planes @ [x, 1.01 * MARGIN * y, -1, 1] > 0).all()


def test_the_lens_is_that_of_cycles_and_each_camera_has_its_own(scene, camera):
    assert (view_of(camera, scene).aperture, view_of(camera, scene).focus) == (0.0, 1.0)
    cycles.add_camera(scene, (0, 0, 9))
    for thing, kind, ratio in ((camera, "PERSP", 1.0), (scene.camera, "ORTHO", 0.5)):
        thing.data.type, thing.data.lens = kind, 50.0
        thing.data.dof.use_dof, thing.data.dof.aperture_fstop, thing.data.dof.aperture_ratio = True, 2.0, ratio
        thing.data.dof.focus_distance = 3.0
    assert scene.camera != camera
    apertures = sorted(view.aperture for view, in all_camera_views(scene, [1]))
    assert apertures == pytest.approx([0.05 / 4, 2 * 1.0 / 4], rel=DIGITS)
    camera.data.dof.focus_object = scene.camera
    assert view_of(camera, scene).focus is None
    assert view_of(scene.camera, scene).focus == 3.0


def test_a_camera_that_keys_move_is_seen_from_where_it_is_at_each_frame(scene, camera):
    for frame, x in ((1, 0.0), (3, 4.0)):
        camera.location.x = x
        camera.keyframe_insert("location", index=0, frame=frame)
    views = camera_views(camera, scene, [1, 3])
    for view, x in zip(views, (0.0, 4.0), strict=True):
        assert view.inverse @ [x, 2, 5, 1] == pytest.approx([0, 0, 0, 1], abs=DIGITS)
    assert np.array_equal(views[0].high, views[1].high)


@pytest.mark.parametrize("change", ["panorama", "animated lens", "constraint", "no camera"])
def test_nothing_is_known_of_a_camera_that_may_see_anything(scene, camera, change):
    assert all_camera_views(scene, [1])
    if change == "panorama":
        camera.data.type = "PANO"
    elif change == "animated lens":
        camera.data.keyframe_insert("lens", frame=1)
    elif change == "constraint":
        camera.constraints.new("COPY_LOCATION").target = camera
    else:
        scene.camera = bpy.data.objects.new("Empty", None)
        scene.collection.objects.link(scene.camera)
    assert all_camera_views(scene, [1]) == []
