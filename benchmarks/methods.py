"""The methods compared: Blender's nodes, what Blender and its users do against the noise of glints, and the lobe."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy

from demo_scenes.truth import truth_material

from . import suite, widened


@dataclass(frozen=True)
class Method:
    """`scene(name, spp)` opens scene `name` of the suite, ready to render in this method.

    unbiased: whether its error is noise alone, which falls as 1/sqrt(spp). per_sample: whether its time is proportional
    to the samples, so that few can be timed by rendering many.
    """

    name: str
    label: str
    scene: Callable[[str, int], bpy.types.Scene]
    unbiased: bool = False
    per_sample: bool = True


def nodes_cached_scene(name, spp=1):
    """Blender's nodes with Cycles' texture cache: each sample reads the mip level of its ray's width.

    Cycles caches images in files only, as tiles of a .tx file that it makes itself; the level is a mean of the encoded
    normals, and what their spread would do to the roughness is lost.
    """
    scene = suite.scene_with(name, _file_material, spp)
    scene.cycles.shading_system = False
    scene.render.use_texture_cache = True
    scene.render.use_auto_generate_texture_cache = True
    return scene


def denoised_scene(name, spp=1):
    """Blender's nodes with adaptive sampling and OpenImageDenoise, both as Blender sets them by default.

    Adaptive sampling stops at a noise of 0.01, `spp` is the most a pixel gets; albedo and normal guide the denoiser.
    """
    scene = suite.nodes_scene(name, spp)
    cycles = scene.cycles
    for setting in ("use_adaptive_sampling", "adaptive_threshold", "adaptive_min_samples", "use_denoising", "denoiser",
                    "denoising_input_passes", "denoising_prefilter", "denoising_quality"):
        cycles.property_unset(setting)
    return scene


def widened_scene(name, spp=1):
    """Blender's nodes with the map's mean slopes at one pixel's level and the roughness widened; see `widened`."""
    texels = suite.scene_module(name).TEXELS
    scene = suite.scene_with(name, lambda image, **surface: widened.widened_material(image, texels, **surface), spp)
    scene.cycles.shading_system = False
    return scene


def nodes_osl_scene(name, spp=1):
    """Blender's nodes under Open Shading Language, as the lobe must run: for the cost of a sample only."""
    scene = suite.nodes_scene(name, spp)
    scene.cycles.shading_system = True
    return scene


def _file_material(image, **surface):
    """Blender's nodes reading the pixels of `image` from a file of 32-bit floats."""
    file = Path(bpy.app.tempdir) / "benchmark_normal_map.exr"
    image.filepath_raw = str(file)
    image.file_format = "OPEN_EXR"
    image.save()
    stored = bpy.data.images.load(str(file))
    stored.colorspace_settings.is_data = True
    return truth_material("Nodes, cached", stored, **surface)


METHODS = (
    Method("nodes", "Blender's nodes", suite.nodes_scene, unbiased=True),
    Method("nodes_cached", "nodes, texture cache", nodes_cached_scene),
    Method("widened", "nodes, LEAN roughness", widened_scene),
    Method("denoised", "nodes, adaptive and denoised", denoised_scene, per_sample=False),
    Method("lobe", "Glint", suite.lobe_scene),
)


def method(name) -> Method:
    """The method called `name`. Raises KeyError for an unknown one."""
    return {each.name: each for each in METHODS}[name]
