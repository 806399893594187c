"""What is known of one light that the lobe looks for, whatever sends it out."""

from __future__ import annotations

from dataclasses import dataclass

import bpy


@dataclass(frozen=True)
class Hint:
    """A light worth looking for.

    name: as reports show it; kind: KIND_SUN or KIND_LOCAL; power: estimated irradiance [W/m^2] on the glints, for
    ranking only; size: half-angle [rad] of a sun, bounding radius [m] of other lights; object: the light or emissive
    mesh that drivers follow, None for the world; direction: unit vector towards a light of the world, in world space.
    """

    name: str
    kind: int
    power: float
    size: float
    object: bpy.types.Object | None = None
    direction: tuple[float, float, float] | None = None

    @property
    def order(self) -> tuple[str, str]:
        """Sorts hints by name, then by the library that their object comes from: the same at every frame."""
        library = self.object.library if self.object else None
        return self.name, library.filepath if library else ""
