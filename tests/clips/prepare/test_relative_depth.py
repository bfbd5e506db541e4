"""Depth of a clip from one camera: relative inverse depth with and without depth to compare with, and a plane."""

import msgspec
import numpy as np
import pytest
from common_folder import moving, written
from depth_folders import FRAMES, true_depth
from one_view import clip, error, given, relative, sparse

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.prepare.relative_depth import FEWEST, StraightLine, fitted_line
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence_file import PoseEntry, read_sequence_file, write_sequence_file
from endotsr.config import PAPER


def test_a_line_is_found_though_a_third_of_the_points_is_wrong():
    rng = np.random.default_rng(0)
    depth = rng.uniform(40, 90, 300)
    r = 900 / depth - 4
    depth[::3] *= rng.uniform(0.5, 2.0, 100)
    line = fitted_line(r, depth)
    np.testing.assert_allclose(line, (1 / 900, 4 / 900), rtol=1e-6)
    assert fitted_line(r[: FEWEST - 1], depth[: FEWEST - 1]) is None and fitted_line(r * 0, depth) is None


@pytest.mark.parametrize("kind", ["npy", "png"])
def test_scale_and_shift_come_from_points_in_every_frame(kind, tmp_path, capsys):
    values = relative if kind == "npy" else lambda i: np.rint(900 * relative(i)).astype(np.uint16)
    where, files = clip(tmp_path, values, kind)
    sparse(where, wrong=0.2)
    assert given(where, files, "--replace") == 0
    assert error(where) < 2e-3
    entry = read_sequence_file(where)
    assert entry.unit == entry.depth.unit == "mm" and entry.depth.assumed == ""
    assert "scale and shift from the depth before" in entry.depth.method
    assert "not metric" not in capsys.readouterr().out


@pytest.mark.parametrize("moved", [False, True])
def test_measured_depth_in_place_of_assumed_depth_is_in_millimetres(tmp_path, moved):
    """The arbitrary unit came from the assumption; poses that were estimated with it keep it."""
    where, files = clip(tmp_path, true_depth)
    assert main(["depth", str(where), "--flat"]) == 0 and read_sequence_file(where).unit == "arbitrary"
    if moved:
        file = read_sequence_file(where)
        rows = [np.eye(4)[:3] + np.array([[0, 0, 0, i], [0] * 4, [0] * 4]) for i in range(FRAMES)]
        poses = PoseEntry(matrices=[row.ravel().tolist() for row in rows])
        write_sequence_file(msgspec.structs.replace(file, poses=poses), where)
    assert main(["depth", str(where), "--given", str(files), "--kind", "depth", "--replace"]) == 0
    found = read_sequence_file(where)
    assert found.unit == found.depth.unit == ("arbitrary" if moved else "mm") and found.depth.assumed == ""


def test_one_line_for_the_sequence_does_not_follow_frames_that_differ(tmp_path):
    where, files = clip(tmp_path)
    sparse(where)
    assert given(where, files, "--replace", "--align", "sequence") == 0
    assert error(where) > 0.02


def test_a_frame_without_points_takes_the_line_of_its_neighbour(tmp_path, capsys):
    where, files = clip(tmp_path, lambda i: 1800 / true_depth(i))
    sparse(where)
    write_png(where / "depth/000003.png", read_png(where / "depth/000003.png") * 0)
    assert given(where, files, "--replace") == 0
    assert error(where) < 2e-3 and "nearest frame for 000003" in capsys.readouterr().out


def test_without_depth_the_shape_has_the_assumed_ratio_and_every_output_says_so(tmp_path, capsys):
    where, files = clip(tmp_path, lambda i: 1800 / true_depth(i) - 3)
    assert given(where, files, "--farthest-over-nearest", "2") == 0
    assert "not metric (scale and shift of the depth assumed)" in capsys.readouterr().out
    read = describe(where).depth
    planes = np.stack([read(i) for i in range(FRAMES)])
    assert planes.min() == 1 and planes.max() == 2  # the assumed ratio
    inverse = 1 / np.stack([true_depth(i) for i in range(FRAMES)])
    inside = (planes > 1.01) & (planes < 1.99)
    assert np.corrcoef(1 / planes[inside], inverse[inside])[0, 1] > 0.9999
    sequence = read_sequence(where, PAPER.sequence, 0.2)
    assert sequence.unit == "arbitrary unit, scale and shift of the depth assumed"
    assert any(note.startswith("not metric: relative inverse depth of relative; assumed") for note in sequence.notes)
    found = {found.code: found for found in check_sequence(where, PAPER).findings}
    assert found["assumed-depth"].level == "warning"
    sparse_refused = given(where, files)
    assert sparse_refused == 2 and "has depth already" in capsys.readouterr().err


def test_assumed_depth_is_no_depth_to_compare_with(tmp_path):
    where, files = clip(tmp_path)
    assert main(["depth", str(where), "--flat"]) == 0
    assert given(where, files, "--replace") == 0
    assert read_sequence_file(where).depth.assumed == "scale and shift"


def test_frames_that_are_rescaled_each_need_a_line_of_their_own(tmp_path):
    where, files = clip(tmp_path, lambda i: 1800 / true_depth(i) + 50 * i)
    spans = {}
    for align in ("sequence", "frame"):
        assert given(where, files, "--replace", "--align", align) == 0
        read = describe(where).depth
        spans[align] = np.ptp([np.median(read(i)) for i in range(FRAMES)])
    assert spans["frame"] < 0.1 < 0.5 < spans["sequence"]


def test_numbers_that_fall_towards_the_camera_are_refused(tmp_path, capsys):
    where, files = clip(tmp_path, lambda i: true_depth(i) / 100)
    assert given(where, files) == 2 and "near tissue is bright" in capsys.readouterr().err
    assert given(where, files, "--trust-depth") == 0
    (tmp_path / "two").mkdir()
    where, files = clip(tmp_path / "two", lambda i: true_depth(i) / 100)
    sparse(where)
    assert given(where, files, "--replace") == 2 and "use a relative inverse depth" in capsys.readouterr().err


def test_a_plane_is_trained_on_with_a_warning_and_a_measured_one_is_still_refused(tmp_path, capsys):
    where, _ = clip(tmp_path)
    assert main(["depth", str(where), "--flat"]) == 0
    assert read_sequence(where, PAPER.sequence, 0.2).unit.endswith("shape of the depth assumed")
    assert not check_sequence(where, PAPER).refused
    file = where / "sequence.toml"
    file.write_text(file.read_text().replace('assumed = "shape"', 'assumed = ""'))
    assert "constant-depth" in {found.code for found in check_sequence(where, PAPER).findings}


def test_what_knows_its_scale_is_no_ground_for_an_assumed_one(tmp_path, capsys):
    written(tmp_path / "moving", depth=False, poses=moving())
    written(tmp_path / "pair", depth=False, right=True)
    for name, said in (("moving", "its poses fix the scale"), ("pair", "a stereo pair gives lengths")):
        assert main(["depth", str(tmp_path / name), "--flat"]) == 2
        assert said in capsys.readouterr().err


def test_metric_words_beside_an_assumption_are_refused(tmp_path, capsys):
    where, _ = clip(tmp_path)
    assert main(["depth", str(where), "--flat"]) == 0
    file = where / "sequence.toml"
    file.write_text(file.read_text().replace('"arbitrary"', '"mm"'))
    assert main(["check", str(where)]) != 0 and "depth.assumed" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["--kind", "relative"], ["--flat", "--given", "x"],
                                   ["--given", "x", "--kind", "relative", "--farthest-over-nearest", "1"]])  # fmt: skip
def test_options_that_contradict_each_other_are_refused(words, tmp_path):
    assert main(["depth", str(tmp_path), *words]) == 2


def test_a_clip_without_depth_is_told_the_ways_of_one_camera(tmp_path, capsys):
    where, _ = clip(tmp_path)
    assert "--kind relative" in capsys.readouterr().out.splitlines()[-1]
    assert main(["check", str(where)]) != 0 and "--kind relative" in capsys.readouterr().out
    assert main(["train", str(where), "--out", str(tmp_path / "r")]) == 2 and "--flat" in capsys.readouterr().err


def test_no_depth_where_the_line_leaves_the_front_of_the_camera_or_a_value_is_not_finite():
    assert StraightLine(1.0, 0.0).depth(np.array([[2.0, 0.0, -1.0, np.nan]])).tolist() == [[0.5, 0.0, 0.0, 0.0]]
    line = StraightLine(0.5, 0.1)
    r = np.array([[np.inf, -np.inf, np.nan, 1.0]])
    np.testing.assert_array_equal(line.depth(r, 4.0) > 0, [[False, False, False, True]])
    np.testing.assert_array_equal(line.depth(r) > 0, [[False, False, False, True]])
    assert line.depth(np.array([[-9.0]]), 4.0).item() == 4.0
