"""`--resume --iterations N`: a finished run gets more iterations, on a schedule that is stated."""

import json

import numpy as np
import pytest
from tiny import assert_refused, log_without_seconds

from endotsr.cli.main import main
from endotsr.cli.parts import waiting
from endotsr.config import load_config
from endotsr.errors import InputError
from endotsr.training.fitting.checkpoint import load_checkpoint
from endotsr.training.runs.folder import RunFolder, refuse_existing
from endotsr.training.runs.training import extend_run


def test_a_finished_run_is_extended_and_only_its_length_changes(finished_run, run_copy, tmp_path, capsys):
    out = run_copy
    assert main(["train", "--out", str(out), "--resume", "--iterations", "34", "--no-evaluate"]) == 0
    assert "extended from 30 to 34 iterations" in capsys.readouterr().out
    log, before = log_without_seconds(out), log_without_seconds(finished_run)
    assert log[:30] == before and [entry["iteration"] for entry in log[30:]] == [31, 32, 33, 34]
    first, second = (load_config(run / "config.toml") for run in (finished_run, out))
    assert (first.training.iterations, second.training.iterations) == (30, 34)
    assert first.density == second.density and first.loss == second.loss
    record = json.loads((out / "run.json").read_text())
    assert record["status"] == "finished" and record["iterations_done"] == 34
    assert (record["extended"][0]["before"], record["extended"][0]["iterations"]) == (30, 34)
    with np.load(out / "checkpoint.npz") as file:
        assert json.loads(file["header"].tobytes())["iteration"] == 34
    assert main(["render", str(out), "--out", str(tmp_path / "pictures")]) == 0


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--iterations", "20"], "training.iterations = 20 (run: 30)"),
        (["--iterations", "0"], "--iterations 0 is not allowed"),
        (["--iterations", "40", "--seed", "5"], "training.seed = 5 (run: 0)"),
    ],
)
def test_a_run_is_not_shortened_and_keeps_its_other_settings(words, named, run_copy, capsys):
    before = (run_copy / "config.toml").read_text()
    assert_refused(capsys, ["train", "--out", str(run_copy), "--resume", *words], named)
    assert (run_copy / "config.toml").read_text() == before


def test_no_extension_is_stated_that_is_refused(run_copy, capsys):
    """The settings were edited: the checkpoint is of others."""
    file = run_copy / "config.toml"
    file.write_text(file.read_text().replace("ssim_weight = 0.1", "ssim_weight = 0.3"))
    assert main(["train", "--out", str(run_copy), "--resume", "--iterations", "34"]) == 2
    said = capsys.readouterr()
    assert "trained with loss.ssim_weight = 0.1" in said.err and "extended" not in said.out


def test_a_run_whose_latest_checkpoint_is_damaged_is_extended_from_the_one_before(run_copy):
    """The damaged file does not replace the checkpoint before it."""
    (run_copy / "checkpoint.npz").write_bytes(b"cut short")
    before = (run_copy / "checkpoint.previous.npz").read_bytes()
    extend_run(RunFolder(run_copy), 40)
    assert (run_copy / "checkpoint.damaged.npz").read_bytes() == b"cut short"
    assert (run_copy / "checkpoint.previous.npz").read_bytes() == before
    assert load_checkpoint(run_copy / "checkpoint.npz").header["config"]["training"]["iterations"] == 40


def test_a_run_with_the_previous_checkpoint_alone_is_extended(run_copy):
    (run_copy / "checkpoint.npz").unlink()
    assert main(["train", "--out", str(run_copy), "--resume", "--iterations", "34", "--no-evaluate"]) == 0
    assert load_checkpoint(run_copy / "checkpoint.npz").iteration == 34


def test_a_run_stopped_after_its_last_iteration_is_finished_by_a_resume(run_copy, capsys):
    RunFolder(run_copy).update({"status": "interrupted", "finished": None})
    assert main(["train", "--out", str(run_copy), "--resume", "--no-evaluate"]) == 0
    record = json.loads((run_copy / "run.json").read_text())
    assert record["status"] == "finished" and record["finished"] and record["resumed"] == []


def test_metrics_of_an_earlier_iteration_are_not_compared(run_copy, finished_run, capsys):
    assert main(["train", "--out", str(run_copy), "--resume", "--iterations", "31", "--no-evaluate"]) == 0
    words = ["evaluate", str(finished_run), f"longer={run_copy}"]
    assert_refused(capsys, words, "its metrics.json is of iteration 30, its checkpoint of 31")


def test_an_extension_that_was_stopped_half_way_is_completed_by_the_same_command(run_copy, monkeypatch):
    """Killed between the checkpoint and config.toml, which then have different lengths."""

    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("endotsr.training.runs.training.replace_text", killed)
    with pytest.raises(KeyboardInterrupt):
        extend_run(RunFolder(run_copy), 34)
    monkeypatch.undo()
    assert load_config(run_copy / "config.toml").training.iterations == 30
    assert main(["train", "--out", str(run_copy), "--resume", "--iterations", "34", "--no-evaluate"]) == 0
    assert [entry["iteration"] for entry in log_without_seconds(run_copy)][-1] == 34


def test_the_first_line_knows_how_far_the_run_is(run_copy, monkeypatch):
    heard = []
    monkeypatch.setattr(waiting, "waiting_line", lambda plan, unit, compiled, at=None: heard.append(at) or "")
    assert main(["train", "--out", str(run_copy), "--resume", "--iterations", "34", "--no-evaluate"]) == 0
    (at,) = heard
    assert at.iteration == 30 and 0 < at.gaussians == log_without_seconds(run_copy)[29]["gaussians"]


def test_the_command_that_continues_a_run_is_quoted_for_a_shell(tmp_path):
    run = tmp_path / "my run"
    run.mkdir()
    (run / "run.json").write_text("{}")
    with pytest.raises(InputError, match=r"`endotsr train --out '.*/my run' --resume`"):
        refuse_existing(run)
