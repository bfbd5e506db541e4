"""`endotsr inspect`, and `train --effects auto`, which follows its plan."""

import json

import pytest
from tiny import assert_refused, scene, train_words, written_folder

from endotsr.cli.main import main
from endotsr.cli.parts.options import explicit_settings
from endotsr.cli.train import TrainOptions
from endotsr.clips.sequences import layouts
from endotsr.config import load_config

STILL = ("breathing", "pulsation", "pull", "exposure", "brightening", "highlights", "instrument")  # off


def test_inspect_prints_verdicts_and_plan(capsys, tmp_path):
    page, data = tmp_path / "report.html", tmp_path / "report.json"
    words = ["inspect", scene(*STILL), "--out", str(page), "--json", str(data), "--frame-rate", "15"]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "motion           none" in said and "model.deformation = false (now true)" in said
    record = json.loads(data.read_text(encoding="utf-8"))
    assert record["verdicts"]["motion"]["present"] is False and record["frame_rate"] == 15
    assert record["plan"]["changes"][0]["key"] == "model.deformation"
    text = page.read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>") and "http" not in text.split("</style>")[1].split("data:image")[0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "report.json"]


def test_inspect_describes_a_folder_once_and_names_what_nothing_reads(capsys, tmp_path, monkeypatch):
    folder, described = written_folder(tmp_path), []
    (folder / "times.txt").write_text("0\n")
    listed = layouts.unread
    monkeypatch.setattr(layouts, "unread", lambda *given: described.append(given) or listed(*given))
    assert main(["inspect", str(folder), "--frames", "0:6"]) == 0
    said = capsys.readouterr().out
    assert "not read: times.txt" in said and "plan:" in said and len(described) == 1


@pytest.mark.parametrize(
    "words, named",
    [
        (["inspect"], ("SEQUENCE is missing",)),
        (["inspect", "no_such_folder"], ("no_such_folder",)),
        (["inspect", "simulated", "--frame-rate", "0"], ("frame rate 0", "> 0")),
        (["inspect", "simulated", "--frame-rate", "fast"], ("--frame-rate", "fast")),
        (["inspect", "simulated", "--out", "no_such_folder/page.html"], ("no_such_folder",)),
        (["inspect", "simulated", "--model.bases", "0"], ("model.bases",)),
        (["train", "simulated", "--out", "run", "--effects", "some"], ("--effects", "everything or auto")),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(capsys, tmp_path, monkeypatch, words, named):
    monkeypatch.chdir(tmp_path)
    assert_refused(capsys, words, *named)
    assert list(tmp_path.iterdir()) == []


def test_explicit_settings_are_those_of_the_command_line_and_of_the_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('preset = "sharp"\n[model]\nbeta = 0.4\n')
    words = ["x", "--config", str(file), "--model.no-appearance", "--scale", "0.5", "--preset", "demo", "--resume"]
    assert explicit_settings(TrainOptions, words) == {"model.beta", "model.appearance", "sequence.scale"}


def test_effects_auto_trains_what_the_clip_calls_for_and_says_so(capsys, tmp_path):
    out = tmp_path / "run"
    words = train_words(
        out, "--effects", "auto", "--model.harmonics-degree", "2", "--no-evaluate", source=scene(*STILL)
    )
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "  model.deformation = false (was true): No tile moves" in said
    assert "  model.harmonics_degree = 2 is kept as given; the plan has 0" in said
    config = load_config(out / "config.toml")
    assert not config.model.deformation and config.model.harmonics_degree == 2
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    assert record["effects"]["verdicts"]["motion"]["present"] is False


def test_effects_everything_says_so_and_changes_nothing(capsys, tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    assert main(train_words(one, "--no-evaluate", source=scene(*STILL))) == 0
    assert "effects: everything" in capsys.readouterr().out
    assert main(train_words(other, "--effects", "everything", "--no-evaluate", source=scene(*STILL))) == 0
    assert (one / "config.toml").read_bytes() == (other / "config.toml").read_bytes()
    assert "effects" not in json.loads((one / "run.json").read_text(encoding="utf-8"))
