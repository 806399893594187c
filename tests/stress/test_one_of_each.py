"""A case of each group of the stress tests for which no other test of `make test` stands."""

from __future__ import annotations

import pytest

from tests.helpers.stress import compare
from tests.stress import test_cameras as cameras
from tests.stress import test_map_files as map_files
from tests.stress import test_meshes as meshes
from tests.stress import test_precision as precision
from tests.stress import test_settings as settings


def a_fisheye_camera(record, folder):
    compare(record, cameras.seen_by(cameras.VIEWS["fisheye equisolid"]))


def a_map_of_16_bits(record, folder):
    file = map_files.write(folder / "map.png", map_files.pixels(), *map_files.FORMATS["16-bit PNG"])
    compare(record, map_files.stage, normal_map=lambda: map_files.loaded(file))


def a_mesh_of_smooth_waves(record, folder):
    def build(scene, material):
        meshes.smooth_waves(scene, material)
        meshes.add_view(scene)

    compare(record, build)


def the_far_end_of_a_map(record, folder):
    precision.test_a_footprint_at_the_far_end_of_a_map_holds_the_texels_around_it(precision.SIZES[1])


def kept_data(record, folder):
    """Slow: four renders of a room; nothing else sees that data which Blender keeps follow a light."""
    settings.test_kept_data_follows_a_light(record)


CASES = [a_fisheye_camera, a_map_of_16_bits, a_mesh_of_smooth_waves, the_far_end_of_a_map, kept_data]


@pytest.mark.parametrize("case", CASES)
def test_a_case_of_each_group_agrees_with_blenders_nodes(stress_record, tmp_path, case):
    case(stress_record, tmp_path)
