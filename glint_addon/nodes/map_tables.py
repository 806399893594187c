"""What a Glint BSDF group remembers of its map's tables, and how its OSL node is told of them.

Custom properties of the group are for the next preparation, which finds the tables again without reading the map;
sockets of the OSL node are for the render. Whatever somebody has done to the properties, reading them raises nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from .. import properties
from .builder import change_text
from .flake_nodes import flake_color_of

SCRIPT_NODE = "Glint"  # the OSL node of a Glint BSDF group
# Where a group keeps the paths of its tables: properties, and sockets of its OSL node. The table of normals is first.
PATHS = (properties.TABLE, properties.INDEX, properties.COUNTS, properties.FLAKES)
PATH_SOCKETS = ("Table", "IndexTable", "CountsTable", "FlakesTable")
UNBOUNDED = 1e6  # slope: steeper slopes count as unbounded in the shader
# Kinds of numbers that Blender keeps in an array.
WHOLE, NUMBERS = ("i",), ("i", "f", "d")

Pair = tuple[float, float]


@dataclass(frozen=True)
class CountsTable:
    """The counts of a map: path of their table, "" for none; levels: sides of the blocks of the first and the last, in
    texels; low, high: corners of their slope box. These three are None where they are not known."""

    path: str = ""
    levels: tuple[int, int] | None = (0, 0)
    low: Pair | None = (0.0, 0.0)
    high: Pair | None = (0.0, 0.0)

    @classmethod
    def of(cls, group) -> CountsTable:
        """What a node group remembers; see `MapTables.of`."""
        levels = _pair(group, properties.COUNTS_LEVELS, WHOLE)
        corners = (_pair(group, name, NUMBERS) for name in (properties.BIN_LOW, properties.BIN_HIGH))
        return cls(stored_text(group, properties.COUNTS), levels, *corners)

    @property
    def is_known(self) -> bool:
        """Whether there are counts, with all that the OSL node must be told of them."""
        return self.path != "" and None not in (self.levels, self.low, self.high) and self.levels[0] > 0


NO_COUNTS = CountsTable()


@dataclass(frozen=True)
class MapTables:
    """The tables of a map, read in one way; paths are as `paths.stored_path` has them, "" for none.

    path: of the table of normals; size: (width, height) of the map in texels; slope_low, slope_high: its smallest and
    largest slopes along u and v; these are None where they are not known; index: path; flakes: path of the table of
    flakes; source: `map_state` of the map whose tables these are, "" where that is not known.
    """

    path: str = ""
    size: tuple[int, int] | None = None
    slope_low: Pair | None = None
    slope_high: Pair | None = None
    counts: CountsTable = NO_COUNTS
    index: str = ""
    source: str = ""
    flakes: str = ""

    @classmethod
    def of(cls, group) -> MapTables:
        """What a node group remembers; what is missing or damaged counts as not known."""
        return cls(
            stored_text(group, properties.TABLE),
            _pair(group, properties.SIZE, WHOLE),
            _pair(group, properties.SLOPE_LOW, NUMBERS),
            _pair(group, properties.SLOPE_HIGH, NUMBERS),
            CountsTable.of(group),
            stored_text(group, properties.INDEX),
            stored_text(group, properties.SOURCE),
            stored_text(group, properties.FLAKES),
        )

    @classmethod
    def none_for(cls, size) -> MapTables:
        """No tables, for a map of `size` (width, height) texels that is left to Blender's own nodes."""
        return cls("", tuple(size), (0.0, 0.0), (0.0, 0.0))

    @property
    def is_known(self) -> bool:
        """Whether there is a table of normals with all that the OSL node must be told of it."""
        return self.path != "" and None not in (self.size, self.slope_low, self.slope_high)

    @property
    def has_bounds(self) -> bool:
        """Whether the map's slopes are known and bounded, so that the shader knows them too."""
        if self.slope_low is None or self.slope_high is None:
            return False
        return all(abs(slope) < UNBOUNDED for slope in (*self.slope_low, *self.slope_high))

    @property
    def paths(self) -> list[str]:
        """The paths of all tables that there are."""
        return [path for path in (self.path, self.index, self.counts.path, self.flakes) if path]

    def from_source(self, source: str) -> MapTables:
        """The same as tables of a map whose `map_state` is `source`; nothing to tell where there is no table."""
        return replace(self, source=source if self.path else "")

    def write_to(self, group):
        """Let a Glint BSDF group remember these tables, and its OSL node, if it has one, read them."""
        counts = self.counts
        group[properties.TABLE], group[properties.SOURCE] = self.path, self.source
        group[properties.SIZE] = self.size
        group[properties.SLOPE_LOW], group[properties.SLOPE_HIGH] = self.slope_low, self.slope_high
        group[properties.COUNTS], group[properties.COUNTS_LEVELS] = counts.path, counts.levels
        group[properties.BIN_LOW], group[properties.BIN_HIGH] = counts.low, counts.high
        group[properties.INDEX], group[properties.FLAKES] = self.index, self.flakes
        script = group.nodes.get(SCRIPT_NODE)
        if script is not None:
            has_colors = self.flakes != "" and flake_color_of(group) is not None
            for name, value in (self.socket_values() | {"FlakeColors": int(has_colors)}).items():
                script.inputs[name].default_value = value

    def socket_values(self) -> dict:
        """The values of the OSL node's sockets, by name."""
        counts = self.counts
        first, last = counts.levels
        return {
            "Table": self.path,
            "Width": float(self.size[0]),
            "Height": float(self.size[1]),
            "SlopeLow": (*self.slope_low, 0.0) if self.has_bounds else (0.0, 0.0, 0.0),
            "SlopeHigh": (*self.slope_high, 0.0) if self.has_bounds else (0.0, 0.0, 0.0),
            "IndexTable": self.index,
            "CountsTable": counts.path,
            "CountsFirst": first,
            "CountsLevels": (last // first).bit_length() if counts.path else 0,
            "BinLow": (*counts.low, 0.0),
            "BinHigh": (*counts.high, 0.0),
            "FlakesTable": self.flakes,
        }


def forget_table(group):
    """Let a group be one whose map has no table yet: the next preparation bakes it."""
    group[properties.TABLE] = group[properties.SOURCE] = ""


def change_paths(group, change):
    """Let change(path) say what stands for each path of a table that a Glint BSDF group names."""
    for name in PATHS:
        stored = stored_text(group, name)
        if stored and (path := change(stored)) != stored:
            group[name] = path
    script = group.nodes.get(SCRIPT_NODE)
    for name in PATH_SOCKETS:
        change_text(script.inputs.get(name) if script is not None else None, change)


def stored_text(group, name: str) -> str:
    """A path or state that a group keeps as a custom property; "" where there is none."""
    text = group.get(name, "")
    return text if isinstance(text, str) else ""


def _pair(group, name: str, kinds) -> tuple | None:
    """Two numbers, of a kind of `kinds`, that a group keeps as a custom property; None where there are none."""
    value = group.get(name)
    return tuple(value) if getattr(value, "typecode", "") in kinds and len(value) == 2 else None
