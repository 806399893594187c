"""The script that takes the pictures of the panel: its scene, and what it cuts off a picture."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tools import screenshots

SCRIPT = Path(screenshots.__file__)


def test_the_scene_is_prepared_with_two_lights_found_and_a_large_one_left_out(tmp_path):
    done = subprocess.run([sys.executable, str(SCRIPT), str(tmp_path)], capture_output=True, text=True, check=True)
    assert "2 lights found, 2 tables baked" in done.stdout
    assert (tmp_path / "scene.blend").is_file() and len(list((tmp_path / "glint_tables").iterdir())) == 2


def test_empty_rows_and_columns_are_cut_off_but_for_a_margin():
    pixels = np.zeros((20, 30, 4), np.float32)
    pixels[8:11, 12:20] = 0.5
    assert screenshots.trimmed(pixels, 2).shape == (7, 12, 4)
    assert screenshots.trimmed(pixels, 100).shape == pixels.shape
    assert screenshots.trimmed(pixels, 2)[2, 2, 0] == 0.5 and screenshots.trimmed(pixels, 2)[1, 2, 0] == 0


def test_a_black_picture_says_how_to_take_another():
    with pytest.raises(ValueError, match="--grab"):
        screenshots.trimmed(np.zeros((4, 4, 4), np.float32))
