"""The numbers that the headers of osl/ define, for their twins."""

from __future__ import annotations

import re

from glint_addon.paths import shader_file


def constants(header: str) -> dict[str, float]:
    """The numbers that osl/`header` defines, by name."""
    text = shader_file(header).read_text(encoding="utf-8")
    found = re.findall(r"^#define (\w+) (-?[\d.]+(?:e-?\d+)?)$", text, re.MULTILINE)
    return {name: float(value) for name, value in found}
