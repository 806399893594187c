"""The files of images: one, or several of UDIM sets, one a tile, and of image sequences, one a frame."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from pathlib import Path

import bpy

STILL = ("FILE", "GENERATED")  # sources of images of one file or none
SEVERAL = ("TILED", "SEQUENCE")  # of several files
# A file's last number, which counts the frames, and what surrounds it.
NUMBER = re.compile(r"^(.*?)(\d+)(\D*)$")
UDIM = "<UDIM>"  # of a path: the number of a tile
FIRST_TILE, TILES_IN_A_ROW = 1001, 10


@dataclass(frozen=True)
class Frames:
    """Which frames of an image sequence are shown when: the properties of those names of Blender's ImageUser.

    File number frame_offset + 1 is shown at frame frame_start and before.
    """

    frame_duration: int = 1
    frame_start: int = 1
    frame_offset: int = 0
    use_cyclic: bool = False
    use_auto_refresh: bool = True

    @classmethod
    def of(cls, user: bpy.types.ImageUser) -> Frames:
        """What an image user, of an Image Texture node for one, shows."""
        return cls(**{field.name: getattr(user, field.name) for field in fields(cls)})

    def write_to(self, user: bpy.types.ImageUser) -> None:
        """Let an image user show these frames; what it shows already is not set again."""
        for field in fields(self):
            if getattr(user, field.name) != getattr(self, field.name):
                setattr(user, field.name, getattr(self, field.name))


def image_path(image: bpy.types.Image) -> Path:
    """The file of an image; relative paths count from the .blend file that holds the image."""
    return Path(bpy.path.abspath(image.filepath, library=image.library))


def is_still(image: bpy.types.Image) -> bool:
    """Whether an image is of one file, or of none: neither a UDIM set nor moving."""
    return image.source in STILL


def is_several(image: bpy.types.Image) -> bool:
    """Whether an image is a UDIM set or an image sequence."""
    return image.source in SEVERAL


def sequence_frames(image: bpy.types.Image) -> Frames | None:
    """All files of an image sequence, the first of them at frame 1; None of any other image."""
    if image.source != "SEQUENCE":
        return None
    numbers = [int(_number(file)) for file in image_files(image)] or [1]
    return Frames(max(numbers) - min(numbers) + 1, frame_offset=min(numbers) - 1)


def image_files(image: bpy.types.Image) -> list[Path]:
    """The files on disk of a UDIM set or an image sequence, in the order of their numbers."""
    path = image_path(image)
    if image.source == "TILED":
        files = (path.with_name(_tile_name(path.name, tile.number)) for tile in image.tiles)
        return [file for file in files if file.is_file()] if image.filepath else []
    match = NUMBER.match(path.stem)
    if match is None:
        return [path] if path.is_file() else []
    head, _, tail = match.groups()
    files = _matching(path.parent, head, r"\d+", tail + path.suffix)
    return sorted(files, key=lambda file: (int(_number(file)), file.name))


def udim_files(path: Path) -> list[Path]:
    """The files on disk of the UDIM set `path`, in whose name "<UDIM>" stands for the number of a tile."""
    head, _, tail = path.name.partition(UDIM)
    return sorted(_matching(path.parent, head, r"\d{4}", tail))


def _matching(folder: Path, head: str, number: str, tail: str) -> list[Path]:
    """The files in a folder whose names are a number, by its regular expression, between two words; none of a folder
    that is not there or may not be looked into."""
    pattern = re.compile(re.escape(head) + number + re.escape(tail))
    try:
        return [file for file in folder.iterdir() if pattern.fullmatch(file.name)]
    except OSError:
        return []


def _tile_name(name: str, number: int) -> str:
    row, column = divmod(number - FIRST_TILE, TILES_IN_A_ROW)
    return name.replace(UDIM, str(number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}")


def _number(file: Path) -> str:
    match = NUMBER.match(file.stem)
    return match.group(2) if match is not None else "1"
