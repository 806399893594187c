"""Two sequences that twinkle: a sun that moves over a plane of flakes, and a camera that comes nearer to it.

Glints are a few in a pixel, so that each pixel's brightness rises and falls. The roughness is wide (alpha 0.03) and the
flakes' slopes are small, because only then do Blender's nodes converge to the truth of 32 frames in minutes.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Vector

from demo_scenes import maps, measure, stage

NAMES = ("light", "dolly")
FRAMES = 32
SIZE = (32, 32)
SURFACE = {"roughness": math.sqrt(0.03), "interpolation": "CLOSEST"}
SLOPE = 0.12  # standard deviation of the flakes' slopes
SUN_ANGLE = math.radians(1.0)
PLANE = 4.0  # metres
TEXELS = 256
REPEATS = 2.0  # of the map on the plane: about 11 flakes in a pixel of the light's sequence, one or two of them shine
VIEW_ANGLE = 0.2
VIEW = np.array((0.0, -1.0, 1.0)) / math.sqrt(2.0)  # towards the camera
DISTANCE = 3.6
# The sun moves across the plane of incidence, from 10 degrees left of the mirror direction to 10 degrees right of it.
# The half vector moves by 1 / sqrt(2) of that (45 degrees of incidence): 8 alpha in all, a quarter of one a frame.
SUN_SWING = math.radians(10.0)
# The camera comes from twice the distance: four times as many flakes a pixel in the first frame as in the last.
DOLLY = (2 * DISTANCE, DISTANCE)


def normal_map() -> np.ndarray:
    """Encoded normals, float32 (TEXELS, TEXELS, 3): each texel is a flake."""
    return maps.flakes(TEXELS, std=SLOPE, seed=11)


def scene_with(name, make_material) -> bpy.types.Scene:
    """Sequence `name` as an animated scene whose plane is `make_material(image, **SURFACE)`; frames 1 to FRAMES."""
    scene = stage.empty_scene(SIZE, 1)
    scene.frame_start, scene.frame_end = 1, FRAMES
    half = PLANE / 2
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    material = make_material(maps.blender_image("Normal map", normal_map()), **SURFACE)
    stage.add_sheet(scene, "Plane", corners, material, repeats=REPEATS)
    camera = stage.add_camera(scene, tuple(DISTANCE * VIEW), (0, 0, 0), angle=VIEW_ANGLE)
    sun = stage.add_sun(scene, (0, 1, 1), angle=SUN_ANGLE)
    {"light": _move_sun, "dolly": _move_camera}[name](sun, camera)
    return scene


def pictures(scene, spp, seed) -> np.ndarray:
    """Linear luminance of every frame, float64 (FRAMES, height, width); each frame has a seed of its own."""
    scene.cycles.samples = spp
    frames = []
    for frame in range(1, FRAMES + 1):
        scene.frame_set(frame)
        scene.cycles.seed = 1000 * seed + frame
        frames.append(measure.luminance(measure.rendered(scene)))
    return np.stack(frames)


def _move_sun(sun, camera):
    for frame, angle in enumerate(np.linspace(-SUN_SWING, SUN_SWING, FRAMES), start=1):
        ahead = math.cos(angle) / math.sqrt(2.0)
        direction = Vector((math.sin(angle), ahead, ahead))
        sun.rotation_euler = direction.to_track_quat("Z", "Y").to_euler()
        sun.keyframe_insert("rotation_euler", frame=frame)


def _move_camera(sun, camera):
    for frame, distance in enumerate(np.linspace(*DOLLY, FRAMES), start=1):
        camera.location = distance * VIEW
        camera.keyframe_insert("location", frame=frame)
