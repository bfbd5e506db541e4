"""The window of `prepare --crop` in sequence.toml, and what the checks make of the camera of a cropped clip."""

import pytest
from common_folder import HEIGHT, WIDTH, written

from endotsr.cli.main import main
from endotsr.clips.formats.camera import Intrinsics
from endotsr.clips.sequences.checks.cameras import intrinsics_findings
from endotsr.clips.sequences.crop import Crop
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence_file import CameraEntry, read_sequence_file
from endotsr.config import SequenceConfig
from endotsr.errors import InputError

CORNER = ("--crop", "0", "0", "16", "16")  # of 32x24 with the axis at (15, 13), which the window moves off its centre


def prepared(source, out, *words) -> None:
    assert main(["prepare", str(source), "--out", str(out), *words]) == 0


def test_a_crop_is_recorded_and_leads_to_no_warning(tmp_path, capsys):
    written(tmp_path / "clip")
    prepared(tmp_path / "clip", tmp_path / "part", *CORNER)
    assert read_sequence_file(tmp_path / "part").camera.crop == [0, 0, 16, 16]
    assert read_sequence_file(tmp_path / "part").camera.crop_of == [WIDTH, HEIGHT]
    assert "principal-point" not in capsys.readouterr().out
    main(["check", str(tmp_path / "part")])
    assert "principal-point" not in capsys.readouterr().out
    assert "principal-point" not in " ".join(read_sequence(tmp_path / "part", SequenceConfig()).notes)


def test_a_wrong_centre_is_named_before_the_crop(tmp_path, capsys):
    """The axis of a calibration for pictures of half the size, which the middle of this window would hide."""
    lens = CameraEntry(width=WIDTH, height=HEIGHT, fx=30.0, fy=30.0, cx=WIDTH / 4, cy=HEIGHT / 4)
    written(tmp_path / "clip", camera=lens)
    prepared(tmp_path / "clip", tmp_path / "part", "--crop", "0", "0", str(WIDTH // 2), str(HEIGHT // 2))
    said = f"the principal point is at (8, 6) of {WIDTH}x{HEIGHT}, the pictures before the crop"
    assert said in capsys.readouterr().out
    main(["check", str(tmp_path / "part")])
    assert said in capsys.readouterr().out


def test_a_crop_of_a_crop_is_a_window_of_the_source(tmp_path):
    """The second window counts in pixels of the smaller pictures of the first."""
    written(tmp_path / "clip")
    prepared(tmp_path / "clip", tmp_path / "half", "--crop", "4", "2", "20", "16", "--scale", "0.5")
    prepared(tmp_path / "half", tmp_path / "part", "--crop", "1", "2", "6", "4")
    camera = read_sequence_file(tmp_path / "part").camera
    assert camera.crop == [6, 6, 12, 8] and camera.crop_of == [WIDTH, HEIGHT]
    prepared(tmp_path / "part", tmp_path / "again")
    assert read_sequence_file(tmp_path / "again").camera == camera
    crop = describe(tmp_path / "part").crop
    assert crop == Crop(6, 6, 12, 8, WIDTH, HEIGHT)
    assert crop.before(camera.intrinsics("here"))[:6] == pytest.approx((30.0, 33.0, 15.0, 13.0, WIDTH, HEIGHT))


def test_the_camera_before_the_crop_has_the_other_findings_too():
    """A tenth of a picture has a narrow field of view, which says nothing of the calibration."""
    part = Intrinsics(1500.0, 1500.0, 60.0, 60.0, 120, 120)
    assert [found.code for found in intrinsics_findings(part, "here")] == ["field-of-view"]
    assert intrinsics_findings(part, "here", Crop(580, 480, 120, 120, 1280, 1080)) == []


@pytest.mark.parametrize(("scale", "size", "clipped"), [("0.99", (WIDTH, HEIGHT), []), ("0.5", (16, 12), [3.0, 99.8])])
def test_a_scale_that_changes_no_size_clips_no_depth(tmp_path, capsys, scale, size, clipped):
    written(tmp_path / "clip")
    prepared(tmp_path / "clip", tmp_path / "out", "--scale", scale)
    found = read_sequence_file(tmp_path / "out")
    assert (found.camera.width, found.camera.height) == size and found.depth.clipped == clipped
    same = f"--scale {scale} changes nothing: pictures of {WIDTH}x{HEIGHT} pixels keep their size"
    assert (same in capsys.readouterr().out) == (clipped == [])


def test_a_scale_of_a_training_that_changes_no_size_is_told(tmp_path):
    written(tmp_path / "clip")
    whole, same = (read_sequence(tmp_path / "clip", SequenceConfig(scale=scale)) for scale in (1.0, 0.99))
    assert any("scale 0.99 changes nothing" in note for note in same.notes)
    assert not any("scaled to" in note for note in same.notes)
    for name in ("images", "masks", "depth"):
        assert (getattr(whole, name) == getattr(same, name)).all()


@pytest.mark.parametrize(("crop", "of", "said"), [
    ([0, 0, 12, 10], [], "camera.crop"), ([], [WIDTH, HEIGHT], "camera.crop"),
    ([0, 0, 12], [WIDTH, HEIGHT], "camera.crop"), ([30, 0, 12, 10], [WIDTH, HEIGHT], "camera.crop"),
    ([0, 0, 0, 10], [WIDTH, HEIGHT], "camera.crop"), ([float("nan"), 0, 12, 10], [WIDTH, HEIGHT], "camera"),
])  # fmt: skip
def test_a_wrong_window_is_refused(tmp_path, crop, of, said):
    lens = CameraEntry(width=12, height=10, fx=30.0, fy=30.0, cx=15.0, cy=13.0, crop=crop, crop_of=of)
    written(tmp_path / "clip", camera=lens)
    with pytest.raises(InputError, match=said):
        read_sequence_file(tmp_path / "clip")
