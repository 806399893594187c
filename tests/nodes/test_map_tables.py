"""What a Glint BSDF group remembers of its map's tables: it comes back as it was kept, and damage is no error."""

from dataclasses import replace

import pytest

from glint_addon import properties
from glint_addon.nodes import glint_bsdf
from glint_addon.nodes.map_tables import PATHS, SCRIPT_NODE, CountsTable, MapTables, change_paths, forget_table

COUNTS = CountsTable("//glint_tables/counts.exr", (32, 128), (-0.25, -0.5), (0.5, 0.75))
TABLES = MapTables("//glint_tables/table.exr", (64, 32), (-1.0, -0.5), (0.25, 2.0), COUNTS, "//glint_tables/index.exr",
                   "map.png|1|2", "//glint_tables/flakes.exr")
# The names in files of this version: a file that is opened again must be understood.
STORED = {
    "glint_table": TABLES.path, "glint_source": TABLES.source, "glint_size": [64, 32],
    "glint_slope_low": [-1.0, -0.5], "glint_slope_high": [0.25, 2.0], "glint_index": TABLES.index,
    "glint_counts": COUNTS.path, "glint_counts_levels": [32, 128], "glint_bin_low": [-0.25, -0.5],
    "glint_bin_high": [0.5, 0.75], "glint_flakes": TABLES.flakes,
}
PAIRS = {properties.SIZE: "size", properties.SLOPE_LOW: "slope_low", properties.SLOPE_HIGH: "slope_high"}
COUNTS_PAIRS = {properties.COUNTS_LEVELS: "levels", properties.BIN_LOW: "low", properties.BIN_HIGH: "high"}
DAMAGE = (1.5, "text", [1.0, 2.0, 3.0], [], {"a": 1})


@pytest.fixture
def group(scene):
    return glint_bsdf.build()


def socket_values(group) -> dict:
    """What the OSL node is told of the tables."""
    values = ((name, group.nodes[SCRIPT_NODE].inputs[name].default_value) for name in TABLES.socket_values())
    return {name: value if isinstance(value, (str, int, float)) else tuple(value) for name, value in values}


def test_a_new_group_remembers_no_tables(group):
    tables = MapTables.of(group)
    assert (tables.path, tables.size, tables.index, tables.source) == ("", None, "", "")
    assert not tables.is_known and not tables.has_bounds and not tables.counts.is_known and tables.paths == []


def test_what_is_written_to_a_group_comes_back(group):
    TABLES.write_to(group)
    assert MapTables.of(group) == TABLES and TABLES.is_known and TABLES.counts.is_known and TABLES.has_bounds


def test_the_names_in_files_are_those_of_every_version(group):
    TABLES.write_to(group)
    kept = {name: group[name] for name in group.keys() if name != properties.STAMP}  # noqa: SIM118  (no dict)
    assert {name: value if isinstance(value, str) else list(value) for name, value in kept.items()} == STORED


def test_a_group_as_older_files_have_it_is_understood(group):
    for name, value in STORED.items():
        group[name] = value
    assert MapTables.of(group) == TABLES


def test_the_osl_node_is_told_of_the_tables(group):
    TABLES.write_to(group)
    assert socket_values(group) == {
        "Table": TABLES.path, "Width": 64.0, "Height": 32.0, "SlopeLow": (-1, -0.5, 0), "SlopeHigh": (0.25, 2, 0),
        "IndexTable": TABLES.index, "FlakesTable": TABLES.flakes,
        "CountsTable": COUNTS.path, "CountsFirst": 32, "CountsLevels": 3,
        "BinLow": (-0.25, -0.5, 0), "BinHigh": (0.5, 0.75, 0)}


def test_slopes_without_a_bound_are_told_as_none(group):
    unbounded = replace(TABLES, slope_low=(float("-inf"),) * 2, slope_high=(float("inf"),) * 2)
    unbounded.write_to(group)
    values = socket_values(group)
    assert values["SlopeLow"] == values["SlopeHigh"] == (0, 0, 0)
    assert MapTables.of(group) == unbounded and unbounded.is_known and not unbounded.has_bounds


def test_a_map_left_to_blenders_own_nodes_is_remembered_by_its_size(group):
    TABLES.write_to(group)
    MapTables.none_for((8, 4)).from_source("map.png|1|2").write_to(group)
    tables = MapTables.of(group)
    assert tables.size == (8, 4) and tables.source == "" and not tables.is_known and tables.paths == []
    assert socket_values(group)["Table"] == "" and socket_values(group)["CountsLevels"] == 0


def test_a_group_without_its_osl_node_remembers_the_tables(group):
    group.nodes.remove(group.nodes[SCRIPT_NODE])
    TABLES.write_to(group)
    assert MapTables.of(group) == TABLES


@pytest.mark.parametrize("value", [*DAMAGE, None])
@pytest.mark.parametrize("name", [*PAIRS, *COUNTS_PAIRS])
def test_a_damaged_pair_is_not_known_and_the_paths_stay(group, name, value):
    TABLES.write_to(group)
    damage(group, name, value)
    tables = MapTables.of(group)
    if name in PAIRS:
        assert tables == replace(TABLES, **{PAIRS[name]: None}) and not tables.is_known
    else:
        assert tables == replace(TABLES, counts=replace(COUNTS, **{COUNTS_PAIRS[name]: None}))
        assert tables.is_known and not tables.counts.is_known
    assert tables.paths == TABLES.paths


@pytest.mark.parametrize("value", [1.5, [1.0, 2.0], {"a": 1}, None])
@pytest.mark.parametrize("name", [*PATHS, properties.SOURCE])
def test_a_damaged_path_is_none(group, name, value):
    TABLES.write_to(group)
    damage(group, name, value)
    tables = MapTables.of(group)
    assert len(tables.paths) == len(PATHS) - (name in PATHS) and (tables.source == "") == (name == properties.SOURCE)


@pytest.mark.parametrize("levels", [[0, 128], [-32, 128], [32.0, 128.0]])
def test_levels_that_no_counts_have_are_not_known(group, levels):
    TABLES.write_to(group)
    group[properties.COUNTS_LEVELS] = levels
    assert not MapTables.of(group).counts.is_known


def test_a_forgotten_table_leaves_the_size(group):
    TABLES.write_to(group)
    forget_table(group)
    assert MapTables.of(group) == replace(TABLES, path="", source="") and not MapTables.of(group).is_known


def test_paths_are_changed_where_the_preparation_and_the_render_look(group):
    TABLES.write_to(group)
    change_paths(group, lambda path: path.replace("//", "/elsewhere/"))
    moved = [path.replace("//", "/elsewhere/") for path in TABLES.paths]
    assert MapTables.of(group).paths == moved
    values = socket_values(group)
    assert [values[name] for name in ("Table", "IndexTable", "CountsTable", "FlakesTable")] == moved


def damage(group, name, value):
    """Let a property hold `value`, or be gone."""
    if value is None:
        del group[name]
    else:
        group[name] = value
