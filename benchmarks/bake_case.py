"""One measurement of bake.py in a process of its own: `python -m benchmarks.bake_case FILE bake|save|start ...`.

FILE gets the measurement as JSON; Blender writes to standard output what it likes.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

from demo_scenes import maps, measure, stage
from demo_scenes.truth import truth_material
from glint_addon.bake.counts import bake_counts, counts_levels
from glint_addon.bake.normal_map import decoded_normals, slope_bounds
from glint_addon.bake.openimageio import oiio
from glint_addon.bake.slope_index import bake_index
from glint_addon.bake.table import bake_table
from glint_addon.images import image_pixels
from glint_addon.materials.create import create_glint_material
from glint_addon.prepare.scene import prepare_scene

from .record import write_json

TILE = 1024  # texels; the map of every size is cut from repeats of one, or making it would take the most memory
TILES = {
    "CLOSEST": lambda: maps.flakes(TILE, std=0.25, seed=41),
    "LINEAR": lambda: maps.bumps(TILE, std=0.15, width=8.0, seed=42),
}
NODES, NODES_OSL, GLINT = "Blender's nodes", "Blender's nodes, OSL", "Glint"
BLENDS = {NODES: "nodes.blend", NODES_OSL: "nodes_osl.blend", GLINT: "glint.blend"}
PICTURE = (16, 16)  # pixels
REPEATS = 4.0  # of the map over the picture: footprints reach its largest blocks
SURFACE = {"roughness": 0.15}
KILOBYTE = 1 << 10  # the unit of ru_maxrss on Linux


def tiled(width: int, height: int, interpolation: str, channels=3) -> np.ndarray:
    """Encoded normals, float32 (height, width, channels), of any size: flakes or bumps; alpha is 1."""
    tile = TILES[interpolation]()
    pixels = np.ones((height, width, channels), np.float32)
    for v in range(0, height, TILE):
        for u in range(0, width, TILE):
            pixels[v : v + TILE, u : u + TILE, :3] = tile[: height - v, : width - u]
    return pixels


def bake(width: int, height: int, interpolation: str) -> dict:
    """Bake all that a map in Blender can need, from its image to all files; peak memory is the whole process's.

    {"seconds", "cpu_seconds", "peak_bytes", "before_bytes" (peak with the image in Blender and nothing baked),
    "table_bytes", "counts_bytes", "index_bytes"}
    """
    image = bpy.data.images.new("Normal map", width, height, float_buffer=True, is_data=True)
    image.pixels.foreach_set(tiled(width, height, interpolation, channels=4).reshape(-1))
    every = counts_levels(width, height, interpolation)
    before = _peak_bytes()
    with tempfile.TemporaryDirectory() as folder:
        start, cpu_start = time.perf_counter(), time.process_time()
        normals = decoded_normals(image_pixels(image))
        slope_bounds(normals)
        table, _ = bake_table(normals, Path(folder), interpolation=interpolation)
        levels = every[0], every[-1]
        counts = bake_counts(normals, Path(folder), interpolation=interpolation, levels=levels)[0]
        files = [table, counts]
        if interpolation == "CLOSEST":
            files.append(bake_index(normals, Path(folder))[0])
        seconds, cpu_seconds = time.perf_counter() - start, time.process_time() - cpu_start
        sizes = [path.stat().st_size for path in files] + [0] * (3 - len(files))
    return {
        "seconds": seconds, "cpu_seconds": cpu_seconds, "peak_bytes": _peak_bytes(), "before_bytes": before,
        "table_bytes": sizes[0], "counts_bytes": sizes[1], "index_bytes": sizes[2],
    }


def save(folder: Path, side: int, interpolation: str) -> dict:
    """Save one scene of a map of `side` texels in Blender's nodes, with and without OSL, and in Glint, prepared.

    The map is an 8-bit PNG beside them. {"table_bytes": bytes of all tables}
    """
    picture = folder / "map.png"
    encoded = np.round(tiled(side, side, interpolation) * 255).astype(np.uint8)
    _write_png(picture, encoded)
    settings = {**SURFACE, "interpolation": interpolation}
    for name, file in BLENDS.items():
        scene = stage.empty_scene(PICTURE, 1)
        if name == GLINT:
            material = create_glint_material(name, picture, **settings)
        else:
            image = bpy.data.images.load(str(picture))
            image.colorspace_settings.name = "Non-Color"
            material = truth_material(name, image, **settings)
        stage.add_sheet(scene, "Plane", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], material, repeats=REPEATS)
        stage.add_camera(scene, (0, 0, 3), (0, 0, 0), width=2.0)
        stage.add_sun(scene, (0.1, 0, 1))
        scene.cycles.shading_system = name == NODES_OSL
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / file))  # tables are baked beside the file
        if name == GLINT:
            report = prepare_scene(scene)
            if not report["hints"]:
                raise RuntimeError("The sun got no hint, so the render would not read the tables.")
            bpy.ops.wm.save_mainfile()
    return {"table_bytes": sum(file.stat().st_size for file in folder.glob("glint_tables/*.exr"))}


def start(blend: Path) -> dict:
    """Render a saved scene: {"seconds", "cpu_seconds", "peak_bytes"}; nearly all of it is start-up."""
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    cpu_start = time.process_time()
    _, seconds = measure.timed_render(bpy.context.scene)
    return {"seconds": seconds, "cpu_seconds": time.process_time() - cpu_start, "peak_bytes": _peak_bytes()}


def _write_png(path, encoded):
    height, width = encoded.shape[:2]
    output = oiio.ImageOutput.create(str(path))
    written = output.open(str(path), oiio.ImageSpec(width, height, 3, oiio.UINT8)) and output.write_image(encoded[::-1])
    if not (output.close() and written):
        raise RuntimeError(f"Map {path} cannot be written ({output.geterror()}).")


def _peak_bytes():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KILOBYTE


def main():
    """Command line, see the module."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bake_case")
    parser.add_argument("file", type=Path)
    kinds = parser.add_subparsers(required=True)
    one = kinds.add_parser("bake")
    one.add_argument("width", type=int)
    one.add_argument("height", type=int)
    one.add_argument("interpolation", choices=TILES)
    one.set_defaults(run=lambda options: bake(options.width, options.height, options.interpolation))
    one = kinds.add_parser("save")
    one.add_argument("folder", type=Path)
    one.add_argument("side", type=int)
    one.add_argument("interpolation", choices=TILES)
    one.set_defaults(run=lambda options: save(options.folder, options.side, options.interpolation))
    one = kinds.add_parser("start")
    one.add_argument("blend", type=Path)
    one.set_defaults(run=lambda options: start(options.blend))
    options = parser.parse_args()
    write_json(options.file, options.run(options))


if __name__ == "__main__":
    sys.exit(main())
