"""Which footprints, in texels, the cameras of a scene see of a map: they decide which levels of counts are baked.

A footprint beyond these renders right too, only noisier or slower; so the range errs on the wide side, and where it
is not known, it is everything.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from ..animation.frames import scene_frames
from ..animation.motion import copies_others, has_rigid_box
from ..animation.poses import poses
from ..bake.counts import counts_levels
from ..nodes.places import FOOTPRINT_EXPONENT, FOOTPRINT_SCALE
from .boxes import depth_range, is_inside
from .cameras import CameraView, all_camera_views
from .coordinates import texel_densities, uv_transforms
from .meshes import evaluated_mesh, face_planes, vertices
from .mirrors import has_mirrors, renders_mirrors
from .uv_size import metres_rendered

# Largest side of a block, in short semi-axes of the footprint, for which the shader reads counts: osl/counts.h. Up to
# FAR_SIDE_SUBSET where other answers are worse, and up to FAR_SIDE_LONG where too many blocks lie under a footprint.
FAR_SIDE = 0.7
FAR_SIDE_SUBSET = 2.5
FAR_SIDE_LONG = 2.0
# Where bins are too wide for the lobe, blocks this much larger are taken, whose bins are narrower: osl/counts.h.
NARROWER_BINS = 2.0
# Least short semi-axis for which the shader asks the index: osl/slope_index.h.
INDEX_SHORT_AXIS = 3.0
# On both sides: for another number of samples (16 instead of 256: 1.8) or a camera moved a little after preparing.
MARGIN = 2.0
EVERYTHING = (0.0, np.inf)
NOTHING = (np.inf, 0.0)
JUDGED_FACES = 256  # of a mesh, to find out whether it can see itself
FRAMES = 33  # of an animation that are looked at; the margin holds what lies between
LEAST_SCALING = 1e-3  # relative change of an object's size over an animation that changes its density of texels
LEAST_HOLLOW = 1e-3  # of the mesh's size: how far a point stands above a face that sees it; less is rounding


def footprint_range(
    scene: bpy.types.Scene,
    group: bpy.types.ShaderNodeTree,
    uses: Iterable[tuple[bpy.types.Object, bpy.types.Material]],
    size: tuple[int, int],
    *,
    mirrored: bool = False,
) -> tuple[float, float]:
    """Smallest and largest short semi-axis, in texels, of a sample's footprint on the map of `group` in `scene`.

    uses: (object, material) pairs that have the group; size: (width, height) of the map in texels. mirrored: judge as
    if mirrors showed every object. The margin is included. (0, inf) where it is not known; (inf, 0) if nothing is
    seen. Matrices must be current. Source of the footprint: osl/footprint.h.
    """
    frames = scene_frames(scene, FRAMES)
    cameras = all_camera_views(scene, frames)
    if not cameras or any(copies_others(thing) for thing in scene.objects):
        return EVERYTHING
    ranges = []
    for thing, material in dict.fromkeys(uses):
        mesh = rigid_mesh(scene, thing)
        matrices = poses(thing, frames)
        if mesh is None or matrices is None or not _is_rigid(matrices):
            return EVERYTHING
        places = uv_transforms(material, group, metres_rendered(thing, mesh, matrices[0, :3, :3]))
        if places is None:
            return EVERYTHING
        seen = _distinct_pairs(cameras, matrices)
        from_within = any(is_inside(view, thing, matrix) for view, matrix in seen)
        seen_in_mirrors = mirrored or _is_mirrored(scene, thing, mesh, from_within)
        for uv_map, transform in places:
            texels = np.diag(np.asarray(size, float)) @ transform
            density = texel_densities(mesh, matrices[0, :3, :3], uv_map, texels)
            if density is None:
                return EVERYTHING
            ranges += [_range_seen(view, thing, matrix, density, seen_in_mirrors) for view, matrix in seen]
    radius = FOOTPRINT_SCALE * max(scene.cycles.samples, 1) ** -FOOTPRINT_EXPONENT
    smallest, largest = NOTHING if not ranges else (min(low for low, _ in ranges), max(high for _, high in ranges))
    return float(smallest * radius / MARGIN), float(largest * radius * MARGIN)


def counts_levels_reached(
    footprints: tuple[float, float], width: int, height: int, interpolation: str
) -> tuple[int, int] | None:
    """Sides (first, last) of the blocks whose counts a map of `width` x `height` texels needs, None if it needs none.

    footprints: smallest and largest short semi-axis in texels, of `footprint_range`.
    """
    smallest, largest = footprints
    levels = counts_levels(width, height, interpolation)
    if FAR_SIDE_SUBSET * largest < levels[0]:
        return None
    nearest = [block for block in levels if block <= FAR_SIDE * smallest]
    farthest = [block for block in levels if block <= NARROWER_BINS * max(FAR_SIDE_LONG * largest, levels[0])]
    return max(nearest, default=levels[0]), max(farthest)


def index_is_reached(footprints: tuple[float, float]) -> bool:
    """Whether a sample asks for the index; footprints as for `counts_levels_reached`."""
    return footprints[1] >= INDEX_SHORT_AXIS


def rigid_mesh(scene: bpy.types.Scene, thing: bpy.types.Object) -> bpy.types.Mesh | None:
    """The mesh that is rendered of an object at every frame, or None if it may change its shape."""
    if not has_rigid_box(thing):
        return None
    depsgraph = next((layer.depsgraph for layer in scene.view_layers if layer.use), None)
    return evaluated_mesh(thing, depsgraph) if depsgraph is not None else None


def _is_rigid(matrices: np.ndarray) -> bool:
    """Whether none of the matrices (n, 4, 4) is degenerate and all scale alike."""
    scales = np.linalg.svd(matrices[:, :3, :3], compute_uv=False)
    return bool(scales.min() > 0.0 and (np.ptp(scales, axis=0) <= LEAST_SCALING * scales[0]).all())


def _distinct_pairs(cameras: list[list[CameraView]], matrices: np.ndarray) -> list[tuple[CameraView, np.ndarray]]:
    """What each camera sees at each frame, and the object's matrix then; a frame like an earlier one counts once."""
    found: list[tuple[CameraView, np.ndarray]] = []
    for views in cameras:
        pairs = list(zip(views, matrices, strict=True))
        found += {(view.inverse.tobytes(), matrix.tobytes()): (view, matrix) for view, matrix in pairs}.values()
    return found


def _range_seen(
    view: CameraView, thing: bpy.types.Object, matrix: np.ndarray, density: tuple[float, float], seen_in_mirrors: bool
) -> tuple[float, float]:
    """Smallest and largest footprint, in texels a pixel radius, that a camera sees of an object; NOTHING if none."""
    depths = depth_range(view, thing, matrix, seen_in_mirrors)
    if depths is None:
        return NOTHING
    if not view.is_perspective:
        return density[0] * view.pixel, np.inf if seen_in_mirrors else density[1] * view.pixel
    return density[0] * view.pixel * depths[0] * view.least_cosine, density[1] * view.pixel * depths[1]


def _is_mirrored(scene: bpy.types.Scene, thing: bpy.types.Object, mesh: bpy.types.Mesh, from_within: bool) -> bool:
    """Whether `thing`, whose mesh is `mesh`, may be seen in a mirror, or in itself; `from_within`: also from inside."""
    if not renders_mirrors(scene):
        return False
    return has_mirrors(scene, sharp=False, besides=thing) or from_within or _sees_itself(mesh)


def _sees_itself(mesh: bpy.types.Mesh) -> bool:
    """Whether a point of the mesh stands above one of its faces: it is not convex."""
    points = vertices(mesh)
    normals, centres = face_planes(mesh, JUDGED_FACES)
    heights = (points @ normals.T - np.einsum("fc,fc->f", normals, centres)).max()
    return bool(heights > LEAST_HOLLOW * np.ptp(points, axis=0).max())
