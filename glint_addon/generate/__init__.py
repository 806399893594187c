"""Microstructure made from numbers: normals, presence, and a random number for each flake or grain; numpy alone."""

from .colors import ramp_colors, spread_colors
from .flakes import Population
from .kinds import GENERATORS, PRESETS, as_data, of_data
from .microstructure import Generator, Microstructure, encoded, normals_of, slopes_of
from .settings import Setting, settings_of

__all__ = (
    "GENERATORS",
    "PRESETS",
    "Generator",
    "Microstructure",
    "Population",
    "Setting",
    "as_data",
    "encoded",
    "normals_of",
    "of_data",
    "ramp_colors",
    "settings_of",
    "slopes_of",
    "spread_colors",
)
