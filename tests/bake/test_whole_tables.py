"""A table proves that it is whole: whatever is lost of a file is found, and the file is baked again in its place."""

import os
import re
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from glint_addon.bake import counts, float_image, pyramid, slope_index, table
from glint_addon.bake.float_image import is_whole
from glint_addon.bake.openimageio import oiio
from glint_addon.errors import CancelledError
from tests.helpers.normals import random_normals

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("table", "index", "counts", "pyramid", "half pyramid")
SIZE = (200, 137)  # texels: no power of two, and files both smaller and larger than what is read of a file
MOST_READ = 64 * 4096  # bytes of a file, whatever its size


def bake(kind, folder) -> tuple[Path, bool]:
    """Bake one file of that kind: (path, whether it was written)."""
    normals = random_normals(*SIZE)
    if kind == "table":
        return table.bake_table(normals, folder, interpolation="LINEAR")
    if kind == "index":
        return slope_index.bake_index(normals, folder)
    if kind == "counts":
        return counts.bake_counts(normals, folder, interpolation="CLOSEST", levels=(32, 64))[:2]
    pixels = np.concatenate([normals, np.ones((*normals.shape[:2], 1), np.float32)], axis=2)
    return pyramid.bake_pyramid(pixels, folder, encoded=False, associated=False, half=kind == "half pyramid")


def zeroed(data: bytes, start: int, end: int) -> bytes:
    return data[:start] + bytes(end - start) + data[end:]


def with_digest(data: bytes, digest: bytes) -> bytes:
    """The same file with another digest."""
    start = data.index(float_image.FIELD) + len(float_image.FIELD)
    return data[:start] + digest + data[start + 64 :]


def without_digest(data: bytes) -> bytes:
    """The same file as a version without digests would have written it, but for an attribute of another name."""
    return data.replace(b"glint:digest", b"other:digest")


DAMAGES = {
    "empty": lambda data: b"",
    "one byte": lambda data: data[:1],
    "half as long": lambda data: data[: len(data) // 2],
    "one byte shorter": lambda data: data[:-1],
    "one block longer": lambda data: data + bytes(4096),
    "all zeros": lambda data: bytes(len(data)),
    "the second half zeros": lambda data: zeroed(data, len(data) // 2, len(data)),
    "other last bytes": lambda data: data[:-512] + bytes(range(256)) * 2,  # what pads a list is zeros already
    "a twentieth in the middle zeros": lambda data: zeroed(data, len(data) * 47 // 100, len(data) * 52 // 100),
    "zeros after the header": lambda data: zeroed(data, 1024, len(data)),
    "a damaged header": lambda data: zeroed(data, 8, 40),
    "another digest": lambda data: with_digest(data, b"f" * 64),
    "a blank digest": lambda data: with_digest(data, b"0" * 64),
    "no digest": without_digest,
    "text": lambda data: b"no table",
}


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    """{kind: bytes of its file}; baked once, because the tests only read them."""
    folder = tmp_path_factory.mktemp("baked")
    return {kind: bake(kind, folder)[0].read_bytes() for kind in KINDS}


@pytest.mark.parametrize("kind", KINDS)
def test_every_file_that_is_baked_is_whole_wherever_it_is_copied(baked, tmp_path, kind):
    path = tmp_path / "of another name.exr"
    path.write_bytes(baked[kind])
    assert is_whole(path)


def test_the_files_of_these_tests_are_read_in_full_and_in_part(baked):
    sizes = [len(data) for data in baked.values()]
    assert min(sizes) <= MOST_READ < max(sizes)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_not_whole(baked, tmp_path, kind, damage):
    path = tmp_path / "damaged.exr"
    data = DAMAGES[damage](baked[kind])
    assert data != baked[kind]
    path.write_bytes(data)
    assert not is_whole(path)


@pytest.mark.parametrize("kind", ["table", "index"])
def test_a_sparse_file_of_full_size_is_not_whole(baked, tmp_path, kind):
    path = tmp_path / "sparse.exr"
    path.write_bytes(baked[kind][: len(baked[kind]) * 3 // 4])
    os.truncate(path, len(baked[kind]))
    assert path.stat().st_size == len(baked[kind]) and not is_whole(path)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("damage", ["empty", "half as long", "all zeros", "the second half zeros", "no digest"])
def test_a_damaged_file_is_baked_again_in_its_place(tmp_path, kind, damage):
    path, written = bake(kind, tmp_path)
    data = path.read_bytes()
    assert written and bake(kind, tmp_path) == (path, False)
    path.write_bytes(DAMAGES[damage](data))
    assert bake(kind, tmp_path) == (path, True)
    assert list(tmp_path.iterdir()) == [path] and is_whole(path)
    np.testing.assert_array_equal(read_pixels(path), read_pixels(saved(tmp_path / "first.exr", data)))
    assert bake(kind, tmp_path) == (path, False)


def test_a_bake_that_is_cancelled_leaves_a_damaged_file_as_it_was(tmp_path):
    normals = random_normals(*SIZE)
    path, _ = table.bake_table(normals, tmp_path)
    path.write_bytes(b"damaged")

    def cancel(part):
        raise CancelledError("Cancelled.")

    with pytest.raises(CancelledError):
        table.bake_table(normals, tmp_path, progress=cancel)
    assert list(tmp_path.iterdir()) == [path] and path.read_bytes() == b"damaged"


def test_the_box_of_damaged_counts_is_not_believed(tmp_path):
    path, _ = bake("counts", tmp_path)
    assert float_image.stored_pairs(path, counts.BOX) is not None
    data = path.read_bytes()
    path.write_bytes(zeroed(data, len(data) // 2, len(data)))
    assert float_image.stored_pairs(path, counts.BOX) is None


def read_pixels(path):
    source = oiio.ImageInput.open(str(path))
    pixels = source.read_image(oiio.FLOAT)
    source.close()
    return pixels


def saved(path, data):
    path.write_bytes(data)
    return path


def undated(data: bytes) -> bytes:
    """The file without the second it was written in, which OpenImageIO notes."""
    return re.sub(rb"\d{4}:\d\d:\d\d \d\d:\d\d:\d\d", b"", data)


@pytest.mark.parametrize("half", [False, True])
def test_the_digest_changes_no_pixel_and_no_length(tmp_path, half):
    pixels = np.random.default_rng(1).random((70, 100, 4)).astype(np.float16).astype(np.float32)
    float_image.write_image(str(tmp_path / "blank.exr"), pixels, half=half)
    float_image.write_whole(tmp_path / "whole.exr", pixels, half=half)
    blank, whole = ((tmp_path / name).read_bytes() for name in ("blank.exr", "whole.exr"))
    assert undated(blank) == undated(with_digest(whole, b"0" * 64)) and not is_whole(tmp_path / "blank.exr")
    np.testing.assert_array_equal(read_pixels(tmp_path / "whole.exr")[::-1], pixels)
    image = bpy.data.images.load(str(tmp_path / "whole.exr"))
    found = np.empty(pixels.size, np.float32)
    image.pixels.foreach_get(found)
    np.testing.assert_array_equal(found.reshape(pixels.shape), pixels)


def test_what_is_no_file_is_not_whole_and_raises_nothing(tmp_path):
    for path in (tmp_path / "missing.exr", tmp_path, Path(), tmp_path / "null\0.exr", tmp_path / ("long" * 100)):
        assert not is_whole(path)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.exr")
        assert not is_whole(tmp_path / "pipe.exr")


def test_a_file_that_may_not_be_read_is_not_whole(baked, tmp_path, monkeypatch):
    path = saved(tmp_path / "table.exr", baked["table"])

    def refuse(*arguments, **settings):
        raise PermissionError(13, "Permission denied")

    # File modes would not stop an administrator.
    with monkeypatch.context() as shut:
        shut.setattr(Path, "open", refuse)
        assert not is_whole(path)
    assert is_whole(path)


def test_a_disk_that_fails_while_it_is_read_makes_a_file_not_whole(baked, tmp_path, monkeypatch):
    path = saved(tmp_path / "table.exr", baked["table"])

    def fail(file):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(float_image, "_digests", fail)
    assert not is_whole(path)


def test_a_file_is_read_again_only_if_it_changed(baked, tmp_path, monkeypatch):
    path = saved(tmp_path / "table.exr", baked["table"])
    assert is_whole(path)
    looks = []
    digests = float_image._digests
    monkeypatch.setattr(float_image, "_digests", lambda file: looks.append(file) or digests(file))
    assert is_whole(path) and not looks
    path.write_bytes(bytes(path.stat().st_size))
    assert not is_whole(path) and not is_whole(path) and len(looks) == 2


class CountedFile:
    """An open file that counts the bytes that are read of it."""

    def __init__(self, file, counted):
        self.file, self.counted = file, counted

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.file.close()

    def seek(self, *place):
        return self.file.seek(*place)

    def read(self, size):
        data = self.file.read(size)
        self.counted.append(len(data))
        return data


@pytest.mark.parametrize("megabytes", [0.001, 0.3, 300])
def test_so_little_of_a_file_is_read_whatever_its_size(tmp_path, monkeypatch, megabytes):
    path = tmp_path / "file.exr"
    path.touch()
    os.truncate(path, int(megabytes * 1e6))
    counted = []
    plain_open = Path.open
    monkeypatch.setattr(Path, "open", lambda *values, **settings: CountedFile(plain_open(*values, **settings), counted))
    assert not is_whole(path)
    assert sum(counted) == min(int(megabytes * 1e6), MOST_READ)


@pytest.mark.parametrize("size", [262145, 300_000, 10**6 + 1, 268_501_449])
def test_what_is_lost_in_one_piece_of_a_sixtieth_of_the_file_meets_a_block_that_is_read(size):
    starts = np.array(float_image._block_starts(size))
    assert len(starts) == len(set(starts)) == 64 and starts[0] == 0 and starts[-1] == size - 4096
    gaps = np.diff(starts) - 4096  # bytes between two blocks
    assert gaps.max() < size / 60
    assert (starts[:-1] % 4096 == 0).all()


def test_the_check_loads_neither_blender_nor_openimageio(baked, tmp_path):
    path = saved(tmp_path / "table.exr", baked["table"])
    code = (
        "import sys; from pathlib import Path; from glint_addon.bake.float_image import is_whole; "
        f"print(is_whole(Path({str(path)!r})), 'bpy' in sys.modules, 'OpenImageIO' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["True", "False", "False"]
