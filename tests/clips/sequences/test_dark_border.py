"""Dark borders: bars and round fields of view are named, dark tissue and excluded borders are not."""

import numpy as np

from endotsr.clips.sequences.checks.dark_border import DarkBorder

HEIGHT, WIDTH = 96, 128


def found(change, tissue=None):
    border = DarkBorder()
    for i in range(3):
        picture = np.full((HEIGHT, WIDTH, 3), 100 + i, np.uint8)
        change(picture, i)
        border.add(picture, tissue)
    return [one.what for one in border.findings("clip")]


def bars(picture, _):
    picture[:, :16], picture[80:] = 12, 0


def test_bars_are_named_with_the_crop_that_removes_them():
    (what,) = found(bars)
    assert what.startswith("27.1% of the pixels are dark in every frame") and "--crop 16 0 112 80" in what


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
