"""`endotsr simulate`: a folder that `train` reads, and refusals of one line that leave nothing behind."""

import json

import pytest
from tiny import SETTINGS, assert_refused

from endotsr.cli.main import main
from endotsr.clips.simulator.scenes import IN_FILES
from endotsr.clips.simulator.truth import read_truth
from endotsr.errors import InputError

SMALL = ["--width", "40", "--height", "32", "--frames", "4", "--focal", "1.5"]


def test_a_scene_is_written_and_trained_without_a_word_more(tmp_path, capsys):
    out = tmp_path / "new" / "scene"
    assert (
        main(["simulate", "pulling", "--out", str(out), *SMALL, "--seed", "5", "--smoke.on", "--pull.on", "false"]) == 0
    )
    assert f"train with: endotsr train {out} --out RUN" in capsys.readouterr().out
    settings = read_truth(out).settings
    assert (settings.width, settings.frames, settings.seed) == (40, 4, 5)
    assert settings.smoke.on and settings.exposure.on and not settings.pull.on and settings.stereo.on
    assert [path.name for path in out.parent.iterdir()] == ["scene"]
    run = tmp_path / "run"
    assert main(["train", str(out), "--out", str(run), *SETTINGS, "--iterations", "2"]) == 0
    assert "Mean trajectory error" in capsys.readouterr().out
    motion = json.loads((run / "metrics.json").read_text(encoding="utf-8"))["trajectories"]
    assert motion["unit"] == "mm" and motion["motion_scene_units"] > 0.05 and motion["pixels"] > 0


def test_a_damaged_truth_is_refused_before_the_training(tmp_path, capsys):
    out = tmp_path / "scene"
    assert main(["simulate", "still", "--out", str(out), *SMALL]) == 0
    capsys.readouterr()
    (out / "truth" / "tracks.npz").write_bytes(b"PK nothing")
    assert_refused(
        capsys, ["train", str(out), "--out", str(tmp_path / "run"), *SETTINGS], "tracks.npz", "not an .npz file"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["scene"]


def test_a_list_of_effects_is_a_scene_too(tmp_path):
    assert main(["simulate", "--effects", "noise,vignetting", "--out", str(tmp_path / "a"), *SMALL]) == 0
    truth = read_truth(tmp_path / "a")
    on = [name for name in ("breathing", "noise", "vignetting", *IN_FILES) if getattr(truth.settings, name).on]
    assert on == ["noise", "vignetting", *IN_FILES] and truth.scene == "noise,vignetting"
    words = ["--effects", "more_instruments", "--instrument.travel", "0.01"]  # which these move by too
    assert main(["simulate", *words, "--out", str(tmp_path / "b"), *SMALL]) == 0


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["stil"], ("scene 'stil' is not allowed", "use one of still, breathing, pulling")),
        ([], ("SCENE is missing", "--effects")),
        (["still", "--effects", "fog"], ("unknown: fog", "use one of breathing")),
        (["still", "--width", "9000", "--height", "9000"], ("9000x9000 pixels are not allowed", "at most 67108864")),
        (["still", "--width", "15"], ("width = 15 is not allowed", "an integer >= 16")),
        (["still", "--frames", "2"], ("frames = 2 is not allowed", "an integer >= 3")),
        (["pulling", "--distance", "20000"], ("distance = 20000", "a number > 0 and <= 10000")),
        (["breathing", "--breathing.amplitude", "60"], ("breathing.amplitude = 60 leaves", "use at most")),
        (["still", "--stereo.on", "false"], ("without an excluded pixel", "stereo")),
        (["still", "--relief", "30"], ("leaves the field of view", "use a larger focal, a smaller relief\n")),
        (["still", "--focal", "0.1"], ("leaves the field of view", "use a larger focal, a smaller relief\n")),
        (["still", "--wdth", "40"], ("--wdth: no such option", "--width")),
        (["pulling", "--pull.stop", "0.1"], ("pull.stop = 0.1 is not allowed", "above pull.start = 0.15")),
        (["smoke", "--smoke.start", "0.9", "--smoke.stop", "0.9"], ("smoke.stop = 0.9", "above smoke.start = 0.9")),
        (["still", "--noise.on", "perhaps"], ("perhaps",)),
        (["still", "--noise.of", "1"], ("unknown key noise.of", "use on or sigma")),
        (["still", "--motion-blur.shutter", "0.9"], ("--motion-blur.shutter has no effect", "add --motion-blur.on")),
        (["pulling", "--pull.no-on", "--pull.width", "9"], ("--pull.width has no effect: pull is off",)),
        (["still", "--block-length", "2"], ("block_length = 2 does not fit files", "train --sequence.split blocks")),
        (["still", "--layout", "stereomis", "--block-length", "2"], ("block_length = 2 does not fit files",)),
    ],
)
def test_bad_input_is_refused_and_nothing_is_left(tmp_path, capsys, words, named):
    assert_refused(capsys, ["simulate", *SMALL, *words, "--out", str(tmp_path / "out")], *named)
    assert list(tmp_path.iterdir()) == []


def test_a_failure_while_writing_leaves_nothing(tmp_path, capsys, monkeypatch):
    def fails(folder, i, frame):
        if i == 2:
            raise InputError("simulator: at t = 0.5 the sheet folds over itself")

    monkeypatch.setattr("endotsr.clips.simulator.folder.write_frame", fails)
    assert_refused(capsys, ["simulate", "still", "--out", str(tmp_path / "out"), *SMALL], "simulator: at t = 0.5")
    assert list(tmp_path.iterdir()) == []


def test_an_existing_folder_is_refused(tmp_path, capsys):
    (tmp_path / "there").mkdir()
    assert_refused(capsys, ["simulate", "still", "--out", str(tmp_path / "there")], "there: exists already")
    assert_refused(capsys, ["simulate", "still"], "--out FOLDER is missing")
    assert list((tmp_path / "there").iterdir()) == []
