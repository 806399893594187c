"""What there is to know of one kind of Blender's lights: what `lights.kinds` says of each.

`lamp` is a light object, or a `PlacedLamp` in its stead; lengths are in metres, angles in radians.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ..nodes.driven import Driven
from .driven_matrix import DrivenMatrix


@dataclass(frozen=True)
class PlacedLamp:
    """A light object as it is where another matrix puts it: at another frame, or as a copy."""

    data: bpy.types.Light
    matrix_world: Matrix


type Lamp = bpy.types.Object | PlacedLamp


def lamp_at(lamp: bpy.types.Object, matrix: Matrix | np.ndarray) -> PlacedLamp:
    """Light object `lamp` where its world matrix is `matrix`, (4, 4)."""
    return PlacedLamp(lamp.data, Matrix(matrix))


class Kind(ABC):
    """One kind of light.

    words: what sentences call it; is_distant: whether it is a direction, as bright and as large from everywhere;
    sizes, cones, powers: properties that change how large it is, how far round it shines, and how bright it is beside
    its energy.
    """

    words = ""
    is_distant = False
    sizes: tuple[str, ...] = ()
    cones: tuple[str, ...] = ()
    powers: tuple[str, ...] = ("color", "exposure", "temperature")

    @abstractmethod
    def size(self, lamp: Lamp) -> float:
        """Half-angle of a sun; bounding radius of any other light."""

    @abstractmethod
    def driven_size(self, matrix: DrivenMatrix) -> Driven:
        """`size` of the light object that `matrix` is of."""

    @abstractmethod
    def extent(self, lamp: Lamp) -> float:
        """Area [m^2] of the surface; of a sun its projected solid angle [sr]."""

    def cone(self, _lamp: Lamp) -> float | None:
        """Half-angle of the cone around -Z in which each point of the light shines, None if it shines all around."""
        return None

    def driven_cone(self, _lamp: Lamp) -> Driven | None:
        """`cone` of a light object, as it is without the copies that an instance of its collection shows."""
        return None

    def reason_to_skip(self, _light: bpy.types.Light) -> str:
        """Why a light of this kind needs no hint wherever it is, in words, or an empty string."""
        return ""


class Local(Kind):
    """A kind of light that has a place.

    is_one_sided: whether it shines to its -Z alone; scales_cone: whether the object's scale changes its cone.
    """

    is_one_sided = False
    scales_cone = False

    @abstractmethod
    def cross_section(self, lamp: Lamp) -> float:
        """Area [m^2] that the light shows from afar, from its front if it has one."""

    @abstractmethod
    def spread_out(self, lamp: Lamp, distance: np.ndarray) -> np.ndarray:
        """Area [m^2] over which all its light is spread at `distance` (n,), in the middle of where it shines."""
