"""Numpy twin of osl/footprint.h: float64, one row for each footprint. Vectors are (n, 3), the rest (n,)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FOOTPRINT_SCALE = 1.1
FOOTPRINT_EXPONENT = 0.21
LEAST_COSINE = 1e-4
LEAST_AXES_SINE = 1e-6
KERNEL_VARIANCE = 0.125
CAUSTIC_AREA = 64.0  # texels
CAUSTIC_ANGLE = 0.05


@dataclass
class Footprint:
    """Texel offset of kernel coordinates (x, y) in the unit disk is (ux x + uy y, vx x + vy y); the rest as in OSL."""

    ux: np.ndarray
    uy: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    xu: np.ndarray
    xv: np.ndarray
    yu: np.ndarray
    yv: np.ndarray
    area: np.ndarray
    long_axis: np.ndarray
    short_axis: np.ndarray

    def at(self, rows):
        """The footprints of some rows, each as often as it is named."""
        return Footprint(*(getattr(self, name)[rows] for name in FIELDS))

    def axes(self):
        """The texel offsets (n, 2, 2) of the kernel's axes, in columns."""
        return np.stack([self.ux, self.uy, self.vx, self.vy], axis=-1).reshape(-1, 2, 2)


FIELDS = tuple(Footprint.__dataclass_fields__)


def footprint_radius(samples):
    """Radius in pixels that one of `samples` samples covers."""
    return FOOTPRINT_SCALE * np.maximum(samples, 1.0) ** -FOOTPRINT_EXPONENT


def cone_on_surface(dpdx, dpdy, view, geometric_normal, radius):
    """Kernel coordinates -> surface (n, 2, 2) in units of dpdx and dpdy, for ray cones of `radius` pixels.

    The stretch is the square root of 1 + q q^T, through its eigenvectors, where OSL has the closed form.
    """
    cone = np.linalg.norm(dpdx, axis=-1)
    cosine = np.maximum(np.abs(np.einsum("nk,nk->n", view, geometric_normal)), LEAST_COSINE)
    q = np.stack([np.einsum("nk,nk->n", view, dpdx), np.einsum("nk,nk->n", view, dpdy)], -1) / (cone * cosine)[:, None]
    values, vectors = np.linalg.eigh(np.eye(2) + q[:, :, None] * q[:, None, :])
    stretch = np.einsum("nij,nj,nkj->nik", vectors, np.sqrt(values), vectors)
    return stretch * np.broadcast_to(radius, cone.shape)[:, None, None]


def surface_footprint(surface, texels):
    """Validity (n,) bool and Footprint of kernels that cover `surface` (n, 2, 2); texels: (n, 2, 2) texel coordinates
    by the units of `surface`."""
    texels = np.array(texels, float)
    lengths = np.linalg.norm(texels, axis=-1).prod(axis=-1)
    valid = np.abs(np.linalg.det(texels)) > LEAST_AXES_SINE * lengths
    texels[~valid] = np.eye(2)
    axes = texels @ surface
    inverse = np.linalg.inv(texels)
    singular = np.linalg.svd(axes, compute_uv=False)
    area = np.pi * singular[:, 0] * singular[:, 1]
    valid = valid & (singular[:, 0] < 1e9) & (area > 0)
    return valid, Footprint(
        axes[:, 0, 0], axes[:, 0, 1], axes[:, 1, 0], axes[:, 1, 1],
        inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 0], inverse[:, 1, 1],
        area, singular[:, 0], singular[:, 1],
    )


def ray_footprint(dpdx, dpdy, view, geometric_normal, radius, du_dx, du_dy, dv_dx, dv_dy):
    """Validity (n,) bool and Footprint of a ray cone.

    dpdx, dpdy: orthogonal vectors of the cone's radius on the surface; du_dx ...: texels per dpdx, dpdy.
    """
    texels = np.stack([np.stack([du_dx, du_dy], -1), np.stack([dv_dx, dv_dy], -1)], -2)
    return surface_footprint(cone_on_surface(dpdx, dpdy, view, geometric_normal, radius), texels)


def footprint_ellipse(axes, wide):
    """Forms (n, 2, 2) that are 1 on the rim of ellipses with half axes `axes` (n, 2, 2), columns, widened by `wide`
    (n, 2) squared texels along u and v; and half of their bounding boxes (n, 2)."""
    square = axes @ axes.transpose(0, 2, 1) + wide[:, :, None] * np.eye(2)
    return np.linalg.inv(square), np.sqrt(np.einsum("nii->ni", square))


def ellipse_square(form, offset):
    """Squared distance (n,) of texel offsets (n, 2) from the middle, where 1 is the rim; form: of footprint_ellipse."""
    return np.einsum("ni,nij,nj->n", offset, form, offset)


def scale_footprint(scale, footprint):
    """A footprint `scale` times as wide; what it says of the surface stays."""
    powers = dict.fromkeys(("xu", "xv", "yu", "yv"), 0) | {"area": 2}
    return Footprint(*(getattr(footprint, name) * scale ** powers.get(name, 1) for name in FIELDS))


def caustic_scale(area, radius, distance):
    """By how much footprints of `area` texels and `radius` metres are widened after a diffuse bounce."""
    return np.minimum(np.sqrt(CAUSTIC_AREA / area), CAUSTIC_ANGLE * distance / radius)


def is_drawn(sure, odds, weights):
    """Which of successive elements (k,) are visited, their weights then, and whether no sum is so near a whole number
    that rounding may decide: light elements are drawn where the sum of their probabilities passes a whole number."""
    light = weights < sure
    sums = odds + np.concatenate([[0.0], np.cumsum(np.where(light, weights / sure if sure > 0 else 0.0, 0.0))])
    drawn = np.where(light, np.floor(sums[1:]) > np.floor(sums[:-1]), weights > 0)
    clear = np.abs(sums - np.round(sums)).min() > 1e-5 if light.any() else True
    return drawn, np.where(light & drawn, sure, np.where(drawn, weights, 0.0)), clear


def footprint_kernel(t):
    """Kernel over the unit disk, t = x^2 + y^2."""
    return np.where(t < 1.0, (1.0 - t) ** 2, 0.0)


def footprint_sample(a, b):
    """Points (x, y) of the unit disk distributed as the kernel; a, b uniform in 0..1."""
    r = np.sqrt(np.maximum(1.0 - np.cbrt(1.0 - np.asarray(a, float)), 0.0))
    return r * np.cos(2 * np.pi * b), r * np.sin(2 * np.pi * b)
