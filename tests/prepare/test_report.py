"""The report of a preparation: what is added to it, and the plain data that scripts read."""

import json
from typing import NamedTuple

from glint_addon import prepare_scene
from glint_addon.choice.ranking import Choice
from glint_addon.prepare.light_sets import report_lights
from glint_addon.prepare.report import Report

# Scripts read these: none may go.
KEYS = ["hints", "skipped_lights", "hints_by_material", "left_by_material", "baked", "reused", "unseen", "levels",
        "mip_levels", "osl", "device", "warnings", "notes", "counts"]
COUNTS = ["tables_baked", "tables_in_use", "bytes_baked", "bytes_in_use", "images_read"]


class Named(NamedTuple):
    """A light or a material, as far as the report looks at it."""

    name: str


def test_a_script_gets_plain_data_under_the_names_it_knows(scene):
    report = prepare_scene(scene)
    assert list(report) == KEYS and list(report["counts"]) == COUNTS
    assert report == json.loads(json.dumps(report)) == Report().as_dict() | {"osl": report["osl"]}


def test_two_reports_share_nothing():
    report = Report()
    report.add_table("/a.exr", was_baked=True, groups=1)
    report.counts.images_read += 1
    data = report.as_dict()
    data["baked"].clear()
    assert report.baked == ["/a.exr"] and Report() == Report(baked=[]) != report and Report().counts.images_read == 0


def test_a_table_that_many_groups_read_is_baked_once_and_reused_by_the_others():
    report = Report()
    report.add_table("/new.exr", was_baked=True, groups=3)
    report.add_table("/old.exr", was_baked=False, groups=2)
    assert report.baked == ["/new.exr"] and report.reused == ["/new.exr"] * 2 + ["/old.exr"] * 2


def test_tables_are_counted_by_file(tmp_path):
    report = Report()
    for name, size, groups, was_baked in (("new", 3, 2, True), ("old", 5, 4, False)):
        (tmp_path / name).write_bytes(bytes(size))
        report.add_table(tmp_path / name, was_baked=was_baked, groups=groups)
    report.count_tables()
    counts = report.counts
    assert (counts.tables_baked, counts.tables_in_use, counts.bytes_baked, counts.bytes_in_use) == (1, 2, 3, 8)


def test_lights_are_named_with_the_materials_that_look_for_them():
    report = Report()
    choices = {Named("Snow"): Choice((Named("Sun"), Named("Lamp")), ()),
               Named("Paint"): Choice((Named("Sun"),), (("Lamp", "it is out of reach"),))}
    report_lights(report, ["Lamp", "Sun"], [("Moon", "it is too dim")], choices)
    assert report.hints == ["Lamp", "Sun"] and report.skipped_lights == [["Moon", "it is too dim"]]
    assert report.hints_by_material == {"Snow": ["Sun", "Lamp"], "Paint": ["Sun"]}
    assert report.left_by_material == {"Snow": [], "Paint": [["Lamp", "it is out of reach"]]}


def test_lights_are_looked_for_where_a_material_in_view_has_one():
    report = Report(hints_by_material={"Snow": ["Sun"], "Paint": []})
    assert report.lit_materials == {"Snow"}
    report.unseen = ["Snow"]
    assert report.lit_materials == set()
