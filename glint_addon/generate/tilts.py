"""How facets lean: random slopes (n.x / n.z, n.y / n.z) of the microfacet distributions, and of a cone.

The share of the surface, seen from above, whose slope lies in a small area dp is P22(p) dp, with P22 = D cos^4 of the
normal distribution D (E. Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", Journal of
Computer Graphics Techniques 3(2), 2014). Facets of equal size, seen from above, therefore have slopes of density P22.
"""

from __future__ import annotations

import numpy as np

from .microstructure import STEEPEST
from .settings import ANGLE, FACTOR, Choice, setting

BECKMANN, GGX, CONE = "BECKMANN", "GGX", "CONE"
_CHOICES = (
    Choice(BECKMANN, "Beckmann", "Slopes are normally distributed: few facets lean far"),
    Choice(GGX, "GGX", "As many facets lean little, and more of them far: a bright centre with a wide halo"),
    Choice(CONE, "Cone", "All directions within an angle are equally frequent, with a tail beyond it if wanted"),
)
TAIL_LENGTH = 0.5  # mean angle beyond the cone of the facets in its tail, in units of the cone's angle


def distribution_setting():
    """The field of a generator that names a distribution."""
    return setting(BECKMANN, "Distribution", "How the tilts are spread", choices=_CHOICES)


def roughness_setting(default: float):
    """The field of a generator that says how far facets lean by Beckmann or GGX."""
    return setting(default, "Roughness", "How far facets lean: seen from far, they look as a Glossy BSDF of this "
                   "roughness does", low=0.0, high=1.0, quantity=FACTOR,
                   only=("distribution", (BECKMANN, GGX)))


def cone_setting():
    """The field of a generator with the half-angle of the cone."""
    return setting(0.35, "Cone", "Largest tilt of a facet that is not in the tail", low=0.0, high=1.4,
                   quantity=ANGLE, only=("distribution", (CONE,)))


def tail_setting():
    """The field of a generator with the share of facets beyond the cone."""
    return setting(0.0, "Tail", "Share of the facets that lean farther than the cone, on average by half its angle",
                   low=0.0, high=1.0, quantity=FACTOR, only=("distribution", (CONE,)))


def random_slopes(tilt, count: int, rng: np.random.Generator) -> np.ndarray:
    """Slopes float32 (count, 2) as `tilt`, which has the four settings above, says; none beyond STEEPEST.

    Where the distribution goes on beyond STEEPEST, what is beyond it is drawn anew (one in 170 at GGX of roughness 1,
    fewer by the fourth power of a smaller one), so that the density below keeps its shape.
    """
    radius = _radius(tilt, rng.random(count, np.float32), rng)
    turn = rng.random(count, np.float32) * np.float32(2 * np.pi)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1).astype(np.float32)


def _radius(tilt, uniform: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Lengths of slopes: inverse cumulative distributions of `uniform` (0..1), which is cut where STEEPEST lies."""
    if tilt.distribution == CONE:
        return np.tan(_cone_angles(tilt, uniform, rng))
    alpha = np.float32(tilt.roughness**2)
    if alpha == 0:
        return np.zeros_like(uniform)
    farthest = (STEEPEST / float(alpha)) ** 2
    if tilt.distribution == GGX:
        # P22 = alpha^2 / (pi (alpha^2 + p^2)^2), so a share p^2 / (alpha^2 + p^2) is within p.
        below = uniform * np.float32(farthest / (1 + farthest))
        return alpha * np.sqrt(below / (1 - below))
    # P22 = exp(-p^2 / alpha^2) / (pi alpha^2).
    return alpha * np.sqrt(-np.log1p(uniform * np.float32(np.expm1(-farthest))))


def _cone_angles(tilt, uniform, rng):
    """Angles uniform in solid angle up to the cone's; beyond it, for the share of the tail, an exponential law."""
    steepest = np.arctan(STEEPEST)
    angles = np.arccos(1 - uniform * np.float32(1 - np.cos(tilt.cone)))
    if tilt.tail > 0 and tilt.cone > 0:
        length = TAIL_LENGTH * tilt.cone
        reach = -np.expm1(-(steepest - tilt.cone) / length)
        beyond = tilt.cone - length * np.log1p(-rng.random(uniform.shape, np.float32) * reach)
        angles = np.where(rng.random(uniform.shape, np.float32) < tilt.tail, beyond, angles)
    return np.minimum(angles, np.float32(steepest))
