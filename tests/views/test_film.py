"""Films and panels: what is written is what was shown."""

import numpy as np
import pytest
from PIL import Image

from endotsr.errors import InputError
from endotsr.evaluation.depth import normalised_depth
from endotsr.report.figures import EXCLUDED
from endotsr.sequences.sequence import Frame
from endotsr.splatting.render import RenderOut
from endotsr.views.film import check_film, write_film
from endotsr.views.panels import Scale, panel, side_by_side
from film_reader import read_video


def pictures(count, height=48, width=64):
    """A bright square that moves to the right over a gradient."""
    ground = np.linspace(40, 160, width)[None, :, None] * np.ones((height, 1, 3))
    made = []
    for k in range(count):
        picture = ground.copy()
        picture[16:32, 4 * k : 4 * k + 16] = (220, 60, 60)
        made.append(picture.astype(np.uint8))
    return made


@pytest.mark.parametrize("ending", [".mp4", ".webm"])
def test_a_film_holds_its_pictures_in_order(ending, tmp_path, capfd):
    shown = pictures(6)
    assert write_film(tmp_path / f"a{ending}", shown, 10.0) == 6
    read = read_video(tmp_path / f"a{ending}")
    assert len(read) == 6
    errors = np.array([[np.abs(a.astype(float) - b).mean() for b in shown] for a in read])
    assert (errors.argmin(axis=1) == np.arange(6)).all() and errors.diagonal().max() < 6
    assert capfd.readouterr().err == "" and [p.name for p in tmp_path.iterdir()] == [f"a{ending}"]


def test_a_gif_holds_its_pictures_and_its_rate(tmp_path):
    shown = pictures(5)
    assert write_film(tmp_path / "a.gif", iter(shown), 20.0) == 5
    with Image.open(tmp_path / "a.gif") as film:
        assert (film.n_frames, film.info["duration"], film.info["loop"]) == (5, 50, 0)
        for k, picture in enumerate(shown):
            film.seek(k)
            assert np.abs(np.asarray(film.convert("RGB")).astype(float) - picture).mean() < 4


def test_odd_sides_are_repeated(tmp_path):
    write_film(tmp_path / "a.mp4", pictures(2, 47, 63), 10.0)
    assert read_video(tmp_path / "a.mp4")[0].shape == (48, 64, 3)


@pytest.mark.parametrize("ending", [".mp4", ".gif"])
def test_a_film_without_a_picture_is_refused_and_leaves_nothing(ending, tmp_path):
    with pytest.raises(InputError, match="a film needs a picture"):
        write_film(tmp_path / f"a{ending}", [], 10.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "rate", "said"),
    [("a.avi", 10, "allowed: a name that ends in .mp4"), ("a", 10, "not a film"), ("a.mp4", 0, "--rate 0"),
     ("a.gif", 60, "0.1 to 50"), ("a.mp4", float("nan"), "--rate nan")],
)  # fmt: skip
def test_names_and_rates_that_no_film_has_are_refused(name, rate, said, tmp_path):
    with pytest.raises(InputError) as refused:
        check_film(tmp_path / name, rate)
    assert said in str(refused.value)


@pytest.fixture
def out():
    rng = np.random.default_rng(2)
    opacity = np.array([[0.0, 0.5], [0.25, 1.0]])
    return RenderOut(rng.uniform(0, 1, (3, 2, 2)), opacity * [[9, 10], [12, 16]], opacity)


def test_normalised_depth_is_the_depth_of_what_is_seen(out):
    assert np.allclose(normalised_depth(out), [[0, 10], [12, 16]])


def test_panels_stand_side_by_side(out):
    frame = Frame(np.full((3, 2, 2), 0.5), np.array([[True, False], [True, True]]), out.depth, 0.0, None)
    row = side_by_side(("render", "truth", "error", "depth", "opacity"), out, Scale(10, 16), frame)
    assert row.shape == (2, 5 * 2 + 4 * 4, 3)
    assert (row[:, 6:8] == 128).all() and tuple(row[0, 13]) == EXCLUDED, "truth, and the excluded pixel of the error"
    assert tuple(row[0, 18]) == EXCLUDED, "no depth where nothing is opaque"
    assert (row[1, 25] == 255).all() and (row[0, 24] == 0).all(), "opacity"
    with pytest.raises(ValueError, match="needs the frame"):
        panel("truth", out, Scale(10, 16))
