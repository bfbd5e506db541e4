"""`endotsr train --windows` from the command line."""

import json

import cv2
import numpy as np
import pytest
from small_recording import write_recording

from endotsr.cli.main import main
from endotsr.cli.parts.windows import seam_line

SMALL = [
    "--preset", "demo", "--iterations", "6", "--initialisation.first-frame-points", "200", "--density.maximum", "400",
    "--workers", "1", "--threads", "1",
]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["simulated", "--windows", "auto"], "--windows needs a sequence folder"),
        (["{}", "--windows", "many"], "auto, or a number of frames"),
        (["{}", "--windows", "10"], "at least 24 frames"),
        (["{}", "--windows", "auto", "--overlap", "0"], "--overlap 0"),
        (["{}", "--windows", "auto", "--effects", "auto"], "--effects auto"),
        (["{}", "--windows", "auto", "--sequence.split", "end"], "split end"),
        (["{}", "--windows", "auto", "--workers", "0"], "--workers 0"),
    ],
)
def test_what_cannot_be_trained_is_refused_in_one_line(recording, tmp_path, capsys, words, reason):
    out = tmp_path / "run"
    assert main(["train", *(word.format(recording) for word in words), "--out", str(out), "--no-evaluate"]) == 2
    said = capsys.readouterr().err
    assert reason in said and said.count("\n") == 1 and not out.exists()


def test_a_recording_with_a_damaged_frame_from_the_command_to_the_metrics(tmp_path, capsys):
    """One process of the pool trains both windows; the frame is named and ends nothing."""
    source, out = write_recording(tmp_path / "clip"), tmp_path / "run"
    (source / "images" / "000028.png").write_bytes(b"no picture")
    assert main(["train", str(source), "--out", str(out), "--windows", "auto", *SMALL]) == 0
    said = capsys.readouterr().out
    assert "left out: frames 28:29" in said and "000028.png" in said and "window 001: frames 29:56, cold start" in said
    assert "8 held-out frames" in said and "peak memory" in said
    metrics = json.loads((out / "metrics.json").read_text())
    assert len(metrics["windows"]) == 2 and metrics["left_out"][0]["reason"].count("000028.png")
    assert main(["train", "--out", str(out), "--resume", "--no-evaluate", "--workers", "1"]) == 0
    assert main(["train", "--out", str(out), "--resume", "--model.bases", "5"]) == 2
    assert "model.bases" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "visits", "iterations"),
    [
        (["--preset", "demo"], 36, 36 * 49),  # 56 frames, 49 of which are trained on
        (["--preset", "sharp"], 72, 72 * 49),
        (["--preset", "demo", "--iterations", "600"], 0, 600),
        (["--preset", "demo", "--training.visits-per-frame", "10"], 10, 1500),
    ],
)
def test_a_frame_is_visited_often_enough_unless_the_length_is_given(
    recording, tmp_path, words, visits, iterations, monkeypatch
):
    from endotsr.studies.windows.make import recording_settings, window_job
    from endotsr.studies.windows.record import read_record

    monkeypatch.setattr("endotsr.studies.windows.make.make_windows", lambda run, outcomes, reporter: [])
    out = tmp_path / "run"
    assert main(["train", str(recording), "--out", str(out), "--windows", "96", "--no-evaluate", *words]) == 0
    config = recording_settings(out)
    assert config.training.visits_per_frame == visits
    assert window_job(out, read_record(out), 0, config).config.training.iterations == iterations


def test_frames_without_tissue_and_a_cut_are_one_line_each(tmp_path, capsys):
    """104 frames: 30 to 41 show no tissue, and another scene begins with frame 72."""
    source, out = write_recording(tmp_path / "clip", frames=104), tmp_path / "run"
    other = cv2.GaussianBlur(np.random.default_rng(3).integers(0, 256, (40, 48, 3), np.uint8), (0, 0), 2)
    for i in range(30, 42):
        cv2.imwrite(str(source / "masks" / f"{i:06d}.png"), np.full((40, 48), 255, np.uint8))
    for i in range(72, 104):
        cv2.imwrite(str(source / "images" / f"{i:06d}.png"), np.roll(other, i, axis=1))
    assert main(["train", str(source), "--out", str(out), "--windows", "auto", "--no-evaluate", *SMALL]) == 0
    said = capsys.readouterr().out
    for line in (
        "left out: frames 30:42: tissue on less than 1% of the pixels\n",
        "window 001: frames 42:72, cold start, after frame 41, which is left out\n",
        "window 002: frames 72:96, cold start, cut: the picture changes",
    ):
        assert said.count(line) == 1, said
    assert said.count("30:42") == said.count("cut:") == 1


def test_flicker_is_said_of_a_recording_without_seams():
    """Between cuts there is none, and the flicker inside was not printed."""
    alone = {"seams": None, "inside": 1.342, "ratio": None}
    both = {"seams": 3.0, "inside": 1.5, "ratio": 2.0}
    none = {"seams": None, "inside": None, "ratio": None}
    line = lambda model, recorded: seam_line(
        {"seam_frames": 0, "inside_frames": 9, "model": model, "recorded": recorded}
    ).partition(": ")[2]
    assert line(alone, none) == "model 1.34 inside; recorded frames not measured"
    assert line(both, alone) == "model 3.00 at seams, 1.50 inside (ratio 2.00); recorded frames 1.34 inside"
