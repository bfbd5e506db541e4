"""`endotsr train --windows` from the command line."""

import json

import pytest
from small_recording import write_recording

from endotsr.cli.main import main

SMALL = [
    "--preset", "demo", "--iterations", "6", "--initialisation.first-frame-points", "200", "--density.maximum", "400",
    "--workers", "1", "--threads", "1",
]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["simulated", "--windows", "auto"], "--windows cuts a sequence folder"),
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
