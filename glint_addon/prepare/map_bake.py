"""The bake of what a normal map lacks: its table of normals, its index and its counts, a job each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import paths
from ..bake.counts import bake_counts
from ..bake.flakes import bake_flakes
from ..bake.normal_map import decoded_normals, flake_normals, slope_bounds
from ..bake.slope_index import bake_index
from ..bake.table import bake_table
from ..images import image_pixels
from ..nodes.map_tables import NO_COUNTS, CountsTable, MapTables
from .flake_images import are_flakes, flake_colors
from .jobs import Job, Steps
from .map_plans import MapPlan
from .report import Report
from .stored_tables import damaged_tables

# Parts of a map's work: table of normals, index, flakes, counts.
TABLE_SHARE, INDEX_SHARE, FLAKES_SHARE, COUNTS_SHARE = 0.2, 0.3, 0.2, 0.5


@dataclass
class DecodedMap:
    """The map that was decoded last: the next plan may read the same one in another way. Only one map is kept, because
    a large one takes gigabytes."""

    key: tuple[Any, ...] | None = None
    normals: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 3), np.float32))

    def of(self, plan: MapPlan, report: Report) -> np.ndarray:
        """The normals of a plan's map, 0 where no flake is; counts the image in `report` if it is read. Raises
        MapError."""
        key = plan.image_read, plan.binding.convention, plan.binding.presence
        if key != self.key:
            self.key, self.normals = None, np.empty((0, 0, 3), np.float32)
            report.counts.images_read += 1
            self.normals = decoded_normals(
                image_pixels(plan.image_read), convention=plan.binding.convention, name=plan.image.name)
            presence, image = are_flakes(plan.groups[0]), plan.binding.presence
            if presence is not None:
                self.normals = flake_normals(self.normals, presence, name=image.name if image else "")
            self.key = key
        return self.normals


def bake_plan(
    plan: MapPlan, folder: Path, report: Report, decoded: DecodedMap, start: float, end: float
) -> Steps[MapTables]:
    """Bake what is missing of a map: a generator of jobs, to be sent what each returns; it returns the map's tables.

    start, end: part of the whole work, 0..1. Adds to `report`. Raises MapError.
    """
    if not plan.has_table:
        return MapTables.none_for(plan.size)
    ready = plan.tables_ready()
    if ready is not None:  # not even the pixels are read
        for path in ready.paths:
            report.add_table(paths.disk_path(path), was_baked=False, groups=len(plan.groups))
        return ready
    report.notes += [f"Table {file.name} is damaged, or of an older version: it is baked again."
                     for file in damaged_tables(plan.groups)]
    return (yield from _baked(plan, decoded.of(plan, report), folder, report, start, end))


def _baked(
    plan: MapPlan, normals: np.ndarray, folder: Path, report: Report, start: float, end: float
) -> Steps[MapTables]:
    """`bake_plan` of a map whose normals are known."""
    shares = (TABLE_SHARE, INDEX_SHARE * plan.has_index, FLAKES_SHARE * plan.binding.has_flakes,
              COUNTS_SHARE * (plan.levels is not None))
    ends = [start + (end - start) * sum(shares[: part + 1]) / sum(shares) for part in range(len(shares))]
    name, interpolation = plan.image.name, plan.interpolation

    def note(path: Path, was_baked: bool) -> str:
        report.add_table(path, was_baked=was_baked, groups=len(plan.groups))
        return paths.stored_path(path)

    job: Callable[..., Any] = partial(bake_table, normals, folder, interpolation=interpolation)
    path = note(*(yield Job(f'Baking "{name}"', start, ends[0], job)))
    index, flakes, counts = "", "", NO_COUNTS
    if plan.has_index:
        job = partial(bake_index, normals, folder)
        index = note(*(yield Job(f'Sorting "{name}"', ends[0], ends[1], job)))
    if plan.binding.has_flakes:
        image = plan.binding.flake_color
        job = partial(bake_flakes, normals, flake_colors(plan.groups[0]), folder, name=image.name if image else "")
        flakes = note(*(yield Job(f'Collecting flakes of "{name}"', ends[1], ends[2], job)))
    if plan.levels is not None:
        job = partial(bake_counts, normals, folder, interpolation=interpolation, levels=plan.levels)
        counts_path, was_baked, low, high = yield Job(f'Counting "{name}"', ends[2], ends[3], job)
        counts = CountsTable(note(counts_path, was_baked), plan.levels, _floats(low), _floats(high))
    low, high = slope_bounds(normals)
    return MapTables(path, (normals.shape[1], normals.shape[0]), _floats(low), _floats(high), counts, index,
                     flakes=flakes)


def _floats(bound: np.ndarray) -> tuple[float, float]:
    low, high = bound
    return float(low), float(high)
