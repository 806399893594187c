"""How bright an IES profile is at most, read from its text as Cycles does (util/ies.cpp), to rank lamps by."""

from __future__ import annotations

from functools import lru_cache
from math import pi
from pathlib import Path

import bpy

# Factor of Cycles where a profile is missing or cannot be read (`kernel_ies_interp`).
WITHOUT_PROFILE = 100.0
# Candela to the watts of a lamp that shines all around: luminous efficacy of daylight, 177.83 lumens a watt.
WATTS = 4 * pi / 177.83


def peak_strength(node: bpy.types.ShaderNode) -> float:
    """Largest factor of an IES Texture node whose Strength is 1."""
    try:
        return _largest(_text(node))
    except (OSError, ValueError):
        return WITHOUT_PROFILE


def _text(node: bpy.types.ShaderNode) -> str:
    """The profile's text. Raises OSError if its file cannot be read."""
    if node.mode == "INTERNAL":
        return node.ies.as_string() if node.ies else ""
    path = Path(bpy.path.abspath(node.filepath, library=node.id_data.library))
    return path.read_text(encoding="latin-1")


@lru_cache(maxsize=64)
def _largest(text: str) -> float:
    """Largest value of a profile [W]. Raises ValueError if the text is no profile."""
    _, mark, rest = text.replace(",", " ").partition("\nTILT=")
    kind, _, rest = rest.partition("\n")
    numbers = rest.split()
    if not mark or not numbers:
        raise ValueError("no profile")
    if kind.startswith("INCLUDE"):
        numbers = numbers[2 + 2 * int(numbers[1]):] if len(numbers) > 1 else []
    if len(numbers) < 13:
        raise ValueError("too short")
    # Lamps, lumens, multiplier, numbers of angles, type, unit, three lengths, two factors, watts.
    factor = float(numbers[2]) * float(numbers[10]) * float(numbers[11])
    vertical, horizontal = int(numbers[3]), int(numbers[4])
    start = 13 + vertical + horizontal
    values = [float(number) for number in numbers[start:start + vertical * horizontal]]
    if not values or len(values) < vertical * horizontal:
        raise ValueError("too short")
    return WATTS * factor * max(values)
