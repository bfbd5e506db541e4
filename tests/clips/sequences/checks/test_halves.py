"""Two views in one picture are told from one view whose halves have the same shading."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from data_folder import data_folder
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.halves import halves_finding
from endotsr.clips.sequences.sampling import small_picture

HEIGHT, WIDTH = 40, 60


def detail(seed):
    noise = gaussian_filter(np.random.default_rng(seed).normal(size=(HEIGHT, WIDTH)), 1.2)
    return 18.0 * noise / noise.std()


def shading():
    """Brighter in the middle of each half, as under the light of a scope."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    return 200.0 - 0.12 * ((columns - WIDTH / 2) ** 2 + (rows - HEIGHT / 2) ** 2)


def codes(pictures):
    return [found.code for found in halves_finding(pictures, "clip")]


@pytest.mark.parametrize("join", [np.hstack, np.vstack])
def test_halves_that_share_their_shading_are_two_views_if_they_share_their_detail(join):
    one = shading() + detail(0)
    assert codes([join([one, shading() + detail(1)])] * 3) == []
    assert codes([join([one, np.roll(one, 4, axis=1)])] * 3) == ["two-views"]


def test_detail_that_fits_rows_in_other_places_as_well_is_no_second_view():
    """Horizontal stripes: every row fits the other half, and so it does after a move by a period."""
    stripes = np.repeat(100.0 + 40 * (np.arange(HEIGHT + 2) // 2 % 2), WIDTH).reshape(-1, WIDTH)[: HEIGHT - 4]
    assert codes([np.hstack([stripes, stripes])] * 3) == []


@pytest.mark.parametrize(("weight", "expected"), [(0.55, []), (0.95, ["two-views"])])
def test_the_fit_has_a_limit(weight, expected):
    """Detail of which a part is common to both halves."""
    one, other = detail(0), detail(1)
    mixed = weight * one + np.sqrt(1 - weight**2) * other
    assert codes([np.hstack([shading() + one, shading() + mixed])] * 3) == expected


@pytest.mark.data
def test_parts_of_recorded_clips_are_one_view_and_a_recorded_pair_is_two():
    """Halves of these parts have a correlation above 0.6, those of the whole pictures have not."""
    sinus = sorted((data_folder("sinus_endoscopy") / "images").iterdir())[::8]
    pictures = [read_picture(file)[::2, ::2] for file in sinus]
    height, width = pictures[0].shape[:2]
    for rows, columns in ((slice(height // 2), slice(None)), (slice(height // 2, None), slice(width // 2, None))):
        assert codes([small_picture(picture[rows, columns]).mean(axis=2) for picture in pictures]) == []
    cutting = sorted((data_folder("endonerf_cutting") / "images").iterdir())[::40]
    assert codes([small_picture(read_picture(file)[:256]).mean(axis=2) for file in cutting]) == []
    video = cv2.VideoCapture(str(data_folder("surgt_davinci") / "video.mp4"))
    pair = [small_picture(np.asarray(video.read()[1], np.uint8)).mean(axis=2) for _ in range(3)]
    assert codes(pair) == ["two-views"]
