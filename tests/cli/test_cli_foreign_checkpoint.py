"""A checkpoint beside settings that it was not trained with: one line that names file, setting and both values."""

import json
import shutil

import numpy as np
import pytest
from tiny import assert_refused, assert_same_run, train_words

from endotsr.cli.main import main

pytestmark = pytest.mark.slow


def edit(run, old, new):
    text = (run / "config.toml").read_text()
    assert old in text
    (run / "config.toml").write_text(text.replace(old, new))


def commands(run):
    """Every command that reads a checkpoint."""
    return (
        ["render", str(run), "--out", str(run.parent / "pictures")],
        ["evaluate", str(run)],
        ["train", "--calibrate-only", "--out", str(run)],
        ["train", "--out", str(run), "--resume", "--no-evaluate"],
    )


def forget_settings(file):
    """The checkpoint with a header that does not hold the settings: only its arrays tell."""
    with np.load(file) as opened:
        entries = dict(opened)
    header = json.loads(entries["header"].tobytes())
    del header["header"]["config"]
    entries["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(file, **entries)


OF_THE_ARRAYS = [  # in config.toml, and instead; what the checkpoint and what the file says
    ("bases = 17", "bases = 9", "model.bases = 17", "has 9"),
    ("frequencies = 8", "frequencies = 4", "model.frequencies = 8", "has 4"),
    ("harmonics_degree = 3", "harmonics_degree = 1", "model.harmonics_degree = 3", "has 1"),
    ('precision = "float32"', 'precision = "float64"', "training.precision = 'float32'", "has 'float64'"),
    ("appearance = true", "appearance = false", "model.appearance = True", "has False"),
    ("spectral_motion = true", "spectral_motion = false", "model.spectral_motion = True", "has False"),
    ("deformation = true", "deformation = false", "model.deformation = True", "has False"),
]
EDITS = [*OF_THE_ARRAYS, ("beta = 0.3", "beta = 0.5", "model.beta = 0.3", "has 0.5")]
REFUSED = [*((*edit, True) for edit in EDITS), *((*edit, False) for edit in OF_THE_ARRAYS)]


@pytest.mark.parametrize(("old", "new", "trained", "says", "remembered"), REFUSED, ids=[
    f"{new}, remembered" if remembered else new for _, new, _, _, remembered in REFUSED
])  # fmt: skip
def test_an_edited_setting_is_refused(old, new, trained, says, remembered, run_copy, capsys):
    """A setting that shapes the arrays is also seen where the checkpoint does not remember its settings."""
    edit(run_copy, old, new)
    if not remembered:
        forget_settings(run_copy / "checkpoint.npz")
    for words in commands(run_copy):
        assert_refused(capsys, words, f"{run_copy / 'checkpoint.npz'}: trained with {trained}", f"config.toml {says}")


def test_empty_settings_are_refused(run_copy, capsys):
    (run_copy / "config.toml").write_text("")
    for words in commands(run_copy):
        assert_refused(capsys, words, "trained with loss.smoothness_from = 5", "has 1001")


def test_the_checkpoint_of_another_run_is_refused(run_copy, tmp_path, capsys):
    other = tmp_path / "other"
    assert main(train_words(other, "--no-evaluate", "--iterations", "3", "--seed", "4")) == 0
    shutil.copy(other / "checkpoint.npz", run_copy)
    for words in commands(run_copy):
        assert_refused(
            capsys, words, f"{run_copy / 'checkpoint.npz'}: trained with ", f"{run_copy / 'config.toml'} has "
        )


def test_a_checkpoint_from_before_the_residuals_is_of_the_run(finished_run, tmp_path, monkeypatch):
    from endotsr.training.fitting import state as training_state

    early = tmp_path / "early"
    save = training_state.save_state

    def stop(path, state, config, sequence):
        save(path, state, config, sequence)
        raise KeyboardInterrupt

    monkeypatch.setattr(training_state, "save_state", stop)
    assert main(train_words(early, "--no-evaluate")) == 130
    monkeypatch.undo()
    forget_settings(early / "checkpoint.npz")
    assert main(["render", str(early), "--out", str(tmp_path / "pictures")]) == 0
    assert main(["train", "--out", str(early), "--resume", "--no-evaluate"]) == 0
    assert_same_run(finished_run, early)


def test_settings_that_change_no_number_may_be_edited(run_copy):
    edit(run_copy, "checkpoint_every = 7", "checkpoint_every = 10")
    edit(run_copy, "threads = 1", "threads = 2")
    assert main(["train", "--out", str(run_copy), "--resume", "--no-evaluate"]) == 0
