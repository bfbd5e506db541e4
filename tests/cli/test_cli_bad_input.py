"""Everything a person can hand over that cannot be used: one line, exit code 2, and no run folder."""

import json
import shutil

import numpy as np
import pytest
from tiny import SETTINGS, assert_refused, run_line, scene, train_words, written_folder

from endotsr.clips.opencv.png import read_png, write_png
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


def cut_short(file):
    file.write_bytes(file.read_bytes()[:-40])


def in_every_file(folder, picture_of):
    for file in folder.iterdir():
        write_png(file, picture_of(read_png(file)))


def changed_poses(file, change):
    np.save(file, change(np.load(file)))


def with_nan(rows):
    rows[4, 3] = np.nan
    return rows


DAMAGES = {  # what is done to the folder, and what the refusal names
    "no folder": (shutil.rmtree, ("sequence", "not found")),
    "no images": (lambda f: (f / "images").rename(f / "elsewhere"), ("images", "not found")),
    "no masks": (lambda f: (f / "masks").rename(f / "elsewhere"), ("masks", "not found")),
    "no depth": (lambda f: (f / "depth").rename(f / "elsewhere"), ("depth", "not found")),
    "unequal counts": (lambda f: (f / "depth" / "000004.png").unlink(), ("depth", "9", "8")),
    "truncated picture": (lambda f: cut_short(f / "images" / "000003.png"), ("000003.png", "truncated")),
    "no picture": (lambda f: (f / "masks" / "000002.png").write_bytes(b"x"), ("masks/000002.png", "not a PNG")),
    "wrong size": (
        lambda f: write_png(f / "depth" / "000005.png", np.full((16, 48), 50, np.uint16)),
        ("000005.png", "48x16", "48x32"),
    ),
    "masks of the wrong polarity": (lambda f: in_every_file(f / "masks", lambda mask: 255 - mask), ("masks",)),
    "no depth anywhere": (lambda f: in_every_file(f / "depth", lambda depth: 0 * depth), ("depth",)),
    "poses with NaN": (lambda f: changed_poses(f / "poses_bounds.npy", with_nan), ("pose",)),
    "poses of another shape": (lambda f: changed_poses(f / "poses_bounds.npy", lambda rows: rows[:, :10]), ("pose",)),
    "poses as text": (lambda f: (f / "poses_bounds.npy").write_text("0 0 0"), ("pose",)),
    "no poses": (lambda f: (f / "poses_bounds.npy").unlink(), ("pose",)),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_folder_is_one_line_and_no_run(damage, folder, capsys):
    spoil, named = DAMAGES[damage]
    spoil(folder)
    refused(capsys, folder, *named)


@pytest.mark.parametrize(
    ("more", "named"),
    [
        (["--frames", "0:2"], ("2", "at least 3")),
        (["--frames", "a:b"], ("'a:b'",)),
        (["--scale", "0.1"], ("scale",)),
    ],
)
def test_frames_and_scales_that_leave_too_little_are_refused(more, named, folder, capsys):
    refused(capsys, folder, *named, more=more)


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


def test_a_clip_or_a_part_of_a_run_in_place_of_a_run_names_what_to_use(folder, finished_run, tmp_path, capsys):
    made = f"`endotsr train {folder} --out RUN` makes a run of it"
    for words in (["evaluate"], ["render", "--out", str(tmp_path / "o")], ["train", "--resume", "--out"]):
        assert_refused(capsys, [*words, str(folder)], f"{folder}: not a run folder, but a clip; {made}")
    pictures = folder / "images"
    assert_refused(capsys, ["evaluate", str(pictures)], f"`endotsr prepare {pictures} --out CLIP` makes a clip of it")
    for part in ("renders", "metrics.json", "test/ours_30"):
        assert_refused(capsys, ["evaluate", str(finished_run / part)], f"a part of one; use {finished_run}")
    checkpoint = finished_run / "checkpoint.npz"
    assert_refused(
        capsys, ["render", str(checkpoint), "--out", str(tmp_path / "o")], f"a part of one; use {finished_run}"
    )
    assert_refused(
        capsys, ["train", "--resume", str(checkpoint)], "--out RUN is missing: the run that --resume continues"
    )
    assert_refused(capsys, ["evaluate", str(finished_run), str(folder)], f"{folder}: a clip, not a method")
    (tmp_path / "runs").mkdir()
    shutil.copytree(finished_run, tmp_path / "runs/mine")
    assert_refused(capsys, ["evaluate", str(tmp_path / "runs")], "use one of those in it: mine")


def test_a_run_in_place_of_a_clip_is_named_with_its_clip(finished_run, tmp_path, capsys):
    """Its folder holds a picture of curves, which is no frame."""
    assert list(finished_run.glob("*.png"))
    said = f"a run folder, not a clip; it was trained on {scene()}"
    for words in (["prepare", "--camera", "50", "50", "24", "16"], ["train"], ["masks"]):
        assert_refused(capsys, [words[0], str(finished_run), "--out", str(tmp_path / "o"), *words[1:]], said)
    for name in ("check", "inspect"):
        assert_refused(capsys, [name, str(finished_run)], said)
    assert not (tmp_path / "o").exists()


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


def test_a_run_whose_clip_was_moved_is_told_how_to_name_its_place(run_copy, tmp_path, capsys):
    about = json.loads((run_copy / "run.json").read_text())
    about["input"]["source"] = str(tmp_path / "gone")
    (run_copy / "run.json").write_text(json.dumps(about))
    for words in (["evaluate", str(run_copy)], ["train", "--out", str(run_copy), "--resume"]):
        assert_refused(capsys, words, f"gone: the clip of the run {run_copy} is no longer there", "--sequence SEQUENCE")
