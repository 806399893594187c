"""Microstructure made from numbers: normals, presence, and a random number for each flake or grain; numpy alone."""

from .coloring import Coloring, Stop, srgb
from .colors import ramp_colors, spread_colors
from .flakes import Population
from .kinds import GENERATORS, PRESETS, as_data, of_data
from .microstructure import CLOSEST, Generator, Microstructure, encoded, normals_of, slopes_of
from .recipe import Recipe, recipe_of_text
from .settings import Setting, check_settings, settings_of

__all__ = (
    "CLOSEST",
    "GENERATORS",
    "PRESETS",
    "Coloring",
    "Generator",
    "Microstructure",
    "Population",
    "Recipe",
    "Setting",
    "Stop",
    "as_data",
    "check_settings",
    "encoded",
    "normals_of",
    "of_data",
    "ramp_colors",
    "recipe_of_text",
    "settings_of",
    "slopes_of",
    "spread_colors",
    "srgb",
)
