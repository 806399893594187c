"""What a preparation did, found and left out: the report that it fills in on its way."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any


@dataclass
class ReportCounts:
    """How much was baked, and how much the scene uses; each table file counts once, however many groups read it."""

    tables_baked: int = 0
    tables_in_use: int = 0
    bytes_baked: int = 0
    bytes_in_use: int = 0
    images_read: int = 0


@dataclass
class Report:
    """The report of a preparation; `prepare.scene.prepare_scene` says what each field means."""

    hints: list[str] = field(default_factory=list)
    skipped_lights: list[list[str]] = field(default_factory=list)
    hints_by_material: dict[str, list[str]] = field(default_factory=dict)
    left_by_material: dict[str, list[list[str]]] = field(default_factory=dict)
    baked: list[str] = field(default_factory=list)
    reused: list[str] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)
    levels: dict[str, list[int] | None] = field(default_factory=dict)
    mip_levels: list[str] = field(default_factory=list)
    osl: bool = False
    device: str = "CPU"
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    counts: ReportCounts = field(default_factory=ReportCounts)

    def add_table(self, path: Path, *, was_baked: bool, groups: int) -> None:
        """Add a table that so many groups read: baked once, if it was, and reused by the other groups."""
        self.baked += [str(path)] * was_baked
        self.reused += [str(path)] * (groups - was_baked)

    def count_tables(self) -> None:
        """Count the tables that were added; their files must be there."""
        baked, used = ({Path(path) for path in names} for names in (self.baked, self.baked + self.reused))
        counts = self.counts
        counts.tables_baked, counts.tables_in_use = len(baked), len(used)
        counts.bytes_baked, counts.bytes_in_use = (sum(path.stat().st_size for path in each) for each in (baked, used))

    @property
    def lit_materials(self) -> set[str]:
        """Names of the materials in view that have a light to look for."""
        return {name for name, lights in self.hints_by_material.items() if lights} - set(self.unseen)

    def as_dict(self) -> dict[str, Any]:
        """The same as plain data, for scripts."""
        return asdict(self)
