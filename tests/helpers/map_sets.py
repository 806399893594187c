"""Normal maps of several files: UDIM sets and image sequences, written and opened as users do."""

from __future__ import annotations

from pathlib import Path

import bpy

from demo_scenes import maps
from glint_addon.bake.image_bytes import image_bytes

TILES = (1001, 1002, 1011)
FRAMES = range(3, 8)
SIDE = 64  # texels of a file's side
TILT = 0.15  # standard deviation of the slopes of flakes


def write_flakes(file: Path, seed: int, side: int = SIDE) -> Path:
    """A PNG of flakes."""
    file.write_bytes(image_bytes(maps.flakes(side, std=TILT, seed=seed), is_float=False, name=file.name))
    return file


def udim_set(folder: Path, *, is_data: bool = True) -> bpy.types.Image:
    """A UDIM set "Flakes" of three tiles, the second of twice the side."""
    for number in TILES:
        write_flakes(folder / f"flakes.{number}.png", number, SIDE * 2 if number == TILES[1] else SIDE)
    return _opened(folder / f"flakes.{TILES[0]}.png", "TILED", is_data)


def sequence(folder: Path, *, is_data: bool = True) -> bpy.types.Image:
    """An image sequence "Flakes" whose files have the numbers FRAMES."""
    files = [write_flakes(folder / f"flakes_{number:04d}.png", number) for number in FRAMES]
    return _opened(files[0], "SEQUENCE", is_data)


def _opened(file, source, is_data):
    image = bpy.data.images.load(str(file))
    image.name, image.source = "Flakes", source
    image.colorspace_settings.name = "Non-Color" if is_data else "sRGB"
    return image
