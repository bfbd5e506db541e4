"""Views of other moments or other rows are named by `check` and `depth`, and views of a rectified pair are not."""

from collections import Counter

import msgspec
import numpy as np
import pytest
from stereo_views import FRAMES, pairs, stereo_clip

import endotsr
from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences import folder_reader
from endotsr.clips.sequences.checks import frame_pass
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.checks.stereo import (
    exchanged_finding,
    frozen_finding,
    late_finding,
    pair_findings,
    row_finding,
    row_matches,
)
from endotsr.clips.sequences.layouts import describe_for_training
from endotsr.clips.sequences.layouts.common import describe_prepared
from endotsr.clips.simulator.folder import write_sequence
from endotsr.clips.simulator.scenes import named_scene
from endotsr.config import PAPER

NAMES = [f"{i:06d}.png" for i in range(20)]
MOVING = np.full(11, 2.0)


def said(views, folder) -> list[tuple[str, str]]:
    return [(f.code, f.what) for f in pair_findings(describe_prepared(stereo_clip(folder / "clip", views)))]


@pytest.mark.parametrize("rows", [0.0, 0.4])
def test_a_rectified_pair_has_no_finding(rows, tmp_path):
    assert said(pairs(rows=rows), tmp_path) == []


def test_rows_that_are_two_pixels_apart_are_named(tmp_path):
    ((code, what),) = said(pairs(rows=2.0), tmp_path)
    assert code == "unrectified-views" and what.startswith("points lie 2.0 pixels (at most 2.") and "0.75" in what


def test_a_camera_that_is_turned_is_named_with_the_rows_at_the_edge(tmp_path):
    ((code, what),) = said(pairs(turn=np.radians(1.0)), tmp_path)
    most = float(what.split("at most ")[1].split(")")[0])
    assert code == "unrectified-views" and most == pytest.approx(120 * np.radians(1.0), abs=0.4)


@pytest.mark.parametrize(("late", "words"), [(1, "1 frame late"), (2, "2 frames late"), (-1, "1 frame early")])
def test_a_right_view_of_another_frame_is_named(late, words, tmp_path):
    ((code, what),) = said(pairs(late=late), tmp_path)
    assert code == "late-right-view" and f"about {words}: points that move" in what


@pytest.mark.parametrize("late", [2, -1])
def test_prepare_pairs_the_views_paired_by_time(late, tmp_path, capsys):
    clip, out = stereo_clip(tmp_path / "clip", pairs(late=late)), tmp_path / "out"
    assert main(["prepare", str(clip), "--out", str(out), "--right-late", str(late)]) == 0
    first, said = max(0, -late), capsys.readouterr().out
    assert f"frame i is paired with right picture i {late:+d}" in said
    assert f"{abs(late)} frame{'s' * (late > 1)} without a right picture of their moment omitted" in said
    assert pair_findings(describe_prepared(out)) == []
    for name, files in [("images", out / "images"), ("images_right", out / "images_right")]:
        shift = late if name == "images_right" else 0
        for k, file in enumerate(sorted(files.iterdir())):
            np.testing.assert_array_equal(read_png(file), read_png(clip / name / f"{first + k + shift:06d}.png"))
        assert len(list(files.iterdir())) == FRAMES - abs(late)


@pytest.mark.parametrize("late", [0, 1])
def test_exchanged_views_are_named_before_anything_else(late, tmp_path):
    ((code, what),) = said([(right, left) for left, right in pairs(late=late)], tmp_path)
    assert code == "exchanged-views" and "pixels farther right in the right view" in what


def test_points_on_both_sides_are_no_exchanged_views():
    """As of cameras that look at one point, which is among the matches."""
    found = row_matches(*pairs()[0])
    assert [f.code for f in exchanged_finding([found._replace(across=-found.across)], "right")] == ["exchanged-views"]
    some = np.where(np.arange(found.across.size) % 4, -found.across, found.across)
    assert exchanged_finding([found._replace(across=some)], "right") == exchanged_finding([], "right") == []


def test_without_motion_up_or_down_a_late_view_looks_like_another_depth(tmp_path):
    assert said(pairs(late=1, moves=lambda i: 0.0), tmp_path) == []


@pytest.mark.parametrize(("shown", "steps"), [(lambda i: min(i, 4), 7), (lambda i: i - i % 2, 6)])
def test_a_right_view_that_stands_still_is_named(shown, steps, tmp_path):
    ((code, what),) = said(pairs(shown=shown), tmp_path)
    assert code == "frozen-right-view" and f"repeats its picture in {steps} of {FRAMES - 1} steps" in what


@pytest.mark.parametrize(("equal", "words"), [(FRAMES, f"{FRAMES} of {FRAMES} frames, first 000000"),
                                              (3, f"3 of {FRAMES} frames, first 000000")])  # fmt: skip
def test_a_right_view_that_is_the_left_one_is_named(equal, words, tmp_path):
    views = [(left, left if i < equal else right) for i, (left, right) in enumerate(pairs())]
    ((code, what),) = said(views, tmp_path)
    assert code == "same-views" and words in what


@pytest.mark.parametrize(("factor", "words"), [(0.5, "0.5"), (0.85, "")])
def test_a_right_view_that_is_darker_is_named(factor, words, tmp_path):
    views = [(left, (right * factor).astype(np.uint8)) for left, right in pairs()]
    found = [what for code, what in said(views, tmp_path) if code == "unequal-views"]
    assert len(found) == bool(words) and all(f"the right view is {words}" in what for what in found)


def test_a_pause_of_both_views_and_a_single_repeat_are_no_frozen_view():
    still, once = MOVING.copy(), MOVING.copy()
    still[3:9], once[5] = 0.0, 0.0
    assert frozen_finding(still, still, NAMES, "right") == frozen_finding(MOVING, once, NAMES, "right") == []
    (found,) = frozen_finding(MOVING, still, NAMES, "right")
    assert found.frame == 4 and "from 000003.png to 000009.png" in found.what


def test_check_lists_the_finding_and_depth_prints_it(tmp_path, capsys):
    clip = stereo_clip(tmp_path / "clip", pairs(rows=2.0))
    assert "unrectified-views" in [f.code for f in check_sequence(clip, PAPER).findings]
    assert main(["depth", str(clip), "--nearest", "40", "--farthest", "120"]) == 0
    assert "warning: unrectified-views: points lie 2.0 pixels" in capsys.readouterr().out
    right = stereo_clip(tmp_path / "right", pairs())
    assert main(["depth", str(right), "--nearest", "40", "--farthest", "120"]) == 0
    assert "warning" not in capsys.readouterr().out


def test_a_right_view_that_cannot_be_read_is_left_to_the_command_that_needs_it(tmp_path):
    clip = stereo_clip(tmp_path / "clip", pairs(rows=2.0))
    (clip / "images_right/000007.png").write_bytes(b"")
    assert pair_findings(describe_prepared(clip)) == []


@pytest.fixture
def with_depth(tmp_path):
    """A simulated stereo clip with depth."""
    write_sequence(tmp_path, msgspec.structs.replace(named_scene("still"), width=192, height=160, frames=6))
    return tmp_path


def test_check_reads_every_picture_of_a_pair_once(with_depth, monkeypatch):
    read, real = Counter(), frame_pass.read_picture
    for module in (frame_pass, folder_reader):
        monkeypatch.setattr(module, "read_picture", lambda file: read.update([file.parent.name]) or real(file))
    check_sequence(with_depth, PAPER)
    assert read["images"] == read["images_right"] == 6


def test_a_damaged_right_picture_is_no_refusal_as_training_does_not_read_it(with_depth):
    (with_depth / "images_right/000000.png").write_bytes(b"")
    endotsr.load_sequence(with_depth)
    assert not check_sequence(with_depth, PAPER).refused


@pytest.mark.parametrize("name", ["still", "pulling", "moving-camera"])
def test_simulated_pairs_have_no_finding(name, tmp_path):
    write_sequence(tmp_path, msgspec.structs.replace(named_scene(name), width=240, height=192, frames=8))
    assert pair_findings(describe_for_training(tmp_path, PAPER.sequence)) == []


@pytest.mark.data
def test_the_right_views_of_a_recorded_clip_are_a_frame_early_and_a_pixel_lower_or_higher():
    """Dense matching agrees: with the right view of the frame before, more pixels match in both directions."""
    files = [sorted((data_folder("endonerf_pulling") / name).iterdir()) for name in ("images", "images_right")]

    def codes(late: int, rows: int) -> list[str]:
        found = []
        for i in (9, 20, 31, 42):
            right = np.roll(read_png(files[1][i - late]), rows, 0)
            found.append(row_matches(read_png(files[0][i]), right, read_png(files[0][i - 1])))
        return [f.code for f in late_finding(found, "right") + row_finding(found, "right")]

    assert codes(0, 0) == ["late-right-view", "unrectified-views"]
    assert codes(1, 0) == ["unrectified-views"] and codes(1, 1) == []
