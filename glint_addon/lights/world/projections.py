"""How pictures of worlds are laid around the viewer, as Cycles has it (kernel/camera/projection.h).

Columns count from the left, rows from the bottom; directions are unit vectors in the texture's own space, Z up.
"""

from __future__ import annotations

from math import pi

import numpy as np


class Equirectangular:
    """Longitude over latitude, the whole sphere."""

    wraps = True

    def __init__(self, height: int, width: int) -> None:
        self.height, self.width = height, width

    def solid_angle(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Solid angle [sr] of the texels at integer rows and columns."""
        low, high = ((rows + step) * pi / self.height - pi / 2 for step in (0, 1))
        return (np.sin(high) - np.sin(low)) * 2 * pi / self.width + 0 * columns

    def direction(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Unit vectors (..., 3) through the texels' centres."""
        longitude = pi - 2 * pi * (columns + 0.5) / self.width
        latitude = pi * (rows + 0.5) / self.height - pi / 2
        flat = np.cos(latitude)
        return np.stack([flat * np.cos(longitude), flat * np.sin(longitude), np.sin(latitude) + 0 * columns], axis=-1)


class MirrorBall:
    """The world in a mirrored sphere, seen along +Y: every texel of the disk has the same solid angle."""

    wraps = False

    def __init__(self, height: int, width: int) -> None:
        self.height, self.width = height, width

    def solid_angle(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Solid angle [sr] of the texels at integer rows and columns, 0 if a texel's centre is off the disk."""
        x, z = self._place(rows, columns)
        return np.where(x**2 + z**2 <= 1, 16 / (self.width * self.height), 0.0)

    def direction(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Unit vectors (..., 3) through the texels' centres."""
        x, z = self._place(rows, columns)
        # The sphere's normal (x, -y, z) mirrors a ray along +Y.
        y = np.sqrt(np.maximum(1 - x**2 - z**2, 0))
        return np.stack([2 * y * x, 1 - 2 * y**2, 2 * y * z], axis=-1)

    def _place(self, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, z = np.broadcast_arrays(2 * (columns + 0.5) / self.width - 1, 2 * (rows + 0.5) / self.height - 1)
        return x, z


Projection = Equirectangular | MirrorBall
PROJECTIONS: dict[str, type[Projection]] = {"EQUIRECTANGULAR": Equirectangular, "MIRROR_BALL": MirrorBall}
