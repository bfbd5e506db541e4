"""`--resume --iterations N`: a finished run gets more iterations, on a schedule that is stated."""

import json
import shutil

import numpy as np
import pytest
from tiny import assert_refused, assert_same_run, log_without_seconds

from endotsr.cli.main import main
from endotsr.config import load_config
from endotsr.training.fitting.schedules import learning_rates


def extended(finished_run, out, *more):
    shutil.copytree(finished_run, out)
    assert main(["train", "--out", str(out), "--resume", "--iterations", "34", "--no-evaluate", *more]) == 0
    return out


def test_a_finished_run_is_extended_and_only_its_length_changes(finished_run, tmp_path, capsys):
    out = extended(finished_run, tmp_path / "a")
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


def test_an_extension_is_reproducible(finished_run, tmp_path):
    a, b = extended(finished_run, tmp_path / "a"), extended(finished_run, tmp_path / "b")
    assert_same_run(a, b)


def test_the_rates_are_those_of_a_run_of_the_new_length(finished_run):
    import msgspec

    config = load_config(finished_run / "config.toml")
    longer = msgspec.structs.replace(config, training=msgspec.structs.replace(config.training, iterations=60))
    initial, fraction = config.optimiser.position, config.optimiser.final_factor
    assert learning_rates(30, config)["position"] == pytest.approx(initial * fraction)
    assert learning_rates(30, longer)["position"] == pytest.approx(initial * fraction**0.5)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--iterations", "20"], "training.iterations = 20 (run: 30)"),
        (["--iterations", "0"], "--iterations 0 is not allowed"),
        (["--iterations", "40", "--seed", "5"], "training.seed = 5 (run: 0)"),
    ],
)
def test_a_run_is_not_shortened_and_keeps_its_other_settings(words, named, finished_run, tmp_path, capsys):
    shutil.copytree(finished_run, tmp_path / "a")
    before = (tmp_path / "a" / "config.toml").read_text()
    assert_refused(capsys, ["train", "--out", str(tmp_path / "a"), "--resume", *words], named)
    assert (tmp_path / "a" / "config.toml").read_text() == before
