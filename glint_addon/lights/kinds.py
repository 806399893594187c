"""The kinds of Blender's lights: all that Glint knows of a sun, a point, a spot and an area light, in one table.

What is read of a light in Python, to rank lights, stands beside the driver that follows it; a test compares the two for
every kind. `lamp` is a light object, or a `PlacedLamp` in its stead. Sizes, areas and cones are those of Cycles
(scene/light.cpp), lengths in metres, angles in radians.
"""

from __future__ import annotations

from math import atan, hypot, pi, sin, tan

import bpy
import numpy as np

from ..animation.curves import is_animated
from ..nodes.driven import Driven
from .driven_matrix import DrivenMatrix, object_property
from .kind import Kind, Lamp, Local
from .softness import SOFT_HALF_ANGLE, TOO_SOFT

# Half the diagonal of a rectangle, half the longest axis of an ellipse, from the squared lengths of the axes. Cycles
# scales both by the lengths of the object's world axes (`AreaLight::copy_to_kernel`); under shear the diagonal is
# longer, by a factor of sqrt(2) at most.
AREA_RADIUS = {
    "SQUARE": "0.5*width*sqrt({x}+{y})",
    "RECTANGLE": "0.5*sqrt(width*width*({x})+height*height*({y}))",
    "DISK": "0.5*width*sqrt(max({x},{y}))",
    "ELLIPSE": "0.5*sqrt(max(width*width*({x}),height*height*({y})))",
}
ROUND = {"DISK", "ELLIPSE"}
# Largest angle [rad] of a spot's cone, whose half is given to a tangent: that of pi / 2 in 32 bits is negative, and the
# cone of a spot of 180 degrees would hold nothing.
WIDEST_CONE = 3.14
TWO_SIDES = {"RECTANGLE", "ELLIPSE"}  # squares and disks have one length for both
PORTAL = "a portal, which sends out no light of its own"


class Sun(Kind):
    """A direction from which light comes; the object's scale changes nothing."""

    words = "a sun"
    is_distant = True
    sizes = ("angle",)

    def size(self, lamp: Lamp) -> float:
        return lamp.data.angle / 2

    def driven_size(self, matrix: DrivenMatrix) -> Driven:
        return Driven("angle / 2", (object_property("angle", matrix.object, "data.angle"),))

    def extent(self, lamp: Lamp) -> float:
        return pi * sin(lamp.data.angle / 2) ** 2

    def reason_to_skip(self, light: bpy.types.Light) -> str:
        return TOO_SOFT if light.angle / 2 > SOFT_HALF_ANGLE and not is_animated(light, "angle") else ""


class Point(Local):
    """A ball, which Cycles does not scale with the object."""

    words = "a point light"
    sizes = ("shadow_soft_size",)

    def size(self, lamp: Lamp) -> float:
        return lamp.data.shadow_soft_size

    def driven_size(self, matrix: DrivenMatrix) -> Driven:
        return Driven("radius", (object_property("radius", matrix.object, "data.shadow_soft_size"),))

    def extent(self, lamp: Lamp) -> float:
        return 4 * pi * lamp.data.shadow_soft_size**2

    def cross_section(self, lamp: Lamp) -> float:
        return self.extent(lamp) / 4

    def spread_out(self, lamp: Lamp, distance: np.ndarray) -> np.ndarray:
        return 4 * pi * distance.clip(self.size(lamp)) ** 2


class Spot(Point):
    """A ball that shines in a cone, which the object's scale stretches along its X and Y; the ball it does not."""

    words = "a spot"
    scales_cone = True
    cones = ("spot_size",)
    powers = (*Kind.powers, "spot_size")

    def cone(self, lamp: Lamp) -> float:
        """The wider half-angle of a stretched cone."""
        x, y, z = (lamp.matrix_world.col[axis].length for axis in range(3))
        return atan(tan(min(lamp.data.spot_size, WIDEST_CONE) / 2) * max(x, y) / z) if z else pi / 2

    def driven_cone(self, lamp: Lamp) -> Driven:
        matrix = DrivenMatrix(lamp)  # the product of both matrices would not fit the 255 characters of an expression
        x, y, z = (matrix.squared_length(column) for column in range(3))
        expression = f"atan(tan(min(angle,{WIDEST_CONE})/2)*sqrt(max({x},{y})/max({z},1e-30)))"
        return matrix.driven(expression, object_property("angle", lamp, "data.spot_size"))


class Area(Local):
    """A flat piece, which Cycles scales by the lengths of the object's world axes. It cuts the spread at the same angle
    all round."""

    words = "an area light"
    is_one_sided = True
    sizes = ("size", "size_y")
    cones = ("spread",)
    powers = (*Kind.powers, "size", "size_y")

    def size(self, lamp: Lamp) -> float:
        width, height = self._sides(lamp)
        return max(width, height) / 2 if lamp.data.shape in ROUND else hypot(width, height) / 2

    def driven_size(self, matrix: DrivenMatrix) -> Driven:
        lamp = matrix.object
        expression = AREA_RADIUS[lamp.data.shape].format(x=matrix.squared_length(0), y=matrix.squared_length(1))
        sides = (object_property("width", lamp, "data.size"), object_property("height", lamp, "data.size_y"))
        return matrix.driven(expression, *(side for side in sides if side.name in expression))

    def extent(self, lamp: Lamp) -> float:
        width, height = self._sides(lamp)
        return width * height * (pi / 4 if lamp.data.shape in ROUND else 1)

    def cross_section(self, lamp: Lamp) -> float:
        return self.extent(lamp)

    def spread_out(self, lamp: Lamp, distance: np.ndarray) -> np.ndarray:
        """Exact on the axis of a disk; close by it is what the surface itself sends out."""
        return _beam_part(self.cone(lamp)) * pi * distance**2 + self.extent(lamp)

    def cone(self, lamp: Lamp) -> float:
        return lamp.data.spread / 2

    def driven_cone(self, lamp: Lamp) -> Driven:
        return Driven("spread / 2", (object_property("spread", lamp, "data.spread"),))

    def reason_to_skip(self, light: bpy.types.Light) -> str:
        return PORTAL if light.cycles.is_portal else ""

    def _sides(self, lamp: Lamp) -> tuple[float, float]:
        """Width and height in metres."""
        light = lamp.data
        height = light.size_y if light.shape in TWO_SIDES else light.size
        return light.size * lamp.matrix_world.col[0].length, height * lamp.matrix_world.col[1].length


# By Blender's `Light.type`.
KINDS: dict[str, Kind] = {"SUN": Sun(), "POINT": Point(), "SPOT": Spot(), "AREA": Area()}


def kind_of(lamp: Lamp) -> Kind:
    """The kind of a light object."""
    return KINDS[lamp.data.type]


def may_change_size(data: bpy.types.ID) -> bool:
    """Whether anything animates how large the light is whose data are `data`: lamps', or an emissive object's."""
    return _any_animated(data, "sizes")


def may_change_cone(data: bpy.types.ID) -> bool:
    """Whether anything animates how far round a light shines."""
    return _any_animated(data, "cones")


def may_change_power(data: bpy.types.ID) -> bool:
    """Whether anything animates how bright a light is, but for its energy."""
    return _any_animated(data, "powers")


def _any_animated(data: bpy.types.ID, part: str) -> bool:
    # Of all kinds, for texts that shine have a size too; a lamp's keys for another kind count, which is rare and safe.
    names = {name for kind in KINDS.values() for name in getattr(kind, part)}
    return any(is_animated(data, name) for name in names if hasattr(data, name))


def _beam_part(half_spread: float) -> float:
    """Solid angle of an area light's beam relative to one that shines all around (`AreaLight::copy_to_kernel`)."""
    return 1.0 - half_spread / tan(half_spread) if half_spread > 0 else 0.0
