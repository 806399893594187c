"""Lists of frames: what a user writes becomes ranges that hold each frame once; what cannot be meant is refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as some

from glint_addon.cli.frame_list import FIRST, LAST, MOST, checked_frame, frame_ranges
from glint_addon.errors import SceneError


@pytest.mark.parametrize(
    ("words", "ranges"),
    [
        ("7", [range(7, 8)]),
        ("1-10,20", [range(1, 11), range(20, 21)]),
        ("1..10", [range(1, 11)]),
        (" 1-3 , 5 ", [range(1, 4), range(5, 6)]),
        ("1-100x10", [range(1, 92, 10)]),
        ("-5--3", [range(-5, -2)]),
        ("-2-1", [range(-2, 2)]),
        ("5,1-4", [range(1, 6)]),
        ("1-4,3-6,2", [range(1, 7)]),
        (f"{FIRST},{LAST}", [range(FIRST, FIRST + 1), range(LAST, LAST + 1)]),
    ],
)
def test_a_list_of_frames_is_read(words, ranges):
    assert frame_ranges(words) == ranges


@given(some.sets(some.integers(-50, 50), min_size=1))
def test_every_frame_is_in_exactly_one_range(frames):
    ranges = frame_ranges(",".join(map(str, frames)))
    assert [frame for part in ranges for frame in part] == sorted(frames)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("", "is not a frame"),
        ("all", '"all" in the frames "all" is not a frame'),
        ("1-", "is not a frame"),
        ("1,,2", "is not a frame"),
        ("1.5", "is not a frame"),
        ("10-1", "holds no frame"),
        ("1-10x0", "holds no frame"),
        (f"1-{MOST + 1}", "render them in several parts"),
        (f"1-{MOST},{MOST + 1}", "render them in several parts"),
        (f"{LAST + 1}", f"give a frame from {FIRST} to {LAST}"),
        (f"1-{10**30}", "outside Blender's range"),
    ],
)
def test_a_list_that_cannot_be_meant_is_refused(words, sentence):
    with pytest.raises(SceneError) as error:
        frame_ranges(words)
    assert sentence in str(error.value)


@pytest.mark.parametrize("frame", [FIRST, 0, LAST])
def test_all_of_blenders_frames_are_taken(frame):
    assert checked_frame(frame) == frame


@pytest.mark.parametrize("frame", [FIRST - 1, LAST + 1, 10**30])
def test_a_frame_that_blender_has_not_is_refused(frame):
    with pytest.raises(SceneError, match=f"Frame {frame} is outside"):
        checked_frame(frame)
