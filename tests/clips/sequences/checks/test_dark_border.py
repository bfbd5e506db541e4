"""Dark borders: bars and round fields of view are named, dark tissue and excluded borders are not."""

import re

import numpy as np
import pytest

from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks.dark_border import border_findings
from endotsr.clips.sequences.field_of_view import FieldOfView
from endotsr.clips.sequences.read import read_sequence
from endotsr.config import SequenceConfig
from synthetic_folder import write_synthetic_folder

HEIGHT, WIDTH = 96, 128


def found(change, tissue=None):
    view = FieldOfView()
    for i in range(3):
        picture = np.full((HEIGHT, WIDTH, 3), 100 + i, np.uint8)
        change(picture, i)
        view.add(picture, tissue)
    return [one.what for one in border_findings(view, "clip")]


def bars(picture, _):
    picture[:, :16], picture[80:] = 12, 0


def test_bars_are_named_with_the_crop_that_removes_them():
    (what,) = found(bars)
    assert what.startswith("25.5% of the pixels are dark in every frame") and "--crop 16 0 112 80" in what


def test_the_crop_of_a_large_picture_leaves_no_border():
    view = FieldOfView()
    for i in range(3):
        picture = np.full((640, 1000, 3), 100 + i, np.uint8)
        picture[:70] = picture[:, 900:] = 14
        view.add(picture)
    (found,) = border_findings(view, "")
    x, y, width, height = map(int, re.findall(r"--crop (\d+) (\d+) (\d+) (\d+)", found.what)[0])
    assert (x, y + height) == (0, 640)
    assert 70 <= y <= 82 and 888 <= width <= 900


def test_a_round_field_of_view_is_named_without_a_crop():
    x, y = np.meshgrid(np.arange(WIDTH) - 64, np.arange(HEIGHT) - 48)

    def outside(picture, _):
        picture[np.hypot(x / 64, y / 48) > 1] = 0

    (what,) = found(outside)
    assert "count as tissue" in what and "--crop" not in what


def test_excluded_borders_and_dark_tissue_are_not_named():
    tissue = np.ones((HEIGHT, WIDTH), bool)
    tissue[:, :16], tissue[80:] = False, False
    assert found(bars, tissue) == []

    def lumen(picture, i):
        picture[40:60, 50:80] = 0

    def passing(picture, i):
        picture[:, 30 * i : 30 * i + 30] = 0

    def black(picture, i):
        picture[:] = 0

    assert found(lumen) == [] and found(passing) == [] and found(black) == []


@pytest.mark.parametrize("dark", [True, False])
def test_a_training_tells_of_the_border_of_the_frames_that_it_reads(tmp_path, dark):
    write_synthetic_folder(tmp_path, width=64, height=48)
    for file in (tmp_path / "images").iterdir():
        picture = read_png(file)
        picture[40:] = 5 if dark else 60
        write_png(file, picture)
    notes = read_sequence(tmp_path, SequenceConfig(depth_percentiles=(0.0, 100.0))).notes
    assert any("dark-border" in note and "--crop 0 0 64" in note for note in notes) is dark
