"""Large pictures of what Glint is for: car paint, a field of snow, and metal beside glitter, all of presets."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

import glint_addon
from glint_addon.operators.keep_glints import KEEPING

from . import measure, picture, preset_stage, stage
from .presets import seen

SIZE = (960, 540)
SPP = 4  # few, for the demo's three minutes: Glint and a denoiser make enough of them
# Pictures of which half is not denoised: a denoiser takes flakes finer than a pixel for noise.
HALF_DENOISED = ("car_paint",)


def draw(name: str, out: Path):
    """Render the picture `name` of SCENES and write `out`/NAME.png."""
    picture.save_picture(out / f"{name}.png", seen(rendered(name)))


def rendered(name: str, size=SIZE, spp=SPP) -> np.ndarray:
    """Scene-linear pixels of the picture `name`, denoised in the way that keeps glints."""
    scene = stage.empty_scene(size, spp)
    SCENES[name](scene)
    glint_addon.prepare_scene(scene)
    cycles = scene.cycles
    cycles.use_denoising, cycles.denoising_input_passes = True, KEEPING
    cycles.denoising_prefilter, cycles.denoising_quality = "ACCURATE", "HIGH"
    pixels = measure.rendered(scene)
    if name not in HALF_DENOISED:
        return pixels
    cycles.use_denoising, cycles.seed = False, stage.SEED + 1
    return (pixels + measure.rendered(scene)) / 2


def build_car_paint(scene):
    """Two forms as painters spray them for samples, 30 cm long, one red, one blue."""
    preset_stage.add_table(scene)
    preset_stage.add_light(scene)
    add_form(scene, preset_material("Metallic Red"), (-0.02, -0.05, 0.0), turn=0.45)
    add_form(scene, preset_material("Blue Pearl"), (0.09, 0.25, 0.0), turn=0.45)
    stage.add_camera(scene, (0.0, -0.85, 0.30), (0.02, 0.05, 0.035), angle=0.46)


def build_snow(scene):
    """Drifts of fresh snow up to the horizon, against a low sun."""
    add_drifts(scene, preset_material("Fresh Snow"))
    stage.add_sun(scene, (0.35, 1.0, 0.42), strength=2.2, color=(1.0, 0.9, 0.76))
    preset_stage.add_gradient_sky(scene)
    stage.add_camera(scene, (0.0, -0.75, 0.34), (0.0, 0.3, 0.08), angle=0.75)


def build_metal_and_glitter(scene):
    """A turned disc, a hammered ball of gold and a glittering bauble."""
    preset_stage.add_table(scene)
    preset_stage.add_light(scene)
    disc = stage.add_disc(scene, preset_material("Brushed Aluminium"), radius=0.08, hole=0.004)
    glint_addon.add_radial_uvs(disc.data, repeat=glint_addon.presets()["Brushed Aluminium"].scale)
    disc.location, disc.rotation_euler = (0.0, 0.06, 0.074), (1.18, 0.0, 0.0)
    preset_stage.add_ball(preset_material("Hammered Gold"), centre=(-0.105, -0.02, 0.045), radius=0.045)
    preset_stage.add_ball(preset_material("Christmas Bauble"), centre=(0.10, -0.03, 0.04), radius=0.04)
    stage.add_camera(scene, preset_stage.CAMERA, (0.0, 0.0, 0.058), angle=0.52)


SCENES = {"car_paint": build_car_paint, "snow": build_snow, "metal_and_glitter": build_metal_and_glitter}


def preset_material(name):
    """The material of a preset."""
    return glint_addon.create_glint_material(name, preset=name)


def add_form(scene, material, location, *, turn, length=0.30, width=0.075, height=0.085) -> bpy.types.Object:
    """A smooth form, blunt in front, as wide on either side as `width`; UVs in metres along it and around it."""
    along, around = np.linspace(0.0, 1.0, 160)[:, None], np.linspace(-np.pi, np.pi, 161)[None, :]
    wide = np.sin(np.pi * along**0.85) ** 0.6
    high = np.sin(np.pi * along**0.7) ** 0.75
    sine, cosine = (np.sign(value) * np.abs(value) ** 0.85 for value in (np.sin(around), np.cos(around)))
    places = np.stack(np.broadcast_arrays(
        length * (0.5 - 0.5 * np.cos(np.pi * along)) - length / 2,
        width * wide * sine,
        # The lower half is flat: the form lies on the table.
        height * high * np.where(cosine > 0, cosine, 0.25 * cosine) + 0.25 * height), axis=-1)
    form = grid_object(scene, "Form", places, material)
    form.location, form.rotation_euler = location, (0.0, 0.0, turn)
    return form


def add_drifts(scene, material) -> bpy.types.Object:
    """Waves of snow from the camera on, finer near it than far away."""
    far = 40.0
    depth = np.geomspace(0.35, far, 400)[:, None] - 1.0
    side = np.linspace(-1.0, 1.0, 300)[None, :] * (depth + 1.3)
    rng = np.random.default_rng(4)
    height = np.zeros(np.broadcast_shapes(depth.shape, side.shape))
    for wavelength in np.geomspace(0.06, 3.0, 40):
        angle, phase = rng.normal(1.2, 0.5), rng.uniform(0, 2 * np.pi)
        waves = np.sin(2 * np.pi / wavelength * (np.cos(angle) * side + np.sin(angle) * depth) + phase)
        height += 0.004 * wavelength**0.8 * waves
    places = np.stack(np.broadcast_arrays(side, depth, height), axis=-1)
    return grid_object(scene, "Drifts", places, material, uvs=places[..., :2])


def grid_object(scene, name, places, material, *, uvs=None) -> bpy.types.Object:
    """A smooth grid of vertices `places` (rows, columns, 3); uvs (rows, columns, 2), or metres along rows and columns
    from the middle column."""
    rows, columns = places.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    faces = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    if uvs is None:
        uvs = _metres(places)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(places.reshape(-1, 3).tolist(), [], faces.tolist())
    values = uvs.reshape(-1, 2)[faces.ravel()].astype(np.float32)
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", values.ravel())
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.materials.append(material)
    return stage.place(scene, name, mesh)


def _metres(places):
    """UVs (rows, columns, 2): the way along the middle column, and in each row the way from it."""
    middle = places.shape[1] // 2
    steps = np.linalg.norm(np.diff(places, axis=0), axis=-1)[:, middle]
    along = np.concatenate([[0.0], np.cumsum(steps)])
    aside = np.linalg.norm(np.diff(places, axis=1), axis=-1)
    around = np.concatenate([np.zeros((len(places), 1)), np.cumsum(aside, axis=1)], axis=1)
    around -= around[:, middle:middle + 1]
    return np.stack(np.broadcast_arrays(along[:, None], around), axis=-1)
