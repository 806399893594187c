"""The benchmark of the bake measures whole bakes, and its table says what was measured."""

import pytest

from benchmarks import bake, bake_case
from glint_addon.bake import counts

MACHINE = {"processor": "Abacus", "threads": 2, "system": "Linux", "blender": "5", "glint": "0", "date": "2000"}


@pytest.mark.parametrize("interpolation", bake_case.TILES)
def test_a_measured_bake_writes_both_tables(interpolation, monkeypatch):
    monkeypatch.setattr(bake_case, "TILE", 32)
    monkeypatch.setitem(bake_case.TILES, interpolation, lambda: bake_case.maps.flakes(32, std=0.2))
    found = bake_case.bake(40, 24, interpolation)
    corners = counts.corners(counts.FIRST_BLOCK[interpolation], interpolation)
    assert found["table_bytes"] > 40 * 24 * 16 and found["counts_bytes"] > corners**2 * 16
    assert found["seconds"] > 0 and found["peak_bytes"] >= found["before_bytes"] > 0


def test_a_map_of_any_size_repeats_its_tile(monkeypatch):
    monkeypatch.setattr(bake_case, "TILE", 32)
    monkeypatch.setitem(bake_case.TILES, "CLOSEST", lambda: bake_case.maps.flakes(32, std=0.2))
    pixels = bake_case.tiled(70, 40, "CLOSEST", channels=4)
    assert pixels.shape == (40, 70, 4) and (pixels[..., 3] == 1).all()
    assert (pixels[:, 32:64] == pixels[:, :32]).all() and (pixels[32:] == pixels[:8]).all()


def test_the_table_names_sizes_bounds_and_how_much_later_glint_starts():
    row = {"width": 3000, "height": 1700, "interpolation": "LINEAR", "bound": None, "seconds": 1.234, "cpu_seconds": 2,
           "peak_bytes": 5e8, "before_bytes": 3e8, "bytes_a_texel": 41.25}
    kinds = [(bake_case.NODES, 0.4, 0.0), (bake_case.GLINT, 0.0, 1e8)]
    starts = [{"interpolation": "LINEAR", "kind": kind, "seconds": 0.5, "cpu_seconds": 0.6, "later": later,
               "table_bytes": size} for kind, later, size in kinds]
    results = {"machine": MACHINE, "bounds": bake.BOUNDS, "bakes": [row, {**row, "bound": 20.0}], "starts": starts,
               "start_side": 4096, "start_count": 5}
    text = bake.table(results)
    assert "| 3000 x 1700 | Linear | 1.23 |  | 2.00 | 500 | 300 | 41.2 |" in text
    assert "| 3000 x 1700 | Linear | 1.23 | 20 |" in text and "Abacus" in text
    assert f"| Linear | {bake_case.NODES} | 0.50 | +0.40 | 0.60 | 0 |" in text
    assert f"| Linear | {bake_case.GLINT} | 0.50 |  | 0.60 | 100 |" in text
