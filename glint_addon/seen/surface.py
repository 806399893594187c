"""A mesh in patches: pieces of surface small enough that a light and a camera see each of them from one side."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from .cameras import CameraView

SIDES = 12  # patches along the longest side of the mesh
FEWEST = 512  # triangles; fewer are cut, so that a floor of one face has patches too
MOST_CUTS = 6  # of a triangle, each into four; 4096 pieces are more than there are patches


@dataclass(frozen=True)
class Patches:
    """Pieces of surface. centres, normals (unit): (n, 3); areas: (n,) [m^2]; radii: (n,), of the balls that hold
    them; spreads: (n,) largest angle [rad] between a patch's normal and the shading normals on it; are_closed: whether
    together they enclose a volume, so that none is seen from behind."""

    centres: np.ndarray
    areas: np.ndarray
    radii: np.ndarray
    normals: np.ndarray
    spreads: np.ndarray
    are_closed: bool

    def moved(self, matrix: np.ndarray) -> Patches:
        """The patches under a rigid motion, (4, 4)."""
        turn = matrix[:3, :3]
        centres = self.centres @ turn.T + matrix[:3, 3]
        return Patches(centres, self.areas, self.radii, self.normals @ turn.T, self.spreads, self.are_closed)


# The patches of an object at each of some frames, with its largest ratio of scales.
PatchesOver = list[tuple[Patches, float]]


def surface_patches(mesh: bpy.types.Mesh, matrix: np.ndarray) -> Patches:
    """The patches of a mesh in world space; matrix: (4, 4), mesh to world."""
    points, normals = _triangles(mesh, matrix)
    longest = np.ptp(points.reshape(-1, 3), axis=0).max()
    for _ in range(MOST_CUTS):
        sides = np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2).max(axis=1)
        large = sides > longest / SIDES
        if len(points) > FEWEST or not large.any():
            break
        points, normals = (np.concatenate([each[~large], _cut(each[large])]) for each in (points, normals))

    # Gather triangles of one cube of space that face the same way.
    middle = points.mean(axis=1)
    with np.errstate(invalid="ignore"):  # places that are NaN may go to any cube: nobody sees a glint there
        cube = np.floor((middle - middle.min(axis=0)) / max(longest, 1e-12) * SIDES).astype(int)
    facing = normals.mean(axis=1)
    side = np.argmax(np.abs(facing), axis=1)
    is_back = np.take_along_axis(facing, side[:, None], axis=1)[:, 0] < 0
    keys = np.column_stack([cube, side, is_back])
    _, patch, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    patch = patch.ravel()

    centres, sums = np.zeros((len(counts), 3)), np.zeros((len(counts), 3))
    np.add.at(centres, patch, middle)
    np.add.at(sums, patch, facing)
    centres /= counts[:, None]
    axes = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
    radii, cosines = np.zeros(len(counts)), np.ones(len(counts))
    with np.errstate(invalid="ignore"):  # their balls and spreads are NaN too
        np.maximum.at(radii, patch, np.linalg.norm(points - centres[patch][:, None], axis=2).max(axis=1))
        np.minimum.at(cosines, patch, (normals * axes[patch][:, None]).sum(axis=2).min(axis=1))
    crossed = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    areas = np.bincount(patch, 0.5 * np.linalg.norm(crossed, axis=1), len(counts))
    return Patches(centres, areas, radii, axes, np.arccos(np.clip(cosines, -1.0, 1.0)), is_closed(mesh))


def pixels_filled(view: CameraView, patches: Patches) -> tuple[np.ndarray, np.ndarray]:
    """About how many pixels of a camera each patch (n,) fills, if nothing hides it; whether it is in the picture."""
    places = patches.centres @ view.inverse[:3, :3].T + view.inverse[:3, 3]
    normals = patches.normals @ view.inverse[:3, :3].T
    depth = -places[:, 2:] if view.is_perspective else np.ones((len(places), 1))
    is_in_picture = ((places[:, :2] >= view.low * depth) & (places[:, :2] <= view.high * depth)).all(axis=1)
    if view.is_perspective:
        distance = np.maximum(np.linalg.norm(places, axis=1), 1e-12)
        shown = -(places * normals).sum(axis=1) / distance**3
    else:
        shown = normals[:, 2]
    reach = patches.radii[:, None]
    is_within = ((places - reach).min(axis=0) < 0.0).all() and ((places + reach).max(axis=0) > 0.0).all()
    shown = np.maximum(shown, 0.0) if patches.are_closed and not is_within else np.abs(shown)
    return patches.areas * shown / view.pixel**2, is_in_picture & (places[:, 2] < 0.0)


def is_closed(mesh: bpy.types.Mesh) -> bool:
    """Whether each edge of a mesh is between two faces, and all of them face away from the volume within."""
    count = len(mesh.loops)
    edges, corners = (_values(mesh.loops, name, np.int32, 1)[:, 0] for name in ("edge_index", "vertex_index"))
    starts = _values(mesh.edges, "vertices", np.int32, 2)[:, 0]
    runs_along = 2 * (corners == starts[edges]) - 1
    uses = np.bincount(edges, minlength=len(starts)), np.bincount(edges, runs_along, len(starts))
    if not count or (uses[0] != 2).any() or uses[1].any():
        return False
    loops = _values(mesh.loop_triangles, "vertices", np.int32, 3)
    points = _values(mesh.vertices, "co", np.float32, 3).astype(float)[loops]
    points -= points.mean(axis=(0, 1))
    return bool(np.linalg.det(points).sum() > 0.0)


def _triangles(mesh: bpy.types.Mesh, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3, 3) of the mesh's triangles and the shading normals there, in world space."""
    mesh.calc_loop_triangles()
    loops = _values(mesh.loop_triangles, "loops", np.int32, 3)
    corners = _values(mesh.loop_triangles, "vertices", np.int32, 3)
    points = _values(mesh.vertices, "co", np.float32, 3).astype(float)[corners]
    normals = _values(mesh.corner_normals, "vector", np.float32, 3).astype(float)[loops]
    points = points @ matrix[:3, :3].T + matrix[:3, 3]
    normals = normals @ np.linalg.inv(matrix[:3, :3])
    return points, normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)


def _cut(corners: np.ndarray) -> np.ndarray:
    """Four triangles (4 n, 3, 3) from each, cut between the middles of its sides; normals stay nearly unit vectors."""
    a, b, c = corners.transpose(1, 0, 2)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(each, axis=1) for each in four])


def _values(collection: bpy.types.bpy_prop_collection, name: str, kind: type[np.generic], width: int) -> np.ndarray:
    """A property of all members, (n, width)."""
    values = np.empty(len(collection) * width, kind)
    collection.foreach_get(name, values)
    return values.reshape(-1, width)
