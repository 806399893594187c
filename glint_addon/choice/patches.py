"""The surface of an object in patches, at each frame for which lights are judged: only rigid motion may move them."""

from __future__ import annotations

import bpy
import numpy as np

from ..animation.motion import has_rigid_box
from ..animation.places import is_still, places
from ..seen.meshes import evaluated_mesh
from ..seen.scene_views import SceneViews
from ..seen.surface import PatchesOver, surface_patches

LEAST_SCALING = 1e-3  # relative change of an object's size over an animation from which on its patches count as others


def patches_over(scene: bpy.types.Scene, thing: bpy.types.Object, views: SceneViews) -> PatchesOver | None:
    """The patches of an object at each frame of `views`, with its largest ratio of scales; None if its shape or place
    is not known at each of them. Computed once."""
    if thing not in views.surfaces:
        views.surfaces[thing] = _patches_over(scene, thing, views.frames)
    return views.surfaces[thing]


def _patches_over(scene: bpy.types.Scene, thing: bpy.types.Object, frames: np.ndarray) -> PatchesOver | None:
    matrices = places(thing, frames) if has_rigid_box(thing) else None
    if matrices is None:
        return None
    depsgraph = next((layer.depsgraph for layer in scene.view_layers if layer.use), None)
    mesh = evaluated_mesh(thing, depsgraph) if depsgraph is not None else None
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
