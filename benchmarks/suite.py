"""The suite: small scenes in which each effect is alone somewhere and together with others somewhere.

A scene module has a docstring that says what it shows, SMALL_LIGHTS (lit by small lights only: it counts for the
headline), TEXELS (about so many texels of the map in a pixel), SURFACE (arguments of `create_glint_material`),
`normal_map()` and `build(scene, material)`; where errors are large, TRUTH_NOISE, that its truth may have; where the
truth is summed texel by texel instead of rendered, TRUTH = "exact".
"""

from __future__ import annotations

import hashlib
from importlib import import_module

import bpy
import numpy as np

from demo_scenes import maps, stage
from demo_scenes.truth import truth_material
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

SIZE = (48, 48)  # pixels
MAP_STEPS = 4096  # levels of a normal map that its digest tells apart: rounding of another processor must not count
NAMES = (
    "flakes_close",
    "flakes_middle",
    "flakes_far",
    "bumps_close",
    "bumps_middle",
    "bumps_far",
    "brushed_middle",
    "brushed_grazing",
    "scratches_middle",
    "scratches_far",
    "eight_bit",
    "sky_only",
    "interreflection",
    "hundred_lights",
    "together",
    "sharp_plane",
    "sharp_ball",
    "sharp_lights",
    "paint_frame",
    "flakes_frame",
    "bumps_frame",
    "bumps_near_frame",
)


def scene_module(name):
    """The module of scene `name`. Raises ValueError for an unknown name."""
    if name not in NAMES:
        raise ValueError(f'There is no scene "{name}": choose one of {", ".join(NAMES)}.')
    return import_module(f".scenes.{name}", __package__)


def scene_with(name, make_material, spp=1):
    """Scene `name` at `spp` samples a pixel in the material `make_material(image, **SURFACE)`; drops all open data."""
    module = scene_module(name)
    scene = stage.empty_scene(SIZE, spp)
    scene.render.use_texture_cache = False
    image = maps.blender_image("Normal map", module.normal_map())
    module.build(scene, make_material(image, **module.SURFACE))
    return scene


def nodes_scene(name, spp=1):
    """Scene `name` in Blender's own nodes, without Open Shading Language: where they are fastest."""
    return scene_with(name, lambda image, **surface: truth_material("Nodes", image, **surface), spp)


def lobe_scene(name, spp=1):
    """Scene `name` in the glint material, prepared."""
    scene = scene_with(name, lambda image, **surface: create_glint_material("Glint", image, **surface), spp)
    prepare_scene(scene)
    return scene


def scene_hash(name) -> str:
    """Hexadecimal digest of what the right answer of scene `name` depends on; drops all open data.

    Of the data as it is built, not of its source: refactoring a scene does not make its truth old.
    """
    module = scene_module(name)
    scene = scene_with(name, lambda image, **surface: bpy.data.materials.new("Glint"))
    return scene_digest(scene, repr((SIZE, sorted(module.SURFACE.items()))), [bpy.data.images["Normal map"]])


def scene_digest(scene, described: str, images) -> str:
    """Hexadecimal digest of `images`, of objects and world of `scene`, and of what else is `described` (materials)."""
    scene.view_layers[0].update()
    digest = hashlib.sha256(described.encode())
    for image in images:
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        digest.update(repr(image.size[:]).encode() + np.round(pixels * MAP_STEPS).astype(np.int16).tobytes())
    for obj in sorted(scene.objects, key=lambda each: each.name):
        digest.update(repr((obj.name, _rounded(value for row in obj.matrix_world for value in row))).encode())
        digest.update(repr(_settings(obj.data)).encode())
        if obj.type == "MESH":
            # Sorted, because Blender makes a sphere's faces in another order each time.
            places = [obj.data.vertices[loop.vertex_index].co for loop in obj.data.loops]
            corners = [_rounded([*co, *uv.vector]) for co, uv in zip(places, obj.data.uv_layers[0].uv, strict=True)]
            digest.update(repr(sorted(corners)).encode())
    for node in scene.world.node_tree.nodes:
        digest.update(repr((_settings(node), [_settings(socket) for socket in node.inputs])).encode())
    return digest.hexdigest()[:16]


def _settings(block):
    """Numbers, choices and colours among the properties of a data-block, by name."""
    kinds = {"INT", "FLOAT", "BOOLEAN", "ENUM"}
    properties = [each for each in block.bl_rna.properties if each.type in kinds and not each.is_readonly]
    skipped = ("is_", "select", "show_", "location", "width", "height", "bl_", "hide")
    names = sorted(each.identifier for each in properties if not each.identifier.startswith(skipped))
    values = ((name, getattr(block, name)) for name in names)
    return [(name, _rounded(value) if isinstance(value, bpy.types.bpy_prop_array) else value) for name, value in values]


def _rounded(values):
    """Six digits of each number, so that another processor's last bit does not matter."""
    return [f"{value + 0.0:.6g}" for value in values]
