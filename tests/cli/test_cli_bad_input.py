"""Everything a person can hand over that cannot be used: one line, exit code 2, and no run folder."""

import numpy as np
import pytest
from tiny import SETTINGS, assert_refused, run_line, train_words, written_folder

from endotsr.clips.opencv import read_png, write_png
from endotsr.clips.sequences.record import SequenceRecord, recorded
from endotsr.method.splatting.camera import Camera
from endotsr.training.runs.folder import create_run


def refused(capsys, folder, *named, more=()):
    """`train FOLDER` is refused, and nothing appears beside the folder."""
    out = folder.parent / "run"
    assert_refused(capsys, ["train", str(folder), "--out", str(out), *SETTINGS, *more], *named)
    assert not out.exists() and not [p for p in folder.parent.iterdir() if p.name.startswith(".")]


@pytest.fixture
def folder(tmp_path):
    return written_folder(tmp_path)


def test_missing_folder(tmp_path, capsys):
    refused(capsys, tmp_path / "nowhere", "nowhere", "not found")


@pytest.mark.parametrize("name", ["images", "masks", "depth"])
def test_missing_part(name, folder, capsys):
    (folder / name).rename(folder / "elsewhere")
    refused(capsys, folder, name, "not found")


def test_unequal_counts(folder, capsys):
    (folder / "depth" / "000004.png").unlink()
    refused(capsys, folder, "depth", "9", "8")


def test_truncated_png(folder, capsys):
    file = folder / "images" / "000003.png"
    file.write_bytes(file.read_bytes()[:-40])
    refused(capsys, folder, "000003.png", "truncated")


def test_unreadable_png(folder, capsys):
    (folder / "masks" / "000002.png").write_bytes(b"not a picture")
    refused(capsys, folder, "masks/000002.png", "not a PNG")


def test_wrong_size(folder, capsys):
    write_png(folder / "depth" / "000005.png", np.full((16, 48), 50, np.uint16))
    refused(capsys, folder, "000005.png", "48x16", "48x32")


def test_mask_of_the_wrong_polarity(folder, capsys):
    for file in (folder / "masks").iterdir():
        write_png(file, 255 - read_png(file))
    refused(capsys, folder, "masks")


def test_no_depth_anywhere(folder, capsys):
    for file in (folder / "depth").iterdir():
        write_png(file, np.zeros((32, 48), np.uint16))
    refused(capsys, folder, "depth")


@pytest.mark.parametrize("damage", ["nan", "shape", "text", "missing"])
def test_broken_poses(damage, folder, capsys):
    file = folder / "poses_bounds.npy"
    rows = np.load(file)
    if damage == "nan":
        rows[4, 3] = np.nan
        np.save(file, rows)
    elif damage == "shape":
        np.save(file, rows[:, :10])
    elif damage == "text":
        file.write_text("0 0 0")
    else:
        file.unlink()
    refused(capsys, folder, "pose")


def test_too_few_frames(folder, capsys):
    refused(capsys, folder, "2", "at least 3", more=["--frames", "0:2"])


def test_bad_frame_range(folder, capsys):
    refused(capsys, folder, "'a:b'", more=["--frames", "a:b"])


def test_scale_too_small(folder, capsys):
    refused(capsys, folder, "scale", more=["--scale", "0.1"])


def test_frames_of_a_simulated_sequence(tmp_path, capsys):
    words = train_words(tmp_path / "run", "--frames", "0:5", source="simulated")
    assert_refused(capsys, words, "endotsr simulate SCENE --frames N")


@pytest.mark.parametrize("kind", ["folder", "file"])
def test_existing_output(kind, tmp_path, capsys):
    out = tmp_path / "run"
    if kind == "folder":
        out.mkdir()
        (out / "notes.txt").write_text("mine")
    else:
        out.write_text("mine")
    assert_refused(capsys, train_words(out), str(out), "exists already")
    assert (out / "notes.txt" if kind == "folder" else out).read_text() == "mine"


@pytest.mark.parametrize("command", ["evaluate", "train --calibrate-only --out", "render"])
def test_commands_on_no_run(command, tmp_path, capsys):
    more = ["--out", str(tmp_path / "out")] if command == "render" else []
    assert_refused(capsys, [*command.split(), str(tmp_path / "none"), *more], "none", "run folder not found")
    assert_refused(capsys, [*command.split(), str(tmp_path), *more], "not a run folder")
    assert list(tmp_path.iterdir()) == []


def test_resume_of_nothing(tmp_path, capsys):
    assert_refused(capsys, ["train", "--out", str(tmp_path / "run"), "--resume"], "run folder not found")


def test_folder_that_cannot_be_written(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    code, said = run_line(capsys, *train_words(tmp_path / "file" / "run"))
    assert code == 2 and said.count("\n") == 1 and "is not a folder" in said


def test_render_refuses_times_and_existing_output(tmp_path, capsys):
    from endotsr.config import PAPER

    camera = Camera(np.eye(3), np.zeros(3), 50.0, 50.0, 24.0, 16.0, 48, 32)
    record = SequenceRecord(
        unit="mm", largest_depth=9.0, static_camera=True, names=["a", "b"], times=[0.0, 0.5], train_index=[0],
        test_index=[1], cameras=recorded([camera]),
    )  # fmt: skip
    create_run(tmp_path / "run", PAPER, {}, record)
    words = ["render", str(tmp_path / "run"), "--out", str(tmp_path / "out")]
    assert_refused(capsys, [*words, "--times", "1.5"], "1.5", "[0, 1]")
    assert_refused(capsys, [*words, "--times", "nan"], "nan", "[0, 1]")
    assert_refused(capsys, [*words, "--camera", "2"], "--camera 2", "0 to 1")
    assert_refused(capsys, [*words, "--count", "0"], "--count 0", ">= 1")
    assert_refused(capsys, [*words, "--count", "3", "--frames", "all"], "one of")
    assert_refused(capsys, words, "no checkpoint yet", f"`endotsr train --out {tmp_path / 'run'} --resume`")
    (tmp_path / "out").mkdir()
    assert_refused(capsys, words, "out", "exists already")
