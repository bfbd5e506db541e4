"""Films and panels: what is written is what was shown."""

from pathlib import Path

import av
import numpy as np
import pytest
from browser import seen
from PIL import Image

from endotsr.clips.formats import film_file
from endotsr.clips.formats.video_file import video_facts
from endotsr.clips.sequences.sequence import Frame
from endotsr.errors import InputError
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.depth import normalised_depth
from endotsr.results.report.figures import EXCLUDED
from endotsr.results.views.film import check_film, film_rate, played_rate, speed_in_words, write_film
from endotsr.results.views.panels import Scale, panel, side_by_side
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
    [("a.avi", 10, "use a name that ends in one of .mp4"), ("a", 10, "not a film"), ("a.mp4", 0, "--rate 0"),
     ("a.gif", 60, "0.1 to 50"), ("a.mp4", float("nan"), "--rate nan")],
)  # fmt: skip
def test_names_and_rates_that_no_film_has_are_refused(name, rate, said, tmp_path):
    with pytest.raises(InputError) as refused:
        check_film(tmp_path / name, rate)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("name", "count", "duration", "slow", "rate"),
    [("a.mp4", 50, 2.0, None, 25.0), ("a.mp4", 50, 2.0, 2.5, 10.0), ("a.mp4", 50, 2.0, 0.25, 100.0),
     ("a.mp4", 50, 0.0, None, 15.0), ("a.mp4", 1, 2.0, None, 15.0),
     ("a.mp4", 500, 2.0, None, 60.0), ("a.gif", 500, 2.0, None, 50.0), ("a.mp4", 4, 8.0, None, 1.0)],
)  # fmt: skip
def test_a_film_is_as_fast_as_the_recording_or_slower(name, count, duration, slow, rate):
    """`count` frames of a recording of `duration` seconds."""
    times = [k / count for k in range(count)]
    assert film_rate(Path(name), times, duration, slow) == pytest.approx(rate)


@pytest.mark.parametrize(("name", "rate", "played"), [("a.gif", 30, 100 / 3), ("a.gif", 50, 50), ("a.mp4", 30, 30)])
def test_the_rate_that_is_said_is_that_of_the_film(name, rate, played):
    """A picture of a gif lasts whole hundredths of a second: 3 of them at 30 pictures per second."""
    assert played_rate(Path(name), rate) == pytest.approx(played)


def test_the_speed_of_a_film_is_said():
    times = [k / 50 for k in range(50)]
    assert speed_in_words(times, 2.0, 10.0) == ", 0.4 times the speed of the recording"
    assert speed_in_words(times, 0.0, 10.0) == "" and speed_in_words([0.5], 2.0, 10.0) == ""


@pytest.mark.parametrize(
    ("times", "duration", "slow", "said"),
    [([0, 0.5], 0.0, 2.0, "rate is unknown; use --rate"), ([0.5, 0], 2.0, 2.0, "not in order of time"),
     ([0.5], 2.0, 2.0, "one picture has no speed"),
     ([0, 0.5], 2.0, 100.0, "--slow 100 gives 0.01 pictures per second; use --slow from 0.00833 to 10 with 2")],
)  # fmt: skip
def test_a_speed_that_no_film_can_have_is_refused(times, duration, slow, said):
    with pytest.raises(InputError) as refused:
        film_rate(Path("a.mp4"), times, duration, slow)
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


PLAYER = """<!doctype html><title>film</title><video src="FILM" muted></video><pre id="probe"></pre><script>
const film = document.querySelector("video"), canvas = document.createElement("canvas");
const say = found => document.getElementById("probe").textContent = JSON.stringify(found);
// The clock of the page runs ahead of the decoder on a loaded machine: work keeps it back.
const work = setInterval(() => {
  let sum = 0;
  for (let k = 0; k < 2e7; k++) sum += Math.sqrt(k);
  if (sum < 0 || document.getElementById("probe").textContent) clearInterval(work);
}, 100);
film.onerror = () => say({error: film.error.message});
film.onloadedmetadata = () => { film.currentTime = 0.25; };
film.onseeked = () => {
  canvas.width = film.videoWidth; canvas.height = film.videoHeight;
  const drawing = canvas.getContext("2d");
  drawing.drawImage(film, 0, 0);
  const at = (x, y) => [...drawing.getImageData(x, y, 1, 1).data].slice(0, 3);
  const [width, height, seconds] = [film.videoWidth, film.videoHeight, film.duration];
  say({width, height, seconds, square: at(14, 24), ground: at(60, 4)});
};
</script>"""


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".mp4", ".webm"])
def test_a_browser_plays_a_film_with_its_colours(ending, tmp_path):
    """Picture 2 of 6, at 0.2 to 0.3 s, has the red square at columns 8 to 24."""
    write_film(tmp_path / f"film{ending}", pictures(6), 10.0)
    (tmp_path / "page.html").write_text(PLAYER.replace("FILM", f"film{ending}"))
    found = seen(tmp_path / "page.html", "--allow-file-access-from-files")
    assert "error" not in found, found
    assert (found["width"], found["height"]) == (64, 48) and found["seconds"] == pytest.approx(0.6, abs=0.05)
    assert np.abs(np.subtract(found["square"], (220, 60, 60))).max() < 12, found
    assert np.abs(np.subtract(found["ground"], pictures(1)[0][4, 60])).max() < 8, found


def test_an_mp4_is_h264_where_there_is_an_encoder_and_vp9_otherwise(tmp_path, monkeypatch):
    write_film(tmp_path / "a.mp4", pictures(2), 10.0)
    has_encoder = film_file.encoder_of(tmp_path / "a.mp4") in film_file.H264
    assert video_facts(tmp_path / "a.mp4").codec == ("h264" if has_encoder else "vp9")
    with av.open(str(tmp_path / "a.mp4")) as container:
        assert container.streams.video[0].codec_context.pix_fmt == "yuv420p", "PowerPoint and QuickTime read no other"
    content = (tmp_path / "a.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat"), "a browser plays it while it loads"
    monkeypatch.setitem(film_file.BY_ENDING, ".mp4", film_file.VP9)
    write_film(tmp_path / "b.mp4", pictures(2), 10.0)
    assert video_facts(tmp_path / "b.mp4").codec == "vp9"
    monkeypatch.setitem(film_file.BY_ENDING, ".mp4", (film_file.Encoder("none_of_these", {}),))
    with pytest.raises(InputError, match=r"no encoder for it \(none_of_these\); use a name in .gif"):
        write_film(tmp_path / "c.mp4", pictures(2), 10.0)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.mp4", "b.mp4"]


def test_a_film_without_loss_holds_its_pictures_bit_by_bit(tmp_path):
    film_file.write_video(tmp_path / "a.mp4", pictures(3), 10.0, lossless=True)
    assert all((a == b).all() for a, b in zip(read_video(tmp_path / "a.mp4"), pictures(3), strict=True))


def test_the_same_pictures_give_the_same_film_whatever_memory_held_before(tmp_path):
    """Of a width that is no multiple of 32 pixels; the memory between the films has other content each time."""
    random = np.random.default_rng(0)
    texture = np.kron(random.integers(0, 256, (24, 30, 3)), np.ones((8, 8, 1), np.int64)).astype(np.uint8)
    found = set()
    for k in range(12):
        random.integers(0, 255, (k + 1) * 70_000, np.uint8)
        film_file.write_video(tmp_path / "a.mp4", (np.roll(texture, 3 * i, axis=1) for i in range(24)), 25.0)
        found.add((tmp_path / "a.mp4").read_bytes())
    assert len(found) == 1


def test_a_place_that_cannot_be_written_is_an_error_of_the_file_system(tmp_path):
    with pytest.raises(OSError):
        film_file.write_video(tmp_path / "none" / "a.mp4", pictures(2), 10.0)
    assert list(tmp_path.iterdir()) == []


def test_pictures_out_of_order_have_no_speed(tmp_path):
    file, times = tmp_path / "a.gif", [0.0, 0.9, 0.5]
    assert film_rate(file, times, 2.0) == 15 and speed_in_words(times, 2.0, 15) == ""
    with pytest.raises(InputError, match="not in order of time"):
        film_rate(file, times, 2.0, slow=2.0)
    assert film_rate(file, [0.0, 0.5, 0.5, 1.0], 0.3) == 10 and "1 times" in speed_in_words([0.0, 0.5, 1.0], 0.2, 10)
