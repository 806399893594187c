"""What sees the glints of a scene: its cameras at all frames of an animation, and whether mirrors see them too."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..animation.curves import is_animated
from ..animation.frames import chosen_frames
from ..animation.motion import copies_others
from ..materials.worn import worn_materials
from ..nodes.glint_bsdf import is_glint_group
from .cameras import CameraView, all_camera_views

# Rougher surfaces (alpha from 0.25) blur what they mirror so much that it needs no hints.
ROUGH = 0.5
# Shader nodes that mirror nothing.
NO_MIRRORS = {
    "ShaderNodeAddShader", "ShaderNodeBackground", "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent",
    "ShaderNodeBsdfTranslucent", "ShaderNodeEmission", "ShaderNodeHoldout", "ShaderNodeMixShader",
}


@dataclass(frozen=True)
class SceneViews:
    """What the cameras of a scene see over an animation. cameras: a row for each, with what it sees at each of the
    `frames`; has_mirrors: whether facets may be seen from elsewhere as well; surfaces: what `choice.patches` found of
    objects at these frames, kept for the next material."""

    frames: np.ndarray
    cameras: list[list[CameraView]]
    has_mirrors: bool
    surfaces: dict = field(default_factory=dict)


def scene_views(scene) -> SceneViews | None:
    """What the cameras of a scene see, None if that cannot be told, if there are copies of objects, or if diffuse
    surfaces show glints, which see all around them."""
    frames = chosen_frames(scene)
    cameras = all_camera_views(scene, frames)
    if not cameras or _shows_caustics(scene) or any(copies_others(thing) for thing in scene.objects):
        return None
    return SceneViews(frames, cameras, _has_mirrors(scene))


def _shows_caustics(scene) -> bool:
    """Whether glints are enumerated after diffuse bounces, at any time: see CAUSTICS of nodes.glint_bsdf."""
    cycles = scene.cycles
    if min(cycles.max_bounces, cycles.diffuse_bounces) == 0:
        return False
    has_caustics = cycles.caustics_reflective or is_animated(scene, "cycles.caustics_reflective")
    return has_caustics and (cycles.blur_glossy <= 0.0 or is_animated(scene, "cycles.blur_glossy"))


def _has_mirrors(scene) -> bool:
    """Whether surfaces of the scene may show facets from other sides than the cameras."""
    cycles = scene.cycles
    if cycles.max_bounces == 0 or max(cycles.glossy_bounces, cycles.transmission_bounces) == 0:
        return False
    layers = [layer for layer in scene.view_layers if layer.use]
    materials = {material for thing in scene.objects for material in worn_materials(thing, layers)}
    materials |= {layer.material_override for layer in scene.view_layers if layer.material_override}
    return any(_mirrors(material.node_tree, set()) for material in materials)


def _mirrors(tree, seen: set) -> bool:
    """Whether a tree of nodes may mirror or refract sharply. Facets of our own groups scatter far too much for it."""
    if tree is None or tree in seen or is_glint_group(tree):
        return False
    seen.add(tree)
    return any(
        _mirrors(node.node_tree, seen) if node.bl_idname == "ShaderNodeGroup"
        else node.bl_idname not in NO_MIRRORS and _has_shader(node) and not _is_rough(node)
        for node in tree.nodes
    )


def _has_shader(node) -> bool:
    return any(output.type == "SHADER" for output in node.outputs)


def _is_rough(node) -> bool:
    """Whether all that a shader node mirrors is blurred."""
    roughness, coat = node.inputs.get("Roughness"), node.inputs.get("Coat Weight")
    if roughness is None or roughness.is_linked or roughness.default_value < ROUGH:
        return False
    return coat is None or not coat.is_linked and coat.default_value == 0.0
