"""A raw StereoMIS recording of the simulator goes through every command, one command a step, and keeps the scene."""

import numpy as np
import pytest
from tiny import SETTINGS, assert_refused

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.simulator.truth import read_truth
from endotsr.config import SequenceConfig
from film_reader import read_video

pytestmark = pytest.mark.slow

SCENE = ["moving-camera", "--instrument.on", "--width", "96", "--height", "80", "--frames", "9", "--noise.on", "false"]


def said(*words) -> None:
    assert main([str(word) for word in words]) == 0, words


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """The folder `raw` of the simulator, and `clip`, which prepare and depth made of it."""
    root = tmp_path_factory.mktemp("chain")
    said("simulate", *SCENE, "--out", root / "raw", "--layout", "stereomis")
    said("prepare", root / "raw", "--out", root / "clip")
    said("depth", root / "clip", "--nearest", "25", "--farthest", "120")
    return root


def test_the_raw_folder_is_in_the_published_layout(chain):
    raw = chain / "raw"
    assert sorted(p.name for p in raw.iterdir()) == [
        "StereoCalibration.ini", "groundtruth.txt", "masks", "simulated.mp4", "truth",
    ]  # fmt: skip
    lines = (raw / "groundtruth.txt").read_text().splitlines()
    assert [line.split()[0] for line in lines] == [str(i) for i in range(9)] and len(lines[3].split()) == 8
    mask = read_png(raw / "masks" / "000004l.png")
    covered = read_truth(raw).frame(4).instrument
    assert mask.shape == (80, 96) and (mask[covered] == 0).all() and 0.5 < (mask > 0).mean() < 1


def test_prepare_finds_cameras_pictures_masks_and_depth_of_the_scene(chain):
    said("simulate", *SCENE, "--out", chain / "clean")
    clean = read_sequence(chain / "clean", SequenceConfig(masks="gt_masks", depth_percentiles=(0.0, 100.0)))
    clip = describe(chain / "clip")
    truth = read_truth(chain / "clean")
    assert clip.intrinsics and clip.poses and clip.masks and clip.depth
    camera = clean.cameras[0]
    np.testing.assert_allclose(clip.intrinsics[:4], (camera.fx, camera.fy, camera.cx, camera.cy), rtol=1e-6)
    assert clip.baseline == pytest.approx(4.0)
    errors, covered = [], []
    for i, pair in enumerate(clip.pictures(list(range(9)))):
        pose, expected = clip.poses[i], clean.cameras[i]
        assert pose is not None
        np.testing.assert_allclose(pose.rotation, expected.rotation, atol=1e-12)
        np.testing.assert_allclose(pose.translation, expected.translation, atol=1e-9)
        apart = np.abs(pair.left.astype(float) - clean.images[i].transpose(1, 2, 0))
        assert apart.mean() < 6  # grey levels: what the video loses
        np.testing.assert_array_equal(clip.masks(i), clean.masks[i])
        depth, tissue = clip.depth(i), clean.masks[i]
        assert depth is not None
        known = (depth > 0) & tissue
        errors.append(np.abs(depth - truth.frame(i).depth)[known])
        covered.append(known.sum() / tissue.sum())
    assert np.median(np.concatenate(errors)) < 1.5 and np.mean(covered) > 0.5  # mm; a pixel of disparity is 7 mm here


def test_the_rest_of_the_way_takes_one_command_each(chain, capsys):
    clip, run = chain / "clip", chain / "run"
    said("check", clip)
    said("train", clip, "--out", run, *SETTINGS, "--iterations", "6")
    said("evaluate", run)
    assert "Optical-flow" in capsys.readouterr().out
    said("render", run, "--film", chain / "film.mp4")
    assert len(read_video(chain / "film.mp4")) == 9


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--stereo.on", "false"], ("stereo.on = False does not fit the layout stereomis",)),
        (["--width", "97"], ("width = 97 does not fit a video", "even")),
        (["--layout", "colmap"], ("layout", "endonerf or stereomis")),
        (["--layout", "endonerf", "--lossless"], ("--lossless needs --layout stereomis",)),
    ],
)
def test_what_the_layout_cannot_hold_is_refused(tmp_path, capsys, words, named):
    first = ["--layout", "stereomis"] if "--layout" not in words else []
    assert_refused(capsys, ["simulate", *SCENE, *first, *words, "--out", str(tmp_path / "out")], *named)
    assert list(tmp_path.iterdir()) == []


def test_a_film_without_loss_holds_the_pictures_of_the_other_layout(tmp_path):
    scene = [*SCENE, "--width", "48", "--height", "40", "--frames", "4"]
    said("simulate", *scene, "--out", tmp_path / "raw", "--layout", "stereomis", "--lossless")
    said("simulate", *scene, "--out", tmp_path / "clean")
    said("prepare", tmp_path / "raw", "--out", tmp_path / "clip")
    for name in ("images", "images_right"):
        for file in sorted((tmp_path / "clean" / name).iterdir()):
            np.testing.assert_array_equal(read_png(tmp_path / "clip" / name / file.name), read_png(file))


def test_without_instruments_there_are_no_masks(tmp_path, capsys):
    words = [*SCENE, "--instrument.on", "false", "--width", "48", "--height", "40", "--frames", "4"]
    said("simulate", *words, "--out", tmp_path / "raw", "--layout", "stereomis")
    assert not (tmp_path / "raw" / "masks").exists()
    said("prepare", tmp_path / "raw", "--out", tmp_path / "clip")
    assert "masks/ is missing: every pixel counts as tissue" in capsys.readouterr().out
