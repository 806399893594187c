"""A hint: what the lobe knows of one light, be it a lamp, an emissive mesh or a part of the world."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..nodes.driven import Driven, Keyed

# Numbers that stand still, that drivers follow, or that have keys.
Numbers = tuple[Driven | Keyed | float, ...]


@dataclass(frozen=True)
class Ball:
    """Bounding ball of the faces of a mesh that shine, in the object's own space."""

    centre: tuple[float, float, float]
    radius: float


@dataclass(frozen=True)
class Pose:
    """Where a copy of a light is at one frame: its direction (sun) or position [m], None if it is not shown; its size
    as in `Hint`."""

    frame: int
    place: tuple[float, float, float] | None
    size: float


@dataclass(frozen=True)
class Instance:
    """A light that the scene shows as a copy of the light or emissive mesh `source`.

    instancer: the object that instances the collection of `source`, which drivers follow too. None where drivers cannot
    follow: then `poses` has the copy's pose at each frame of the scene, or one pose if the copy never moves.
    """

    source: bpy.types.Object
    instancer: bpy.types.Object | None = None
    poses: tuple[Pose, ...] = ()


@dataclass(frozen=True)
class Hint:
    """A light for which the lobe selects facets.

    name: as reports show it; kind: KIND_SUN or KIND_LOCAL; power: estimated irradiance [W/m^2] on the glints, for
    ranking only; size: half-angle [rad] of a sun, bounding radius [m] of other lights; object: the light or emissive
    mesh that drivers follow, None for the world and for copies; direction: unit vector towards a light of the world, in
    world space, at the present frame; live: its direction (3 numbers), kind and size, driven or with keys, None where
    nothing moves; instance: for a copy, what it copies; ball: of an emissive mesh, None for lamps.
    """

    name: str
    kind: int
    power: float
    size: float
    object: bpy.types.Object | None = None
    direction: tuple[float, float, float] | None = None
    live: Numbers | None = None
    instance: Instance | None = None
    ball: Ball | None = None

    @property
    def source(self) -> bpy.types.Object | None:
        """The light object or mesh that shines, also in a copy; None for the world."""
        return self.instance.source if self.instance else self.object

    @property
    def order(self) -> tuple[str, str]:
        """Sorts hints by name, then by the library that their object comes from: the same at every frame."""
        library = self.object.library if self.object else None
        return self.name, library.filepath if library else ""

    def middle(self, matrix: Matrix | np.ndarray) -> tuple[float, float, float]:
        """Middle of the light in world space [m] for the world matrix `matrix` of its object."""
        x, y, z = Matrix(matrix) @ Vector(self.ball.centre if self.ball else (0.0, 0.0, 0.0))
        return x, y, z
