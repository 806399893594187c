"""Which lights a map's facets can mirror to a camera, at any frame; in doubt a light is mirrored.

The test is the shader's (`map_reaches_hint` in osl/light_hint.h) for whole patches of a surface and all of an
animation: a light whose half vectors stay clear of every facet is not read at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .coordinates import evaluated_mesh
from .eyes import Eye, scene_eyes
from .lights.animation import is_animated
from .lights.choice import chosen_frames, is_still, places
from .lights.hint import Hint
from .motion import copies_others, has_rigid_box
from .nodes.glint_bsdf import is_glint_group
from .nodes.glint_lights import KIND_SUN
from .surface import Patches, surface_patches
from .visibility import scene_cameras

# Half-width of the selected region in alpha: REGION in osl/light_hint.h.
REGION = 2.5
# For what the bounds leave out: normals between corners, the turn within a footprint, a camera moved a little.
MARGIN = np.radians(3.0)
# Half vectors turn ever faster as light and view become opposite: from here on all are reached.
OPPOSITE = np.radians(170.0)
SIZES = ("angle", "shadow_soft_size", "size", "size_y")  # properties of lights that change how large they are
LEAST_SCALING = 1e-3  # relative change of an object's size over an animation that makes its patches others
# Rougher surfaces (alpha from 0.25) blur what they mirror so much that it needs no hints.
ROUGH = 0.5
# Shader nodes that mirror nothing.
NO_MIRRORS = {
    "ShaderNodeAddShader", "ShaderNodeBackground", "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent",
    "ShaderNodeBsdfTranslucent", "ShaderNodeEmission", "ShaderNodeHoldout", "ShaderNodeMixShader",
}


@dataclass(frozen=True)
class Views:
    """The cameras of a scene: their eyes at each of the frames, and the radius of the largest lens [m]."""

    frames: np.ndarray
    eyes: list[list[Eye]]
    lens: float


@dataclass(frozen=True)
class Facets:
    """What a material's facets are: largest tilt [rad] of the map's facets, alpha of one facet."""

    tilt: float
    alpha: float


def scene_views(scene) -> Views | None:
    """What the cameras of a scene see by, None if facets may be seen from anywhere else, as in mirrors."""
    frames = chosen_frames(scene)
    eyes = scene_eyes(scene, frames)
    if not eyes or any(copies_others(thing) for thing in scene.objects) or _has_mirrors(scene):
        return None
    lenses = [camera.data for camera in scene_cameras(scene) if camera.data.dof.use_dof]
    radius = max((lens.lens * 1e-3 / (2 * lens.dof.aperture_fstop) * max(1.0, 1.0 / lens.dof.aperture_ratio)
                  for lens in lenses), default=0.0)
    return Views(frames, eyes, radius)


def facets_of(nodes) -> Facets | None:
    """The facets of a material whose glints come from the group nodes `nodes`; None if they cannot be told."""
    all_facets = [_facets(node) for node in nodes]
    if None in all_facets or not all_facets:
        return None
    return Facets(max(each.tilt for each in all_facets), max(each.alpha for each in all_facets))


def reached_hints(scene, views: Views | None, objects, facets: Facets | None, hints) -> set[Hint]:
    """Those of `hints` that `facets` on any of the objects can mirror to a camera. Matrices must be current."""
    if views is None or facets is None:
        return set(hints)
    reached = set()
    for thing in objects:
        moved = _patches_over(scene, thing, views.frames)
        if moved is None:
            return set(hints)
        reached |= {hint for hint in hints if hint not in reached and _reaches(hint, views, moved, facets)}
    return reached


def _facets(node) -> Facets | None:
    group, roughness, strength = node.node_tree, node.inputs["Roughness"], node.inputs["Strength"]
    is_animated = node.id_data.animation_data is not None
    if is_animated or roughness.is_linked or strength.is_linked or "glint_slope_low" not in group:
        return None
    bounds = np.abs([group["glint_slope_low"], group["glint_slope_high"]]).max(axis=0)
    if not bounds.any() or bounds.max() >= 1e6:
        return None  # the shader does not know them either
    slope = abs(strength.default_value) * float(np.linalg.norm(bounds))
    return Facets(float(np.arctan(slope)), min(max(roughness.default_value, 0.0), 1.0) ** 2)


def _patches_over(scene, thing, frames) -> list[tuple[Patches, float]] | None:
    """The patches of an object at each of the frames, or once if it stays, with its largest ratio of scales; None if
    its shape or place may be any."""
    matrices = places(thing, frames) if has_rigid_box(thing) else None
    depsgraph = next((layer.depsgraph for layer in scene.view_layers if layer.use), None)
    mesh = evaluated_mesh(thing, depsgraph) if matrices is not None and depsgraph is not None else None
    if mesh is None:
        return None
    scales = np.linalg.svd(matrices[:, :3, :3], compute_uv=False)
    if scales.min() <= 0.0 or (np.ptp(scales, axis=0) > LEAST_SCALING * scales[0]).any():
        return None
    stretch = float(scales[0].max() / scales[0].min())
    first, back = surface_patches(mesh, matrices[0]), np.linalg.inv(matrices[0])
    if is_still(matrices):
        return [(first, stretch)] * len(frames)
    return [(first.moved(matrix @ back), stretch) for matrix in matrices]


def _reaches(hint, views, moved, facets) -> bool:
    """Whether a light's half vectors meet the facets of an object anywhere at any frame."""
    lamps = _lamp_places(hint, views.frames)
    if lamps is None:
        return True
    nothing_moves = is_still(lamps) and all(patches is moved[0][0] for patches, _ in moved)
    for eyes in views.eyes:
        still = nothing_moves and all((eye.inverse == eyes[0].inverse).all() for eye in eyes)
        rows = zip(eyes[:1] if still else eyes, lamps, moved, strict=False)
        gaps = [_gap(hint, lamp, eye, views.lens, *shape, facets) for eye, lamp, shape in rows]
        # Between two frames the gap may fall as much as it changed from one to the other.
        change = max((np.abs(after - before).max() for before, after in zip(gaps, gaps[1:], strict=False)), default=0.0)
        if min(gap.min() for gap in gaps) <= change:
            return True
    return False


def _lamp_places(hint, frames) -> np.ndarray | None:
    """Direction towards a sun, place of another light, at each of the frames (f, 3); None if it cannot be told."""
    if hint.direction is not None and hint.live is None:
        return np.tile(np.array(hint.direction, float), (len(frames), 1))
    lamp = hint.object
    if lamp is None or lamp.data is None or lamp.type == "MESH" and not has_rigid_box(lamp):
        return None
    matrices = places(lamp, frames)
    sizes = (name for name in SIZES if hasattr(lamp.data, name))
    if matrices is None or any(is_animated(lamp.data, name) for name in sizes):
        return None
    lengths = np.maximum(np.linalg.norm(matrices[:, :3, :3], axis=1), 1e-12)
    if (np.ptp(lengths, axis=0) > LEAST_SCALING * lengths[0]).any():
        return None
    if hint.kind != KIND_SUN:
        return np.array([hint.middle(matrix) for matrix in matrices])
    return matrices[:, :3, 2] / lengths[:, 2:]


def _gap(hint, lamp, eye, lens, patches, stretch, facets) -> np.ndarray:
    """Angle [rad] between a light's half vectors and the nearest facets of each patch (n,): negative if they meet."""
    light, light_spread, light_angle = _directions(lamp, hint, patches)
    view, view_spread = _views(eye, lens, patches)
    between = np.arccos(np.clip((light * view).sum(axis=1), -1.0, 1.0)) + light_spread + view_spread
    half_vector = light + view
    half_vector /= np.maximum(np.linalg.norm(half_vector, axis=1, keepdims=True), 1e-12)

    # A surface is seen from behind with its normal turned over. Uneven scaling tilts facets further.
    cosine = np.abs((half_vector * patches.normals).sum(axis=1))
    tilt = np.arctan(stretch * np.tan(facets.tilt))
    gap = np.arccos(np.clip(cosine, 0.0, 1.0)) - patches.spreads - tilt - REGION * facets.alpha - MARGIN
    # Half vectors turn by half the angle between lights, across the plane of incidence by 1 / (2 cos) of it.
    with np.errstate(invalid="ignore", over="ignore"):
        gap -= (light_spread + view_spread + light_angle) / (2 * np.cos(np.minimum(between, OPPOSITE) / 2))
    return np.where((between < OPPOSITE) & np.isfinite(gap), gap, -np.pi)


def _directions(lamp, hint, patches):
    """Unit vectors to a light (n, 3), how far they differ on a patch (n,), angular radius of the light (n,) [rad]."""
    count = len(patches.centres)
    if hint.kind == KIND_SUN:
        return np.tile(lamp, (count, 1)), np.zeros(count), np.full(count, hint.size)
    offset = lamp - patches.centres
    distance = np.linalg.norm(offset, axis=1)
    nearest = np.maximum(distance - patches.radii, 0.0)
    return offset / np.maximum(distance, 1e-12)[:, None], _cone(patches.radii, distance), _cone(hint.size, nearest)


def _views(eye, lens, patches):
    """Unit vectors to a camera (n, 3), how far they differ on a patch (n,) [rad]."""
    to_world = np.linalg.inv(eye.inverse)
    if not eye.is_perspective:
        return np.tile(to_world[:3, 2], (len(patches.centres), 1)), np.zeros(len(patches.centres))
    offset = to_world[:3, 3] - patches.centres
    distance = np.linalg.norm(offset, axis=1)
    return offset / np.maximum(distance, 1e-12)[:, None], _cone(patches.radii + lens, distance)


def _cone(radius, distance):
    """Half-angle [rad] of balls at some distance: all around from within."""
    is_outside = distance > radius
    return np.where(is_outside, np.arcsin(np.where(is_outside, radius / np.maximum(distance, 1e-12), 0.0)), np.pi)


def _has_mirrors(scene) -> bool:
    """Whether surfaces of the scene may show facets from other sides than the cameras."""
    cycles = scene.cycles
    if cycles.max_bounces == 0 or max(cycles.glossy_bounces, cycles.transmission_bounces) == 0:
        return False
    materials = {slot.material for thing in scene.objects for slot in thing.material_slots if slot.material}
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
