"""The index table: every texel once, in the cell of its slope; the shader finds by it what it finds one by one."""

import re

import bpy
import numpy as np
import pytest

from benchmarks import counters
from demo_scenes import maps
from glint_addon import create_glint_material, paths, prepare_scene
from glint_addon.bake import slope_index
from glint_addon.errors import CancelledError
from glint_addon.materials.find import glint_groups
from glint_addon.nodes.map_tables import SCRIPT_NODE
from glint_addon.paths import disk_path
from glint_addon.seen import footprints
from tests.helpers import cycles
from tests.helpers.normals import random_normals
from tests.reference.selection import CLOSURE_BUDGET

SIZES = [(100, 37), (37, 100), (1, 70), (32, 32), (64, 96), (33, 31)]  # width, height
BYTES_A_TEXEL = 8  # of the 40: 16 are the normals', up to 16 the counts'
MAP = (200, 137)  # texels, no power of two and no whole blocks
MODE_ALL, MODE_INDEX = 3, 6
ROUGHNESS = 0.05  # so sharp that all texels near a half vector are kept, none drawn for others
LEAST_INDEXED = 0.1  # of the pixels
LARGEST_SHARE = 0.6  # of the elements under a footprint that are visited, with two suns and slopes of 0.15
# Relative differences of pixels: the kernel's integral instead of its sum over the elements, and, in a few pixels, the
# roulette of closures lighter than 2e-5, which comes out otherwise.
FAINT = 0.1  # of the mean: below, a pixel's difference counts as that of one so bright
MEDIAN_DIFFERENCE, MEAN_DIFFERENCE, ROULETTE = 1e-4, 1e-3, 0.06
RIM = 1 / 64  # of the light: one block in 64, at the rim of what is lost, keeps its header and loses of its lists


def records(normals):
    """{(block along u, along v): (header (2, 4), counts before each cell (CELLS,), elements (1024,))}."""
    height, width = normals.shape[:2]
    texels = slope_index.index_texels(normals).reshape(-1, 4)
    columns, rows = slope_index.blocks(width), slope_index.blocks(height)
    packed = texels[: columns * rows * slope_index.RECORD].reshape(rows, columns, slope_index.RECORD, 4)
    found = {}
    for j, i in np.ndindex(rows, columns):
        pairs = packed[j, i, slope_index.FIRST_ELEMENT :].reshape(-1).astype(int)
        elements = np.stack([pairs % 1024, pairs // 1024], axis=1).reshape(-1)
        before = packed[j, i, slope_index.FIRST_PREFIX : slope_index.FIRST_ELEMENT].reshape(-1).astype(int)
        found[i, j] = packed[j, i, :2], before, elements
    return found


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_every_texel_is_listed_once_and_within_its_cell(width, height):
    normals = random_normals(width, height)
    seen = np.zeros((height, width), int)
    in_cells = 0
    for (block_u, block_v), ((shape, extent), before, elements) in records(normals).items():
        # One number of each channel, by which the shader knows the record.
        assert extent[3] == slope_index.MAGIC and min(extent[0], extent[1], shape[2]) > 0
        size = min(32, width - 32 * block_u) * min(32, height - 32 * block_v)
        listed = int(extent[2])
        ends = np.append(before[1:], listed)
        for place, code in enumerate(elements[:size]):
            i, j = 32 * block_u + code % 32, 32 * block_v + code // 32
            seen[j, i] += 1
            if place >= listed:
                continue
            in_cells += 1
            x, y, z = normals[j, i].astype(float)
            assert z >= extent[1] - 1e-6 and z > 0
            cell = int(np.searchsorted(ends, place, side="right"))
            for axis, (count, stride) in enumerate(((36, 1), (14, 36))):
                # The outermost cells are open to the outside.
                at = cell // stride % count if axis == 0 else cell // stride
                low = -np.inf if at == 0 else shape[axis] + (at - 0.01) / shape[2 + axis]
                high = np.inf if at == count - 1 else shape[axis] + (at + 1.01) / shape[2 + axis]
                assert low < (x, y)[axis] / z < high
    assert (seen == 1).all()
    assert in_cells > 0.5 * width * height


def test_a_flat_map_and_one_below_the_horizon_are_listed_whole():
    flat = np.broadcast_to(np.float32([0.1, 0, 1]), (40, 40, 3))
    assert sum(int(extent[2]) for (_, extent), _, _ in records(flat).values()) == 1600
    below = np.broadcast_to(np.float32([0.1, 0, -1]), (40, 40, 3))
    assert sum(int(extent[2]) for (_, extent), _, _ in records(below).values()) == 0


def test_the_layout_is_that_of_the_shader():
    headers = ("slope_cells.h", "slope_index.h")
    text = "".join(paths.shader_file(name).read_text(encoding="utf-8") for name in headers)
    defined = dict(re.findall(r"#define INDEX_(\w+) ([\d.]+)", text))
    for name in ("MAGIC", "SIDE", "COLUMNS", "ROWS", "RECORD", "FIRST_PREFIX", "FIRST_ELEMENT"):
        assert float(defined[name]) == getattr(slope_index, name)
    assert float(defined["SHORT_AXIS"]) == footprints.INDEX_SHORT_AXIS


@pytest.mark.parametrize("side", [256, 1024, 8192])
def test_the_file_takes_few_bytes_a_texel(side):
    width, height = slope_index.index_shape(side, side)
    assert width * height * 16 <= BYTES_A_TEXEL * side * side


def test_it_is_written_once_and_a_cancelled_bake_leaves_nothing(tmp_path):
    normals = random_normals(64, 64)

    def cancel(part):
        raise CancelledError("Cancelled.")

    with pytest.raises(CancelledError):
        slope_index.bake_index(normals, tmp_path, progress=cancel)
    assert not list(tmp_path.iterdir())
    parts = []
    path, written = slope_index.bake_index(normals, tmp_path, progress=parts.append)
    assert written and parts == sorted(parts) and parts[-1] == 1.0
    assert slope_index.bake_index(normals, tmp_path) == (path, False)


# --- the shader ---


@pytest.fixture
def wall(scene, tmp_path):
    """A tilted square that repeats its map, a few hundred texels a pixel, under two suns that the map mirrors."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene.render.resolution_x = scene.render.resolution_y = 12
    cycles.add_sun(scene, (0.1, 0.5, 1))
    cycles.add_sun(scene, (0.16, 0.5, 1))
    cycles.add_camera(scene, (0.0, -1.0, 2.5), width=1.2)
    return cycles.add_plane(scene, repeats=2.0)


@pytest.mark.parametrize("strength", [1.0, 0.5])
def test_the_index_finds_the_same_glints_at_fewer_visits(scene, wall, strength):
    encoded = maps.bumps(256)[: MAP[1], : MAP[0]]
    material = create_glint_material(
        "Wall", maps.blender_image("map", encoded), interpolation="CLOSEST", strength=strength, roughness=ROUGHNESS
    )
    wall.data.materials.append(material)
    prepare_scene(scene)
    (group,) = glint_groups(material)
    table = group.nodes[SCRIPT_NODE].inputs["IndexTable"]
    group.nodes[SCRIPT_NODE].inputs["CountsFirst"].default_value = 0
    index = table.default_value
    assert index
    count = counters.counters(scene, material)
    table.default_value = ""
    plain = counters.counters(scene, material)

    # Where most elements mirror one of the suns the shader visits all, which is faster.
    indexed = count.mode == MODE_INDEX
    assert (plain.mode == MODE_ALL).all() and (count.mode[~indexed] == MODE_ALL).all()
    assert indexed.mean() > LEAST_INDEXED
    assert count.visited[indexed].mean() < LARGEST_SHARE * plain.visited[indexed].mean()
    assert max(count.closures.max(), plain.closures.max()) < CLOSURE_BUDGET
    expected = cycles.rendered(scene)[..., 0]
    table.default_value = index
    picture = cycles.rendered(scene)[..., 0]
    difference = np.abs(picture - expected) / np.maximum(expected, FAINT * expected.mean())
    assert expected.mean() > 0 and picture.mean() == pytest.approx(expected.mean(), rel=MEAN_DIFFERENCE)
    assert np.median(difference) < MEDIAN_DIFFERENCE and difference.max() < ROULETTE


def test_a_missing_or_shrunk_index_leaves_the_elements_one_by_one(scene, wall):
    encoded = maps.bumps(256)[: MAP[1], : MAP[0]]
    material = create_glint_material("Wall", maps.blender_image("map", encoded), interpolation="CLOSEST")
    wall.data.materials.append(material)
    prepare_scene(scene)
    (group,) = glint_groups(material)
    table = group.nodes[SCRIPT_NODE].inputs["IndexTable"]
    group.nodes[SCRIPT_NODE].inputs["CountsFirst"].default_value = 0
    for other in (group["glint_table"], "/no/such/file.exr"):
        table.default_value = other
        assert (counters.counters(scene, material).mode == MODE_ALL).all()


def zeroed(data, start, end):
    """The bytes of a file without those between two parts, 0..1, of its length."""
    first, last = int(start * len(data)), int(end * len(data))
    return data[:first] + bytes(last - first) + data[last:]


# A file of one row holds alpha, blue, green and red one after the other: channels are lost, of some blocks or of all.
LOST = [(0.01, 1.0), (0.5, 1.0), (0.9, 1.0), (0.4, 0.6)]


def test_an_index_of_which_a_part_is_lost_takes_no_light_away(scene, wall):
    """Slow: six renders, and the name of a table is compiled into its shader."""
    image = maps.blender_image("map", maps.bumps(256))
    material = create_glint_material("Wall", image, interpolation="CLOSEST", roughness=ROUGHNESS)
    wall.data.materials.append(material)
    prepare_scene(scene)
    (group,) = glint_groups(material)
    table = group.nodes[SCRIPT_NODE].inputs["IndexTable"]
    group.nodes[SCRIPT_NODE].inputs["CountsFirst"].default_value = 0
    path = disk_path(table.default_value)
    assert (counters.counters(scene, material).mode == MODE_INDEX).all()
    expected = cycles.rendered(scene)[..., 0].mean()
    for start, end in LOST:
        # Another name: with Persistent Data Cycles keeps what it has read.
        damaged = path.with_name(f"lost_{start}.exr")
        damaged.write_bytes(zeroed(path.read_bytes(), start, end))
        table.default_value = str(damaged)
        assert cycles.rendered(scene)[..., 0].mean() == pytest.approx(expected, rel=RIM)
