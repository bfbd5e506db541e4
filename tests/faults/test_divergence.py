"""Numbers that are not finite stop a training before they reach a parameter; a rising loss is said early."""

import math

import numpy as np
import pytest
from tiny import log_without_seconds, run_line, train_words

from endotsr.cli.main import main
from endotsr.training.fitting import view
from endotsr.training.fitting.divergence import Diverged, DivergenceWatch, not_finite
from endotsr.training.runs.diverged import repeat_iteration
from endotsr.training.scene.gaussians import Gaussians

SLOW = pytest.mark.faults  # not by default


def spoiled(monkeypatch, at, name, value=math.nan):
    """The gradient or the loss term `name` gets a value at iteration `at`."""
    reverse, image_loss = view.render_reverse, view.image_loss
    calls = {"reverse": 0, "loss": 0}

    def spoil_gradient(*words, **more):
        found = reverse(*words, **more)
        calls["reverse"] += 1
        if calls["reverse"] == at:
            getattr(found, name)[..., 3] = value
        return found

    def spoil_loss(*words, **more):
        found = image_loss(*words, **more)
        calls["loss"] += 1
        return found._replace(terms=found.terms | {name: value}) if calls["loss"] == at else found

    if name.startswith("d_"):
        monkeypatch.setattr(view, "render_reverse", spoil_gradient)
    else:
        monkeypatch.setattr(view, "image_loss", spoil_loss)


@pytest.mark.parametrize("value", [math.nan, pytest.param(math.inf, marks=SLOW)])
@pytest.mark.parametrize(
    "name",
    [*("d_position", "l1"), *(pytest.param(n, marks=SLOW) for n in ("d_opacity_logit", "d_log_scale", "d_quaternion"))],
)
def test_the_iteration_stops_before_a_parameter_is_changed(name, value, trained, tmp_path, capsys, monkeypatch):
    out = tmp_path / "run"
    spoiled(monkeypatch, 17, name, value)
    code, said = run_line(capsys, *train_words(out, "--no-evaluate"))
    assert code == 1 and said.count("diverged: non-finite") == 1
    assert "iteration 17, frame " in said and name in said and "diverged.npz contains the state before it" in said
    monkeypatch.undo()
    assert log_without_seconds(out) == log_without_seconds(trained)[:16]
    for number in (1, 1):  # the spoiled call is now the first one
        spoiled(monkeypatch, number, name, value)
        with pytest.raises(Diverged, match="iteration 17") as caught:
            repeat_iteration(out)
        assert caught.value.term.startswith(name)
        monkeypatch.undo()
    entry = repeat_iteration(out)  # without the fault the iteration is that of the whole run, bit for bit
    assert entry == log_without_seconds(trained)[16]


def test_the_state_before_a_picture_that_is_not_finite_is_whole_again_when_it_is_read(trained, tmp_path, monkeypatch):
    """Such a gradient reaches the statistics of density control, of which a checkpoint holds finite numbers alone."""
    out, image_loss, calls = tmp_path / "run", view.image_loss, [0]

    def spoil(*words, **more):
        found = image_loss(*words, **more)
        calls[0] += 1
        return found._replace(d_colour=found.d_colour * math.nan) if calls[0] == 12 else found

    monkeypatch.setattr(view, "image_loss", spoil)
    assert main(train_words(out, "--no-evaluate")) == 1
    monkeypatch.undo()
    assert repeat_iteration(out) == log_without_seconds(trained)[11]


def test_a_run_that_stopped_continues_from_its_checkpoint(trained, tmp_path, monkeypatch):
    out = tmp_path / "run"
    spoiled(monkeypatch, 17, "d_position")
    assert main(train_words(out, "--no-evaluate")) == 1
    monkeypatch.undo()
    assert main(["train", "--out", str(out), "--resume", "--no-evaluate"]) == 0
    assert log_without_seconds(out) == log_without_seconds(trained)


def test_large_finite_numbers_are_no_divergence():
    assert not_finite({"d": np.full((3, 5), 3e38, np.float32), "none": None, "empty": np.zeros((3, 0))}) is None
    values = np.zeros((3, 5), np.float32)
    values[1, 4] = -np.inf
    assert not_finite({"fine": np.ones(3), "d": values}) == ("d[1, 4]", "-inf")


def scene(position):
    count = position.shape[1]
    return Gaussians(position, np.ones((4, count)), np.zeros((3, count)), np.zeros(count), np.zeros((1, 3, count)))


@pytest.fixture
def gaussians():
    return scene(np.random.default_rng(0).normal(size=(3, 1000)).astype(np.float32))


def watched(losses, gaussians, later=None):
    watch = DivergenceWatch(gaussians)
    said = []
    for k, loss in enumerate(losses, start=1):
        said.append(watch.see({"iteration": k, "loss": 9.0, "l1": loss}, later or gaussians))
    return [line for line in said if line]


def test_a_rising_loss_is_said_once_with_what_to_try(gaussians):
    (line,) = watched([0.1] * 200 + [0.5] * 400, gaussians)
    assert line.startswith("iteration 300: the mean colour loss") and "5.0 times" in line
    assert "--optimiser.position" in line


ORDINARY = [[0.1] * 600, [0.2] * 150 + [0.1] * 450, [0.1, 0.25] * 300, [5.0] * 50]


@pytest.mark.parametrize("losses", ORDINARY, ids=range(len(ORDINARY)))
def test_an_ordinary_loss_is_not_commented(losses, gaussians):
    assert watched(losses, gaussians) == []


def test_gaussians_that_run_off_are_said_once(gaussians):
    away = gaussians.position.copy()
    away[2, :20] = 1e6
    (line,) = watched([0.1] * 300, gaussians, scene(away))
    assert line.startswith("iteration 100: 2% of the Gaussians") and "depth" in line
    away[2, 9:20] = 0.0
    assert watched([0.1] * 300, gaussians, scene(away)) == []


def test_a_scene_without_gaussians_is_watched_too():
    assert watched([0.1] * 200, scene(np.zeros((3, 0)))) == []


def test_an_iteration_of_a_coarse_start_is_repeated_on_frames_of_half_size(tmp_path, monkeypatch):
    whole, out = tmp_path / "whole", tmp_path / "run"
    assert main(train_words(whole, "--no-evaluate", "--training.coarse-start")) == 0
    spoiled(monkeypatch, 12, "l1")
    assert main(train_words(out, "--no-evaluate", "--training.coarse-start")) == 1
    monkeypatch.undo()
    assert repeat_iteration(out) == log_without_seconds(whole)[11]


def test_a_calibration_that_is_not_finite_is_told_from_the_training(tmp_path, capsys, monkeypatch):
    """Its base model is no state of the run: there is nothing to repeat."""
    out = tmp_path / "run"
    spoiled(monkeypatch, 9, "d_position")
    code, said = run_line(capsys, *train_words(out, "--no-evaluate", "--loss.lambda-lap", "auto"))
    assert code == 1 and "calibration of loss.lambda_lap: iteration 9, frame " in said
    assert "diverged.npz" not in said and not (out / "diverged.npz").exists()
