"""All that a generated map is made from, and the same as text that a file keeps."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

import numpy as np

from ..errors import GenerateError
from .coloring import Coloring
from .flakes import Flakes
from .kinds import as_data, made, of_data, plain
from .microstructure import Generator, Microstructure
from .settings import check_settings


@dataclass(frozen=True)
class Recipe:
    """A generator, its resolution in texels a side, and the colours of its individuals."""

    generator: Generator = field(default_factory=Flakes)
    resolution: int = 2048
    coloring: Coloring = field(default_factory=Coloring)

    def made(self, resolution: int) -> tuple[Microstructure, np.ndarray | None]:
        """The microstructure, at `resolution` instead of its own, and colours float32 (r, r, 3) or None.

        Raises GenerateError if a setting is not allowed.
        """
        check_settings(self.coloring)
        microstructure = self.generator.microstructure(resolution)
        return microstructure, self.coloring.colors(microstructure.id)

    def text(self) -> str:
        """The recipe as JSON."""
        parts = {"generator": as_data(self.generator), "resolution": self.resolution, "coloring": plain(self.coloring)}
        return json.dumps(parts)


def recipe_of_text(text: str) -> Recipe:
    """The recipe that `Recipe.text` gave; what is not in it has its default. Raises GenerateError for other texts."""
    try:
        parts = json.loads(text)
        generator, resolution = of_data(parts["generator"]), parts.get("resolution", Recipe.resolution)
        return Recipe(generator, resolution, made(Coloring, parts.get("coloring", {})))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise GenerateError("The settings of a generated map cannot be read (they are no text that Glint wrote): "
                            "generate the map again.") from error
