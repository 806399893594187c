"""Memory in words, in one unit, and how much of it tables may take unless the user says otherwise."""

from __future__ import annotations

MIB = 2**20
DEFAULT_BUDGET = 2048  # MiB: four maps of 4096^2 with all counts


def mebibytes(count: float) -> str:
    """Bytes as "12.3 MiB": three digits, and all of a whole number that has more."""
    size = count / MIB
    return f"{size:.3g} MiB" if size < 999.5 else f"{size:.0f} MiB"
