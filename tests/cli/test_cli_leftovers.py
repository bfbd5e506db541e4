"""Two evaluations of one run, what a killed command left where another one writes, and how a stopped one goes on."""

import json
import shlex
import shutil
import threading

import numpy as np
import pytest
from tiny import assert_refused, run_line, train_words

from endotsr.cli.main import main
from endotsr.cli.parts import progress
from endotsr.clips.opencv.png import write_png
from endotsr.clips.prepare.prepare import PrepareSettings, prepare
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.training.runs import folder
from endotsr.training.runs.folder import RunFolder, create_run
from endotsr.untrusted.writing import leftover_notes


@pytest.fixture
def run(finished_run, tmp_path):
    return shutil.copytree(finished_run, tmp_path / "run")


def test_one_process_at_a_time_evaluates_a_run(run, capsys):
    """The later one replaced the metrics of the other in silence."""
    before = (run / "metrics.json").read_bytes()
    with RunFolder(run).evaluating():
        assert_refused(capsys, ["evaluate", str(run)], str(run), "another process evaluates this run")
    assert (run / "metrics.json").read_bytes() == before
    assert main(["evaluate", str(run), "--no-view"]) == 0  # the lock ends with its holder


def test_the_evaluation_of_a_training_waits_for_another_one(run, monkeypatch):
    monkeypatch.setattr("endotsr.training.runs.folder.POLL", 0.01)  # it asks again and again, not once
    entered, other = threading.Event(), RunFolder(run)

    def second() -> None:
        with other.evaluating(wait=True):
            entered.set()

    thread = threading.Thread(target=second)
    with other.evaluating():
        thread.start()
        assert not entered.wait(0.2)
    thread.join(10)
    assert entered.is_set()


@pytest.mark.parametrize("trains", [False, True])
def test_an_evaluation_removes_what_a_killed_one_left(run, trains, capsys):
    """Not while a training runs, whose temporary files have such names too."""
    left = [run / ".partial-0a1b2c3d-renders", run / "test/.partial-0a1b2c3d-ours_30", run / ".partial-9-view.html"]
    left[0].mkdir()
    left[1].mkdir()
    left[2].touch()
    if trains:
        with RunFolder(run).locked():
            assert main(["evaluate", str(run), "--no-view"]) == 0
        assert all(path.exists() for path in left) and "stopped command" not in capsys.readouterr().out
    else:
        assert main(["evaluate", str(run), "--no-view"]) == 0
        assert not any(path.exists() for path in left)
        said = capsys.readouterr().out
        assert "removed what a stopped command left: .partial-0a1b2c3d-renders, .partial-9-view.html, test" in said


def test_a_preparation_names_what_a_killed_one_left_beside_its_folder(tmp_path):
    """It may hold the only copy of the folder that was being replaced, and is therefore kept."""
    (tmp_path / "raw").mkdir()
    for i in range(2):
        picture = np.random.default_rng(i).integers(40, 200, (24, 32, 3), np.uint8)
        write_png(tmp_path / "raw" / f"{i}.png", picture)
    (tmp_path / ".partial-0a1b2c3d-clip").mkdir()
    (tmp_path / ".partial-0a1b2c3d-other").mkdir()
    clip = describe(tmp_path / "raw", SourceOptions(camera=(30.0, 30.0, 16.0, 12.0)))
    _, notes = prepare(clip, tmp_path / "clip", PrepareSettings())
    (note,) = [note for note in notes if "partial" in note]
    assert note.startswith(f".partial-0a1b2c3d-clip in {tmp_path}: left by a command") and "other" not in note
    assert (tmp_path / ".partial-0a1b2c3d-clip").is_dir()
    assert leftover_notes(tmp_path / "clips") == []


def test_a_training_names_what_a_killed_one_left_beside_its_folder(tmp_path, capsys, monkeypatch):
    (tmp_path / ".partial-0a1b2c3d-run").mkdir()
    monkeypatch.setattr(folder, "config_to_toml", lambda config: "")
    monkeypatch.setattr(folder.msgspec, "to_builtins", lambda record: {})
    create_run(tmp_path / "run", None, {}, None)
    assert ".partial-0a1b2c3d-run" in capsys.readouterr().err and (tmp_path / ".partial-0a1b2c3d-run").is_dir()


def test_a_signal_during_the_evaluation_of_a_training_says_what_is_done(tmp_path, capsys, monkeypatch):
    """Before, it said "interrupted" alone, as if the training were lost."""

    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("endotsr.results.evaluation.run.measure_folder", stopped)
    code, said = run_line(capsys, *train_words(tmp_path / "run", "--iterations", "1"))
    command = f"endotsr evaluate {tmp_path / 'run'}"
    told = f"endotsr: interrupted: the training is finished, its evaluation is not: `{command}` makes it"
    assert code == 130 and said.strip().splitlines()[-1] == told
    assert (tmp_path / "run" / "view.html").is_file(), "the viewer needs no metrics"
    monkeypatch.undo()
    assert main(command.split()[1:]) == 0


def test_the_command_that_continues_a_run_evaluates_as_the_first_one_would(tmp_path, capsys, monkeypatch):
    out, metrics = tmp_path / "run", tmp_path / "the metrics.json"

    def interrupt(self, entry):
        raise KeyboardInterrupt

    monkeypatch.setattr(progress.Progress, "update", interrupt)
    _, said = run_line(capsys, *train_words(out, "--json", str(metrics)))
    command = said.strip().splitlines()[-1].split("`")[1]
    assert shlex.split(command) == ["endotsr", "train", "--out", str(out), "--resume", "--json", str(metrics)]
    _, said = run_line(capsys, *train_words(tmp_path / "other", "--no-evaluate"))
    assert said.strip().endswith("--resume --no-evaluate`")
    monkeypatch.undo()
    assert main(shlex.split(command)[1:]) == 0 and "held_out" in json.loads(metrics.read_text())
