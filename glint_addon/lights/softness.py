"""Lights so large that glints need no hint for them: one rule for suns, lamps, areas and meshes.

The rule is about solid angle, not about width: the chance that a normal drawn at random mirrors a light is proportional
to the light's solid angle, so a long thin tube is as noisy as a small disk.
"""

from __future__ import annotations

from math import asin, pi, radians, sqrt

import numpy as np
from mathutils import Vector

# A sun of this half-angle moves the half vector by half of it, 7.5 degrees, as much as the texels of most normal maps
# do: a normal drawn at random mirrors such a sun so often that the picture has little noise without a hint:
# decision 43.
SOFT_HALF_ANGLE = radians(15.0)
TOO_SOFT = "so large, as all glints see it, that plain sampling is already smooth"


def least_half_angle(position: np.ndarray | Vector, cross_section: float, low: np.ndarray, high: np.ndarray) -> float:
    """Half-angle [rad] of a disk as large as the light looks, from the corner of boxes furthest from it.

    position: of the light, and low, high: (n, 3), corners of the boxes, in world space [m]; cross_section [m^2]: area
    of the light as seen from afar.
    """
    corner = np.maximum(np.abs(low - position), np.abs(high - position))
    distance = np.linalg.norm(corner, axis=1).max(initial=0.0)
    radius = sqrt(cross_section / pi)
    return asin(radius / distance) if radius < distance else pi / 2
