"""`endotsr depth`: a simulated pair gives its true depth, holes stay holes, other programs' files are read exactly."""

import numpy as np
import pytest
from common_folder import FRAMES, HEIGHT, WIDTH, write_plane, written
from made_videos import files
from stereo_pairs import BASELINE, LENS, slanted_pair, stereo_folder, texture

from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.opencv.png import read_png
from endotsr.clips.prepare.make_depth import depth_of_values, from_files, write_depth
from endotsr.clips.prepare.stereo_depth import StereoSettings, disparity_range, stereo_depth, temporal_median
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence_file import FILE_NAME, read_sequence_file
from endotsr.config import SequenceConfig
from endotsr.errors import InputError

SETTINGS = StereoSettings(nearest=25.0, farthest=120.0)


@pytest.mark.parametrize("smooth", [True, False])
def test_a_slanted_plane(smooth):
    left, right, disparity = slanted_pair()
    settings = StereoSettings(nearest=25.0, farthest=120.0, smooth=smooth)
    found = stereo_depth(left, right, LENS, BASELINE, settings)
    truth = LENS.fx * BASELINE / disparity
    inside = np.arange(160)[None, :] - disparity >= 8  # seen by both
    known = (found > 0) & inside
    assert known.sum() > 0.95 * inside.sum()
    apart = np.abs(LENS.fx * BASELINE / found[known] - disparity[known])
    assert np.median(apart) < 0.15 and np.percentile(apart, 95) < 0.6  # pixels
    assert np.median(np.abs(found[known] - truth[known])) < 0.5  # mm


def test_what_only_one_camera_sees_has_no_depth():
    left, right, disparity = slanted_pair()
    left[30:70, 60:100] = texture(*np.meshgrid(np.arange(40.0), np.arange(40.0)), seed=9)
    depth = stereo_depth(left, right, LENS, BASELINE, SETTINGS)
    assert (depth[40:60, 70:90] > 0).mean() < 0.2
    assert not depth[np.arange(160)[None, :] - disparity < -1].any()  # outside of the right picture


def test_a_pair_that_does_not_belong_together_has_almost_no_depth():
    left, right = slanted_pair(0)[0], slanted_pair(5)[1]
    assert (stereo_depth(left, right, LENS, BASELINE, SETTINGS) > 0).mean() < 0.1


def test_the_scale_is_metric():
    left, right, _ = slanted_pair()
    near = stereo_depth(left, right, LENS, BASELINE, SETTINGS)
    twice = StereoSettings(nearest=50.0, farthest=240.0)
    far = stereo_depth(left, right, LENS, 2 * BASELINE, twice)
    np.testing.assert_allclose(far, 2 * near, rtol=1e-6)


@pytest.mark.parametrize(("nearest", "farthest"), [(30.0, 20.0), (0.5, 100.0), (0.0, 10.0)])
def test_an_impossible_range_is_refused(nearest, farthest):
    with pytest.raises(InputError, match=r"use (two ascending|a larger --nearest)"):
        disparity_range(StereoSettings(nearest=nearest, farthest=farthest), LENS, BASELINE)


def test_every_depth_in_range_is_searched():
    lowest, count = disparity_range(SETTINGS, LENS, BASELINE)
    assert lowest <= 1200 / 120 and lowest + count - 1 >= 1200 / 25 and count % 16 == 0


def test_the_median_along_the_flow_removes_a_single_wrong_frame():
    column, row = np.meshgrid(np.arange(160.0), np.arange(120.0))
    pictures = [texture(column + 2.0 * k, row) for k in range(3)]
    depths = [(50 + 0.1 * (column + 2.0 * k)).astype(np.float32) for k in range(3)]
    truth = depths[1].copy()
    depths[1][50:60, 70:90] += 30
    depths[1][:10] = 0
    found = temporal_median(depths, pictures, 1)
    assert np.abs(found[50:60, 70:90] - truth[50:60, 70:90]).max() < 0.3
    assert not found[:10].any()  # a hole stays one


@pytest.mark.parametrize("ending", [".npy", ".pfm", ".tiff"])
def test_disparity_of_another_program(tmp_path, ending):
    written(tmp_path / "clip", depth=False)
    (tmp_path / "raft").mkdir()
    column = np.arange(WIDTH, dtype=np.float32)
    for i in range(FRAMES):
        plane = np.tile(2 + column / 16, (HEIGHT, 1)).astype(np.float32)
        plane[0] = np.nan
        plane[1] = 0
        write_plane(tmp_path / "raft" / f"{i:06d}{ending}", plane)
    report = write_depth(tmp_path / "clip", from_files(tmp_path / "clip", tmp_path / "raft", "disparity", 1.0))
    sequence = read_sequence(tmp_path / "clip", SequenceConfig(depth_percentiles=(0.0, 100.0)), 0.2)
    assert not sequence.depth[:, :2].any()
    expected = 30.0 * 4.0 / (2 + column / 16)
    np.testing.assert_allclose(sequence.depth[:, 2:], np.broadcast_to(expected, (FRAMES, HEIGHT - 2, WIDTH)), atol=0.01)
    assert report.coverage[0] == pytest.approx(1 - 2 / HEIGHT) and report.file.depth is not None
    assert "disparity from raft" in report.file.depth.method


@pytest.mark.parametrize("ending", [".npy", ".tiff"])
def test_one_file_is_the_depth_of_all_frames(tmp_path, ending, capsys):
    written(tmp_path / "clip", depth=False)
    plane = np.tile(np.linspace(40.0, 60.0, WIDTH, dtype=np.float32), (HEIGHT, 1))
    write_plane(tmp_path / f"rest{ending}", plane)
    words = ["depth", str(tmp_path / "clip"), "--given", str(tmp_path / f"rest{ending}"), "--kind", "depth"]
    assert main(words) == 0 and f"rest{ending}: taken for all {FRAMES} frames" in capsys.readouterr().out
    found = describe(tmp_path / "clip").depth
    for i in range(FRAMES):
        np.testing.assert_allclose(found(i), plane, atol=0.02)


def test_disparity_of_another_size_and_sign():
    intrinsics = Intrinsics(30.0, 33.0, 15.0, 13.0, 32, 24)
    small = np.full((12, 16), -1.5, np.float32)  # half the size: half the disparity
    np.testing.assert_allclose(depth_of_values(small, "disparity", 1.0, intrinsics, 4.0, "x"), 30 * 4 / 3.0)
    with pytest.raises(InputError, match="16x24 pixels, the pictures have 32x24"):
        depth_of_values(np.ones((24, 16)), "depth", 1.0, intrinsics, 4.0, "x")
    with pytest.raises(InputError, match="baseline"):
        depth_of_values(small, "disparity", 1.0, intrinsics, None, "x")


def test_the_command_makes_a_sequence_that_can_be_trained_on(tmp_path, capsys):
    clip = tmp_path / "my clip"
    stereo_folder(clip)
    words = ["depth", str(clip), "--nearest", "25", "--farthest", "120"]
    assert main(words) == 0
    assert f"next: endotsr train '{clip}' --out RUN" in capsys.readouterr().out
    sequence = read_sequence(clip, SequenceConfig(), 0.2)
    assert np.median(sequence.depth[sequence.depth > 0]) == pytest.approx(53, abs=3)
    assert main(words) == 2 and "--replace" in capsys.readouterr().err
    before = read_png(clip / "depth/000001.png")
    assert main([*words, "--replace", "--temporal"]) == 0
    after = read_png(clip / "depth/000001.png")
    assert ((after > 0) == (before > 0)).all()
    assert not [p for p in clip.iterdir() if p.name.startswith(".")]


@pytest.mark.parametrize("case", ["mono", "no baseline", "wrong baseline"])
def test_what_cannot_be_matched_is_refused_and_nothing_changes(tmp_path, case, capsys):
    stereo_folder(tmp_path / "clip")
    file = tmp_path / "clip" / FILE_NAME
    if case == "mono":
        for picture in (tmp_path / "clip/images_right").iterdir():
            picture.unlink()
        (tmp_path / "clip/images_right").rmdir()
    else:
        new = {"no baseline": "baseline = 0.0", "wrong baseline": "baseline = 4000.0"}[case]
        file.write_text(file.read_text().replace("baseline = 4.0", new))
    before = file.read_text()
    assert main(["depth", str(tmp_path / "clip")]) == 2
    said = capsys.readouterr().err
    assert {"mono": "no right pictures", "no baseline": "baseline is unknown", "wrong baseline": "right baseline"}[
        case
    ] in said
    assert file.read_text() == before and not (tmp_path / "clip/depth").exists()
    assert read_sequence_file(tmp_path / "clip").depth is None


@pytest.mark.data
def test_a_real_pair_agrees_with_the_given_depth():
    """One pair of a public sequence; its baseline is not published and was fitted to the given depth, 4.3 mm."""
    folder = data_folder("endonerf_pulling")
    files = [sorted((folder / name).iterdir())[0] for name in ("images", "images_right", "depth", "gt_masks")]
    left, right, given, mask = (read_png(file) for file in files)
    intrinsics = Intrinsics(569.468, 569.468, 320.0, 256.0, 640, 512)
    depth = stereo_depth(left, right, intrinsics, 4.3, StereoSettings(nearest=30.0, farthest=200.0))
    tissue = (mask if mask.ndim == 2 else mask[:, :, 0]) == 0
    both = tissue & (given > 0) & (depth > 0)
    assert both.sum() > 0.7 * (tissue & (given > 0)).sum()
    assert np.median(np.abs(depth - given.astype(float))[both]) < 1.5  # mm; the given depth is in whole millimetres


def test_depth_beyond_the_steps_of_the_first_frame_is_said(tmp_path):
    written(tmp_path / "clip", depth=False)
    planes = [np.full((HEIGHT, WIDTH), 500.0 if i == 3 else 10.0 + i) for i in range(FRAMES)]
    files(tmp_path, "other", planes, "npy")
    report = write_depth(tmp_path / "clip", from_files(tmp_path / "clip", tmp_path / "other", "depth", 1.0))
    assert report.note == (
        f"{HEIGHT * WIDTH} pixels are clipped at 131.07, at least eight times the usual largest depth of the first"
        " frame"
    )
