"""Training from the command line: what a run leaves behind, and how it goes on after it was stopped."""

import ctypes
import errno
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
from tiny import assert_refused, assert_same_run, log_without_seconds, run_line, scene, start, train_words

from endotsr.cli.main import main
from endotsr.cli.parts import progress, waiting
from endotsr.config import load_config
from endotsr.training.fitting import state as training_state
from endotsr.training.fitting import trainer
from endotsr.training.fitting.checkpoint import load_checkpoint
from endotsr.training.runs import stopping, training
from endotsr.training.runs.folder import RunFolder

LAST = 30
EVERY = 7
SECONDS_BETWEEN = training.seconds_between  # which conftest.py replaces


def train_only(out, *more):
    return train_words(out, "--no-evaluate", *more)


def resume(out):
    return ["train", "--out", str(out), "--resume", "--no-evaluate"]


def test_run_folder_explains_itself(finished_run):
    names = {p.name for p in finished_run.iterdir()}
    expected = {"config.toml", "run.json", "sequence.json", "log.jsonl", "checkpoint.npz", "checkpoint.previous.npz"}
    expected |= {
        "metrics.json",
        "renders",
        "curves.png",
        "report.html",
        "view.html",
        "test",
        "run.lock",
        "evaluate.lock",
    }
    assert names == expected | {"training.html"}
    record = RunFolder(finished_run).record()
    assert record["status"] == "finished" and record["iterations_done"] == LAST
    assert record["seed"] == 0 and record["threads"] == 1 and record["versions"]["numba"]
    assert record["machine"]["cores"] >= 1 and record["seconds"] > 0
    assert len(record["input"]["arrays_sha256"]["images"]) == 64
    assert record["input"]["width"] == 48
    config = load_config(finished_run / "config.toml")
    assert config.training.iterations == LAST and config.density.interval == 5


def test_log_has_one_entry_an_iteration(finished_run):
    entries = [json.loads(line) for line in (finished_run / "log.jsonl").read_text().splitlines()]
    assert [entry["iteration"] for entry in entries] == list(range(1, LAST + 1))
    assert all(np.isfinite(entry["loss"]) and entry["gaussians"] > 0 and entry["seconds"] >= 0 for entry in entries)
    assert "matern_penalty" in entries[-1] and "matern_penalty" not in entries[0]  # the residuals are born half-way


def test_pictures_have_the_names_of_the_peers(finished_run):
    peers = finished_run / "test" / f"ours_{LAST}"
    assert {p.name for p in peers.iterdir()} == {"renders", "gt", "masks"}
    for folder in peers.iterdir():
        assert [p.name for p in folder.iterdir()] == ["00000.png"]
    assert (finished_run / "renders" / "000001.png").stat().st_size > 0


def test_metrics_stand_alone(finished_run):
    metrics = json.loads((finished_run / "metrics.json").read_text())
    assert metrics["held_out"]["mean"]["psnr_tissue"] > 5
    assert set(metrics["baselines"]) == {
        "temporal_mean",
        "nearest_frame",
        "two_neighbours",
        "two_neighbours_tissue",
        "flow_interpolation",
        "flow_interpolation_tissue",
    }
    assert metrics["run"]["iteration"] == LAST and metrics["run"]["settings"]["model"]["beta"] == 0.3
    assert [row["label"].split()[0] for row in metrics["components"]] == ["the", "rendered", "rendered"]
    assert metrics["cross_fade"]["mean"]["psnr_tissue"] > 5
    assert metrics["cross_fade"]["mean"] != metrics["held_out"]["mean"]
    motion = metrics["trajectories"]
    assert motion["unit"] == "mm" and 0 < motion["scene_units"] < 10 and motion["motion_pixels"] > 0


def test_equal_settings_give_equal_runs_for_any_number_of_threads(finished_run, tmp_path):
    assert main(train_only(tmp_path / "run", "--threads", "2")) == 0
    assert_same_run(finished_run, tmp_path / "run")


def test_another_seed_gives_another_run(finished_run, tmp_path):
    assert main(train_only(tmp_path / "run", "--seed", "1", "--iterations", "3")) == 0
    assert log_without_seconds(tmp_path / "run")[0] != log_without_seconds(finished_run)[0]


def test_the_forecast_knows_whether_a_clip_has_a_true_motion(tmp_path, monkeypatch):
    """The folder of `scene` holds its truth; without it the same clip is like any other."""
    plans = []
    monkeypatch.setattr(waiting, "waiting_line", lambda plan, *_: plans.append(plan) or "")
    shutil.copytree(scene(), tmp_path / "clip")
    for name in ("known", "unknown"):
        assert (
            main(train_words(tmp_path / name, "--no-evaluate", "--iterations", "2", source=str(tmp_path / "clip"))) == 0
        )
        shutil.rmtree(tmp_path / "clip" / "truth", ignore_errors=True)
    assert [plan.frames.compared for plan in plans] == [2 * 8, 0]


@pytest.mark.parametrize("at", [3, 17])
def test_ctrl_c_keeps_the_last_checkpoint_and_resume_is_bitwise_equal(at, finished_run, tmp_path, capsys, monkeypatch):
    out = tmp_path / "run"
    update = progress.Progress.update

    def interrupt(self, entry):
        update(self, entry)
        if entry["iteration"] == at:
            raise KeyboardInterrupt

    monkeypatch.setattr(progress.Progress, "update", interrupt)
    code, said = run_line(capsys, *train_only(out))
    monkeypatch.undo()
    assert code == 130
    last = said.strip().splitlines()[-1]
    assert f"--out {out} --resume" in last
    assert (f"checkpoint of iteration {at // EVERY * EVERY}" if at > EVERY else "no checkpoint yet") in last
    assert RunFolder(out).record()["status"] == "interrupted"
    assert main(resume(out)) == 0
    assert_same_run(finished_run, out)
    record = RunFolder(out).record()
    assert record["status"] == "finished" and record["resumed"][0]["after_iteration"] == at // EVERY * EVERY


@pytest.mark.parametrize(("at", "kept"), [(3, 0), (17, 15)])
def test_time_brings_a_checkpoint_before_the_iterations_do(at, kept, finished_run, tmp_path, monkeypatch):
    """On a clock of one second an iteration, with 4 seconds between checkpoints, they come at 5, 10, 15."""
    out, clock = tmp_path / "run", SimpleNamespace(now=0.0)
    clock.monotonic = lambda: clock.now

    def killed(_, entry):
        clock.now += 1.0
        if entry["iteration"] == at:
            raise RuntimeError("killed")

    monkeypatch.setattr(progress.Progress, "update", killed)
    monkeypatch.setattr(training, "time", clock)
    monkeypatch.setattr(training, "seconds_between", lambda *_: 4.0)
    with pytest.raises(RuntimeError, match="killed"):
        main(train_only(out, "--training.checkpoint-every", "1000"))
    monkeypatch.undo()
    folder = RunFolder(out)
    assert (load_checkpoint(folder.checkpoint).iteration if kept else folder.has_checkpoint) == kept
    assert main(resume(out)) == 0
    assert_same_run(finished_run, out)


@pytest.mark.parametrize(
    ("trained", "saving", "expected"),
    [(0, 0, 10), (50, 0.1, 10), (600, 0.1, 60), (1e5, 0.1, 300), (0, 1.0, 50), (1e5, 20.0, 1000)],
)
def test_time_between_checkpoints(trained, saving, expected):
    """Ten seconds at first, a tenth of the training later, five minutes at most, and never 2 % of the time."""
    assert SECONDS_BETWEEN(trained, saving) == pytest.approx(expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    "how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=["interrupted", "terminated", "killed"]
)
def test_stopped_process_resumes_bitwise_equal(how, finished_run, tmp_path):
    out = tmp_path / "run"
    process = start(train_only(out), tmp_path)
    lines = random.randrange(1, LAST - 2)  # a new moment every time
    deadline = time.monotonic() + 300
    while not (out / "log.jsonl").exists() or (out / "log.jsonl").read_bytes().count(b"\n") < lines:
        assert process.poll() is None and time.monotonic() < deadline, process.stderr.read()
        time.sleep(0.005)
    process.send_signal(how)
    said = process.communicate(timeout=120)[1]
    # a process that was through before the signal arrived has nothing to say
    assert process.returncode in (0, -how if how == signal.SIGKILL else 130), said
    if process.returncode == 130:
        assert RunFolder(out).record()["status"] == "interrupted"
        assert "--resume" in said.strip().splitlines()[-1] and "Traceback" not in said
    assert main(resume(out)) == 0
    assert_same_run(finished_run, out)
    assert not [p.name for p in out.iterdir() if p.name.startswith(".")]


HANG_UP = getattr(signal, "SIGHUP", signal.SIGTERM)  # of a closed terminal


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, HANG_UP])
@pytest.mark.parametrize("then", ["goes on", "fails"])
def test_a_signal_that_a_callback_swallows_still_stops_the_run(then, how, tmp_path, capsys, monkeypatch):
    """Python drops an exception within a callback of compiled code; the run must not go on, nor end as a failure."""
    if signal.getsignal(how) == signal.SIG_IGN:
        pytest.skip(f"{how.name} is ignored here, as under nohup")
    out, update, dropped = tmp_path / "run", progress.Progress.update, []
    monkeypatch.setattr(sys, "unraisablehook", lambda about: dropped.append(about.exc_type))
    callback = ctypes.CFUNCTYPE(None)(lambda: (signal.raise_signal(how), signal.raise_signal(how), None)[-1])

    def interrupt(self, entry):
        update(self, entry)
        if entry["iteration"] == 3:
            callback()
            if then == "fails":
                raise RuntimeError("no symbol")

    monkeypatch.setattr(progress.Progress, "update", interrupt)
    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    code, said = run_line(capsys, *train_only(out))
    assert (
        dropped == [KeyboardInterrupt]
        and (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers
    )
    assert code == 130 and "--resume" in said.strip().splitlines()[-1]
    assert RunFolder(out).record()["status"] == "interrupted"
    assert len((out / "log.jsonl").read_text().splitlines()) == 3
    assert RunFolder(out).checkpoint.exists() == (then == "goes on")  # only a whole iteration is kept
    monkeypatch.undo()
    assert main(resume(out)) == 0  # the signal is forgotten


def signal_at(number, monkeypatch, then):
    """Sends a signal in the middle of an iteration, and does `then`."""
    update = progress.Progress.update

    def interrupt(self, entry):
        update(self, entry)
        if entry["iteration"] == number:
            signal.raise_signal(signal.SIGINT)
            then()

    monkeypatch.setattr(progress.Progress, "update", interrupt)


def test_a_signal_lets_the_iteration_end_and_nothing_is_lost(finished_run, tmp_path, capsys, monkeypatch):
    out = tmp_path / "run"
    signal_at(4, monkeypatch, lambda: None)
    code, said = run_line(capsys, *train_only(out))
    assert code == 130 and "the checkpoint of iteration 4 is kept" in said.strip().splitlines()[-1]
    monkeypatch.undo()
    assert RunFolder(out).record()["iterations_done"] == 4
    assert main(resume(out)) == 0
    assert_same_run(finished_run, out)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["a second signal", "the end of patience"])
def test_an_iteration_that_does_not_end_is_given_up(how, finished_run, tmp_path, capsys, monkeypatch):
    out, after = tmp_path / "run", []

    def then():
        if how == "a second signal":
            signal.raise_signal(signal.SIGINT)
        ends = time.monotonic() + 60
        while time.monotonic() < ends:
            time.sleep(0.01)
        after.append("reached")

    monkeypatch.setattr(stopping, "PATIENCE", 0.05)
    signal_at(9, monkeypatch, then)
    code, said = run_line(capsys, *train_only(out))
    assert code == 130 and not after and "the checkpoint of iteration 7 is kept" in said.strip().splitlines()[-1]
    monkeypatch.undo()
    assert main(resume(out)) == 0
    assert_same_run(finished_run, out)


def test_results_of_an_unfinished_run_say_so_and_show_its_checkpoint_alone(tmp_path, capsys, monkeypatch):
    """The log is two iterations longer than the checkpoint."""
    out = tmp_path / "run"
    signal_at(9, monkeypatch, lambda: signal.raise_signal(signal.SIGINT))
    assert main(train_only(out)) == 130
    monkeypatch.undo()
    assert main(["evaluate", str(out)]) == 0
    assert "checkpoint of iteration 7 of 30, the run is not finished" in capsys.readouterr().out
    about = json.loads((out / "metrics.json").read_text())["run"]
    assert (about["iteration"], about["iterations_planned"], about["status"]) == (7, 30, "interrupted")
    page = (out / "report.html").read_text()
    assert "7 of 30, the run is not finished" in page and "Gaussians at iteration 7" in page


def test_a_signal_while_the_checkpoint_is_written_leaves_the_one_before(tmp_path, capsys, monkeypatch):
    out, save = tmp_path / "run", training_state.save_state

    def slow(path, state, *rest):
        if state.iteration == 9:
            signal.raise_signal(signal.SIGTERM)
        save(path, state, *rest)

    monkeypatch.setattr(training_state, "save_state", slow)
    signal_at(9, monkeypatch, lambda: None)
    code, said = run_line(capsys, *train_only(out))
    assert code == 130 and "the checkpoint of iteration 7 is kept" in said.strip().splitlines()[-1]
    assert RunFolder(out).record()["status"] == "interrupted"


def test_a_run_is_trained_by_one_process_alone(tmp_path, capsys, monkeypatch):
    out = tmp_path / "run"
    signal_at(2, monkeypatch, lambda: None)
    assert main(train_only(out)) == 130
    monkeypatch.undo()
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    with RunFolder(out).locked():
        assert_refused(capsys, resume(out), str(out), "another process trains this run")
    assert before == {p.name: p.read_bytes() for p in out.iterdir()}
    assert main(resume(out)) == 0  # the lock ends with its holder


def test_weights_that_cannot_be_read_are_refused_before_the_training(tmp_path, capsys):
    out = tmp_path / "run"
    assert_refused(capsys, train_words(out, "--lpips", str(tmp_path / "none.npz")), "none.npz")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="closes the reading end of a pipe")
def test_a_reader_that_left_is_no_success(tmp_path):
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "endotsr.cli.main", *train_only(tmp_path / "run")]
    assert subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, timeout=300).returncode == 141
    os.close(writer)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="closes the standard output")
@pytest.mark.parametrize("how", ["closed", "ascii"])
def test_output_that_takes_no_text_does_not_stop_a_run(how, tmp_path):
    out = tmp_path / "größe"
    words = [sys.executable, "-m", "endotsr.cli.main", *train_only(out, "--iterations", "2")]
    environment = os.environ | ({"PYTHONIOENCODING": "ascii"} if how == "ascii" else {})
    close = (lambda: os.close(1)) if how == "closed" else None
    done = subprocess.run(words, env=environment, preexec_fn=close, stderr=subprocess.PIPE, text=True, timeout=300)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    assert RunFolder(out).record()["status"] == "finished"


def test_an_error_without_a_signal_is_a_failure(tmp_path, monkeypatch):
    def fail(self, entry):
        raise RuntimeError("no symbol")

    monkeypatch.setattr(progress.Progress, "update", fail)
    with pytest.raises(RuntimeError, match="no symbol"):
        main(train_only(tmp_path / "run"))
    assert RunFolder(tmp_path / "run").record()["status"] == "failed"


@pytest.mark.parametrize("checkpoint", [1, 3])
def test_full_disk_keeps_the_last_checkpoint_or_leaves_nothing(checkpoint, finished_run, tmp_path, capsys, monkeypatch):
    out = tmp_path / "run"
    calls = []
    save = training_state.save_state

    def full(path, *rest):
        calls.append(path)
        if len(calls) == checkpoint:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        save(path, *rest)

    monkeypatch.setattr(training_state, "save_state", full)
    code, said = run_line(capsys, *train_only(out))
    monkeypatch.undo()
    last = said.strip().splitlines()[-1]
    assert code == 2 and "disk is full" in last and str(out) in last
    assert ("iteration 14 is kept" in last and "--resume" in last) == (checkpoint == 3)
    if checkpoint == 1:
        assert list(tmp_path.iterdir()) == []
    else:
        assert RunFolder(out).record()["status"] == "failed"
        assert main(resume(out)) == 0
        assert_same_run(finished_run, out)


def test_files_that_may_not_grow_leave_nothing_half_written(tmp_path):
    """The operating system itself refuses: files of at most 30 kB, so that the first checkpoint breaks off."""
    resource = pytest.importorskip("resource")
    done = subprocess.run(
        [sys.executable, "-m", "endotsr.cli.main", *train_only(tmp_path / "run")],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000)),
        env=os.environ | {"NUMBA_CACHE_DIR": os.environ.get("NUMBA_CACHE_DIR", "")},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 2 and "Traceback" not in done.stderr
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("endotsr: error: ") and str(tmp_path / "run") in last
    assert list(tmp_path.iterdir()) == []


def test_run_that_holds_a_run_is_refused(finished_run, capsys):
    before = (finished_run / "run.json").read_bytes()
    assert_refused(capsys, train_words(finished_run), str(finished_run), "--resume")
    assert (finished_run / "run.json").read_bytes() == before


def test_resume_of_a_finished_run_changes_nothing(finished_run, run_copy, capsys):
    assert main(resume(run_copy)) == 0
    assert f"after iteration {LAST} of {LAST}" in capsys.readouterr().out
    assert_same_run(finished_run, run_copy)


@pytest.mark.parametrize(
    ("more", "named"),
    [
        (["--model.beta", "0.2"], ["keeps the settings", "requested: model.beta = 0.2 (run: 0.3)\n"]),
        (["--iterations", "20"], ["requested: training.iterations = 20 (run: 30)\n"]),
        (
            ["--scale", "0.5", "--seed", "1"],
            ["requested: sequence.scale = 0.5 (run: 1.0), training.seed = 1 (run: 0)\n"],
        ),
        (["--preset", "sharp"], ["requested: preset = 'sharp' (run: 'paper')\n"]),
        (["--iterations", "30", "--schedule", "absolute"], ["loss.laplacian_from = 1000 (run: 5)"]),
    ],
)
def test_resume_refuses_what_would_change_the_result(more, named, finished_run, run_copy, capsys):
    assert_refused(capsys, [*resume(run_copy), *more], *named)
    assert_same_run(finished_run, run_copy)


def test_resume_may_repeat_the_command_line(run_copy):
    assert main(train_only(run_copy, "--resume", "--threads", "2")) == 0


def test_resume_compares_only_what_was_asked_for(tmp_path, capsys):
    out = tmp_path / "run"
    file = tmp_path / "mine.toml"
    file.write_text("[model]\nbeta = 0.4\n[loss]\nlaplacian_from = 600\n")
    words = ["--scale", "0.75", "--initialisation.motion-threshold", "30", "--iterations", "6"]
    assert main(train_only(out, "--config", str(file), *words)) == 0
    kept = (out / "config.toml").read_bytes()
    for repeated in (
        ["--iterations", "6"],
        ["--scale", "0.75"],
        ["--preset", "paper"],
        ["--config", str(file), "--iterations", "6"],
        ["--config", str(out / "config.toml")],
    ):
        assert main([*resume(out), *repeated]) == 0, repeated
    assert (out / "config.toml").read_bytes() == kept
    file.write_text("[model]\nbeta = 0.45\nbases = 17\n")
    asked = [*resume(out), "--config", str(file)]
    assert_refused(capsys, asked, "requested: model.beta = 0.45 (run: 0.4)\n")
    file.write_text('preset = "sharp"\n')
    assert_refused(capsys, asked, "requested: preset = 'sharp' (run: 'paper')\n")


def test_resume_of_a_demo_needs_none_of_its_options(tmp_path, capsys):
    out = tmp_path / "run"
    assert main(["demo", *train_only(out, "--scale", "0.75", "--iterations", "4")[2:]]) == 0
    assert main(["demo", "--out", str(out), "--resume", "--no-evaluate"]) == 0
    assert_refused(capsys, ["demo", "--out", str(out), "--resume", "--seed", "2"], "training.seed = 2 (run: 0)")


def test_calibrated_weight_is_recorded_and_survives_resuming(tmp_path, monkeypatch):
    words = ["--iterations", "12", "--loss.lambda-lap", "auto", "--training.checkpoint-every", "7"]
    assert main(train_only(tmp_path / "a", *words)) == 0
    weight = RunFolder(tmp_path / "a").record()["lambda_lap"]
    assert weight > 0
    save = training_state.save_state

    def stop(path, state, config, sequence):
        save(path, state, config, sequence)
        raise KeyboardInterrupt

    monkeypatch.setattr(training_state, "save_state", stop)
    assert main(train_only(tmp_path / "b", *words)) == 130
    monkeypatch.undo()
    monkeypatch.setattr(trainer, "calibrated_weight", None)  # a second calibration would be an error
    assert main(resume(tmp_path / "b")) == 0
    assert_same_run(tmp_path / "a", tmp_path / "b")
    assert RunFolder(tmp_path / "b").record()["lambda_lap"] == weight


@pytest.mark.parametrize("damage", ["truncated", "foreign"])
def test_damaged_checkpoint_is_one_line(damage, run_copy, tmp_path, capsys):
    out = run_copy
    (out / "checkpoint.previous.npz").unlink()
    file = out / "checkpoint.npz"
    file.write_bytes(file.read_bytes()[:5000] if damage == "truncated" else b"PK not really")
    for words in (resume(out), ["evaluate", str(out)], ["render", str(out), "--out", str(tmp_path / "pictures")]):
        assert_refused(capsys, words, "checkpoint.npz")
    assert not (tmp_path / "pictures").exists()
