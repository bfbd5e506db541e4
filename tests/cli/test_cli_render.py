"""`render`: cameras, sizes, depth and films of a trained run, and what is refused."""

import gc
import json
import weakref

import numpy as np
import pytest
from tiny import assert_refused, render

import endotsr
from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png
from endotsr.results.evaluation.baselines import unit_image
from endotsr.results.evaluation.recorded_texture import with_recorded_texture
from endotsr.results.report.figures import bytes_image
from endotsr.results.views import pictures
from film_reader import read_video


def test_a_shifted_camera_moves_the_picture_and_is_named(finished_run, tmp_path):
    at = ("--times", "0.5", "--npy")
    render(finished_run, tmp_path / "a", *at)
    about = render(finished_run, tmp_path / "b", *at, "--offset", "4", "0", "0")
    a, b = (np.load(tmp_path / name / "colour" / "00000.npy") for name in "ab")
    assert not np.array_equal(a, b)
    assert about["pictures"][0]["camera"]["translation"][0] == pytest.approx(-4)


def test_another_size_shows_the_same_scene(finished_run, tmp_path):
    at = ("--times", "0.5", "--npy")
    render(finished_run, tmp_path / "a", *at)
    render(finished_run, tmp_path / "b", *at, "--size", "96x64")
    a, b = (np.load(tmp_path / name / "colour" / "00000.npy") for name in "ab")
    assert b.shape == (3, 64, 96)
    halved = b.reshape(3, 32, 2, 48, 2).mean(axis=(2, 4))
    alike, shifted = (np.corrcoef(halved.ravel(), picture.ravel())[0, 1] for picture in (a, np.roll(a, 1, axis=2)))
    assert alike > 0.95 > 0.9 > shifted  # small Gaussians are wider at the smaller size, and not elsewhere


def test_normalised_depth_is_the_accumulated_one_over_the_opacity(finished_run, tmp_path):
    at = ("--times", "0.5", "--npy")
    render(finished_run, tmp_path / "a", *at)
    about = render(finished_run, tmp_path / "b", *at, "--depth", "normalised")
    depth, opacity = (np.load(tmp_path / "a" / name / "00000.npy") for name in ("depth", "opacity"))
    normalised = np.load(tmp_path / "b" / "depth" / "00000.npy")
    assert np.allclose(normalised * opacity, depth, atol=1e-4)
    assert about["about"].endswith(", normalised by opacity")


@pytest.mark.parametrize("camera", ["orbit", "sway"])
def test_a_path_gives_every_picture_its_camera(camera, finished_run, tmp_path):
    about = render(finished_run, tmp_path / "a", "--count", "4", "--camera", camera, "--angle", "20")
    rotations = [tuple(np.ravel(p["camera"]["rotation"])) for p in about["pictures"]]
    assert len(set(rotations)) > 2
    colours = [read_png(tmp_path / "a" / "colour" / p["file"]).mean() for p in about["pictures"]]
    assert min(colours) > 20, "the scene stays in the picture"


def test_cameras_of_a_file_that_render_json_names_give_the_same_picture(finished_run, tmp_path):
    about = render(finished_run, tmp_path / "a", "--count", "3", "--camera", "orbit")
    file = tmp_path / "path.json"
    file.write_text(json.dumps({"cameras": [p["camera"] for p in about["pictures"]]}))
    render(finished_run, tmp_path / "b", "--count", "3", "--camera", str(file))
    for picture in about["pictures"]:
        a, b = (read_png(tmp_path / name / "colour" / picture["file"]) for name in "ab")
        assert np.array_equal(a, b)


@pytest.mark.parametrize("film", ["a.mp4", "a.gif"])
def test_a_film_of_cameras_of_several_sizes_is_refused(film, finished_run, tmp_path, capsys):
    """They were written into one film, distorted or beside one another; pictures may have them."""
    about = render(finished_run, tmp_path / "a", "--count", "3", "--camera", "orbit")
    cameras = [p["camera"] for p in about["pictures"]]
    cameras[1] = {**cameras[1], "width": 20}
    (tmp_path / "path.json").write_text(json.dumps({"cameras": cameras}))
    words = ["render", str(finished_run), "--count", "3", "--camera", str(tmp_path / "path.json")]
    assert main([*words, "--film", str(tmp_path / film)]) == 2
    assert "views of 48x32, 20x32; use one size" in capsys.readouterr().err
    assert main([*words, "--film", str(tmp_path / film), "--size", "24x16"]) == 0
    assert main([*words, "--out", str(tmp_path / "b")]) == 0


def test_a_film_of_panels_beside_its_pictures(finished_run, tmp_path, capsys):
    film = tmp_path / "film.webm"
    words = ["--frames", "train", "--film", str(film), "--panels", "render", "truth", "error", "depth"]
    render(finished_run, tmp_path / "a", *words)
    read = read_video(film)
    assert len(read) == 8 and read[0].shape == (32, 4 * 48 + 3 * 4, 3)
    assert f"{film}: 8 pictures" in capsys.readouterr().out
    first = sorted((tmp_path / "a" / "colour").iterdir())[0]
    assert np.abs(read[0][:, :48].astype(float) - read_png(first)).mean() < 12


def test_a_film_alone_shows_all_frames(finished_run, tmp_path):
    assert main(["render", str(finished_run), "--film", str(tmp_path / "film.gif")]) == 0
    assert [p.name for p in tmp_path.iterdir()] == ["film.gif"]


def test_a_film_in_slow_motion(run_copy, tmp_path, capsys):
    run = run_copy
    record = json.loads((run / "sequence.json").read_text(encoding="utf-8"))
    (run / "sequence.json").write_text(json.dumps(record | {"duration": 0.9}), encoding="utf-8")
    for words, said in (
        ([], "9 pictures, 0.9 s, 1 times the speed"),
        (["--slow", "2"], "9 pictures, 1.8 s, 0.5 times"),
    ):
        assert main(["render", str(run), "--film", str(tmp_path / "a.mp4"), *words]) == 0
        assert said in capsys.readouterr().out
    assert len(read_video(tmp_path / "a.mp4")) == 9
    assert main(["render", str(run), "--film", str(tmp_path / "a.gif"), "--rate", "30"]) == 0
    assert "9 pictures, 0.3 s, 3.33 times the speed" in capsys.readouterr().out, "its pictures last 0.03 s"
    assert_refused(capsys, ["render", str(run), "--film", str(tmp_path / "a.mp4"), "--slow", "2", "--rate", "9"], "one")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["--out", "{}/film.mp4"],
            "film.mp4: --out is a folder of pictures, but this is the name of a .mp4 file; --film",
        ),
        (["--out", "{}/a.png"], "the name of a .png file"),
        (["--film", "{}/a.avi"], "a.avi: not a film; use a name that ends in one of .mp4, .webm, .gif"),
        (["--film", "{}/none/a.mp4"], "a.mp4: cannot be written"),
        (["--film", "{}/a.mp4", "--rate", "0"], "--rate 0 is not allowed"),
        (["--film", "{}/a.mp4", "--panels"], "--panels: missing value {render,truth,error,depth,opacity} ..."),
        (["--film", "{}/a.mp4", "--panels", "truth", "--count", "5"], "--panels truth at time 0.25: no frame has"),
        (["--film", "{}/a.mp4", "--panels", "error", "--offset", "1", "0", "0"], "--panels error at time 0:"),
        (["--out", "{}/a", "--camera", "circle"], "--camera 'circle' is not allowed; use observed, orbit, sway"),
        (["--out", "{}/a", "--camera", "{}/no.json"], "no.json: cannot be read"),
        (["--out", "{}/a", "--camera", "-1"], "--camera -1 is not allowed; use a frame from 0 to 8"),
        (["--out", "{}/a", "--camera=--5"], "--camera '--5' is not allowed; use observed, orbit, sway"),
        (["--out", "{}/a", "--size", "12"], "--size '12' is not allowed; use WIDTHxHEIGHT"),
        (["--out", "{}/a", "--size", "0x9"], "use an integer from 1 to 16384"),
        (["--out", "{}/a", "--camera", "orbit", "--angle", "90"], "--angle 90 is not allowed"),
        (["--out", "{}/a", "--offset", "nan", "0", "0"], "--offset is not allowed"),
    ],
)
def test_render_refuses_in_one_line_and_leaves_nothing(words, said, finished_run, tmp_path, capsys):
    assert_refused(capsys, ["render", str(finished_run), *(word.format(tmp_path) for word in words)], said)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [["--out", "{}/a"], ["--film", "{}/a.gif", "--frames", "test"]])
def test_a_run_without_held_out_frames_names_the_other_choices(words, run_copy, tmp_path, capsys):
    """As a training in Python on a sequence without a split leaves it."""
    file = run_copy / "sequence.json"
    record = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps(record | {"test_index": []}), encoding="utf-8")
    words = [word.format(tmp_path) for word in words]
    assert_refused(capsys, ["render", str(run_copy), *words], "render: no frame is held out; use --frames train")
    assert not (tmp_path / "a").exists()


def test_a_picture_that_is_written_is_not_kept_in_memory(finished_run, tmp_path, monkeypatch):
    """The first one alone is, for the scale of the depth; a recording has thousands."""
    written, alive = [], []

    def watched(colour):
        written.append(weakref.ref(colour))
        if len(written) == 9:  # the last one; to look for cycles takes seconds in a process of many tests
            gc.collect()
            alive.extend(reference for reference in written if reference() is not None)
        return bytes_image(colour)

    monkeypatch.setattr(pictures, "bytes_image", watched)
    render(finished_run, tmp_path / "a", "--frames", "all")
    assert len(written) == 9 and 1 <= len(alive) <= 3


def test_texture_shows_the_training_frame_at_its_time_and_the_evaluated_picture_between(finished_run, tmp_path):
    run = endotsr.open_run(finished_run)
    sequence = run.sequence
    for frames, name in (("train", "a"), ("test", "b")):
        render(finished_run, tmp_path / name, "--frames", frames, "--npy", "--texture")
    shown = np.load(next(iter(sorted((tmp_path / "a" / "colour").glob("*.npy")))))
    first = int(sequence.train_index[0])
    error = np.abs(shown - unit_image(sequence, first))[:, sequence.masks[first]]
    assert np.median(error) < 1e-4 and error.mean() < 0.01, "bicubic interpolation at an edge of the mask"
    index = int(sequence.test_index[0])
    between = np.load(next(iter(sorted((tmp_path / "b" / "colour").glob("*.npy")))))
    expected = with_recorded_texture(sequence, index, lambda k: run.render(float(sequence.times[k]), k).colour)
    assert np.abs(between - expected).max() < 1e-6
    metrics = json.loads((finished_run / "metrics.json").read_text())
    assert metrics["recorded_texture"]["mean"]["psnr_tissue"] > metrics["held_out"]["mean"]["psnr_tissue"]


@pytest.mark.parametrize("words", [("--camera", "orbit"), ("--offset", "1", "0", "0"), ("--size", "96x64")])
def test_texture_is_of_the_cameras_of_the_recording(words, finished_run, tmp_path, capsys):
    said = ("--texture", "the views of the recording alone", "--camera observed")
    assert_refused(capsys, ["render", str(finished_run), "--out", str(tmp_path / "a"), "--texture", *words], *said)


def test_texture_of_a_film_without_colour_is_refused(finished_run, tmp_path, capsys):
    words = ["render", str(finished_run), "--film", str(tmp_path / "a.gif"), "--panels", "depth", "--texture"]
    assert_refused(capsys, words, "--texture has no effect without", "no colour is written")


def test_texture_needs_the_frames_of_a_run(finished_run, tmp_path, capsys):
    assert main(["export", str(finished_run), "--out", str(tmp_path / "slim.npz")]) == 0
    words = ["render", str(tmp_path / "slim.npz"), "--out", str(tmp_path / "a"), "--texture"]
    capsys.readouterr()
    assert_refused(capsys, words, "--texture needs the frames of one training")
