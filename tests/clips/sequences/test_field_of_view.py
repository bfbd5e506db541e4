"""A dark border that all frames share is excluded by `prepare`, kept on request, and never by surprise."""

import shutil

import msgspec
import numpy as np
import pytest
from made_videos import files, write

from endotsr.cli.main import main
from endotsr.clips.formats.camera import intrinsics_of_view
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.field_of_view import FieldOfView
from endotsr.clips.sequences.sequence_file import read_sequence_file
from endotsr.config import PAPER
from endotsr.errors import InputError

HEIGHT, WIDTH, FRAMES = 120, 160, 5
ROW, COLUMN = np.mgrid[:HEIGHT, :WIDTH]
INSIDE = (ROW - 60) ** 2 + (COLUMN - 80) ** 2 < 45**2


def scope(count=FRAMES, shape=INSIDE):
    """Tissue that moves behind a round view; the border is dark and noisy."""
    rng = np.random.default_rng(0)
    tissue = rng.integers(90, 200, (HEIGHT, WIDTH + count, 3), np.uint8)
    noise = rng.integers(0, 9, (count, HEIGHT, WIDTH, 3), np.uint8)
    return [np.where(shape[..., None], tissue[:, i : i + WIDTH], noise[i]) for i in range(count)]


def prepared(folder, *words, pictures=None):
    """The folder that `prepare` writes from a folder of pictures."""
    shutil.rmtree(folder / "source", ignore_errors=True)
    files(folder, "source", pictures or scope())
    base = ["prepare", str(folder / "source"), "--out", str(folder / "clip"), "--replace", "--field-of-view", "70"]
    assert main([*base, *words]) == 0
    return folder / "clip"


def masks_of(clip):
    return [read_png(file) > 0 for file in sorted((clip / "masks").iterdir())]


def test_the_border_of_a_clip_without_masks_is_excluded_and_told(tmp_path, capsys):
    clip = prepared(tmp_path)
    assert "dark border that all frames share: it is excluded as outside" in capsys.readouterr().out
    entry = read_sequence_file(clip).masks
    assert entry is not None and entry.origin.startswith("field of view") and not entry.proposed
    for mask in masks_of(clip):
        assert mask[~INSIDE].all() and 0.6 < (~mask)[INSIDE].mean() < 1.0
    assert "dark-border" not in {found.code for found in check_sequence(clip, PAPER).findings}


def test_through_a_codec(tmp_path, capsys):
    write(tmp_path / "a.mp4", scope(), options={"crf": "20"})
    words = ["prepare", str(tmp_path / "a.mp4"), "--out", str(tmp_path / "clip"), "--field-of-view", "70"]
    assert main(words) == 0
    assert all(mask[~INSIDE].mean() > 0.99 for mask in masks_of(tmp_path / "clip"))


def test_the_border_can_be_kept(tmp_path, capsys):
    clip = prepared(tmp_path, "--border", "keep")
    assert "it counts as tissue, by --border keep" in capsys.readouterr().out
    assert not (clip / "masks").exists()
    assert "dark-border" in {found.code for found in check_sequence(clip, PAPER).findings}


def test_given_masks_stay_as_they_are_unless_the_border_is_excluded(tmp_path, capsys):
    tool = np.zeros((HEIGHT, WIDTH), np.uint8)
    tool[50:60, 60:80] = 255
    files(tmp_path, "given", [tool] * FRAMES)
    clip = prepared(tmp_path, "--masks", str(tmp_path / "given"))
    assert "dark in every frame" in capsys.readouterr().out
    assert all((mask == (tool > 0)).all() for mask in masks_of(clip))
    clip = prepared(tmp_path, "--masks", str(tmp_path / "given"), "--border", "exclude")
    assert "dark in every frame" not in capsys.readouterr().out
    for mask in masks_of(clip):
        assert mask[~INSIDE].all() and mask[tool > 0].all() and not mask[70:80, 70:90].any()
    assert read_sequence_file(clip).masks.origin.startswith("given, field of view")


def test_without_a_border_nothing_happens(tmp_path, capsys):
    whole = np.ones((HEIGHT, WIDTH), bool)
    clip = prepared(tmp_path, pictures=scope(shape=whole))
    assert "dark border" not in capsys.readouterr().out and not (clip / "masks").exists()
    prepared(tmp_path, "--border", "exclude", pictures=scope(shape=whole))
    assert "--border exclude changes nothing" in capsys.readouterr().out


def test_a_side_that_is_bright_once_is_tissue():
    view = FieldOfView()
    for i, picture in enumerate(scope()):
        picture[:, 80:] = 150 if i == 3 else 0
        view.add(picture)
    outside = view.outside()
    assert outside is not None and not outside[:, 90:].any() and outside[:, :20].all()


def test_pictures_of_two_sizes_have_no_common_border():
    view = FieldOfView()
    view.add(scope()[0])
    view.add(scope()[0][:100])
    assert view.outside() is None and FieldOfView().outside() is None


@pytest.mark.parametrize("degrees", [5, 60, 110, 170])
def test_the_angle_spans_the_picture(degrees):
    """The rays through the left and the right border enclose the angle."""
    found = intrinsics_of_view(degrees, 640, 360)
    left, right = np.arctan((np.array([0, 640]) - found.cx) / found.fx)
    assert np.degrees(right - left) == pytest.approx(degrees) and found.fx == found.fy and found.cy == 180


@pytest.mark.parametrize("degrees", [0, 1.2, 180, -60, float("nan")])
def test_an_angle_that_no_pinhole_camera_has_is_refused(degrees):
    with pytest.raises(InputError, match=r"--field-of-view .*use the horizontal angle, 5 to 170 degrees"):
        intrinsics_of_view(degrees, 640, 360)


def test_the_origin_of_the_border_is_repeated_by_proposed_masks(tmp_path):
    """`endotsr masks` unites the border with what it finds; it is no reason to refuse."""
    clip = prepared(tmp_path)
    before = msgspec.structs.asdict(read_sequence_file(clip).masks)
    code = main(["masks", str(clip)])
    after = read_sequence_file(clip).masks
    assert (code, msgspec.structs.asdict(after)) == (1, before) or "given" in after.origin
