"""`endotsr tradeoff` from the outside: files, second call, budget, mistakes."""

import json
import os
from pathlib import Path

import pytest
from pages.tradeoff import train
from test_splat_file import write_npz

from endotsr.cli.main import main
from endotsr.errors import InputError
from endotsr.studies.tradeoff import study
from endotsr.studies.tradeoff.results import read_format, read_measurement

pytestmark = pytest.mark.slow


def run_training(*words):
    return train.run(train.PROGRAM._parser("").parse_args([*words]))


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tradeoff")
    write_npz(folder / "few_splats.npz")
    words = ["tradeoff", "--splats", str(folder / "few_splats.npz"), "--scale", "0.1", "--out", str(folder / "out")]
    assert main(words) == 0
    return folder


def test_files(measured):
    out = measured / "out"
    result = json.loads((out / "tradeoff.json").read_text())
    assert result["scene"]["name"] == "few" and result["scene"]["width"] == 32
    assert result["threads"] == 2 and result["date"] and result["machine"]["processor"]
    assert all(p["forward"]["low"] <= p["forward"]["median"] <= p["both"]["median"] for p in result["points"])
    assert {p.name for p in out.iterdir()} == {"tradeoff.json", "tradeoff.html"}


def test_a_measurement_is_not_overwritten(measured, capsys):
    assert main(["tradeoff", "--out", str(measured / "out")]) == 2
    assert "already contains a measurement" in capsys.readouterr().err


def test_budget_reads_the_measurement(measured, capsys):
    before = (measured / "out" / "tradeoff.json").read_bytes()
    assert main(["tradeoff", "--out", str(measured / "out"), "--budget", "1/255"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("1/255: ") and "expected error: largest" in said and "--raster.alpha-cutoff" in said
    assert (measured / "out" / "tradeoff.json").read_bytes() == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--budget", "soon"], 'use a time per frame ("10 ms"'),
        (["--budget", "1 us"], "in its upper quartile; the smallest is of"),
        (["--budget", "5 min"], 'use a time per frame ("10 ms"'),
        (["--run", "a", "--splats", "b"], "--run with --splats: both state the scene"),
        (["--scale", "0"], "use a number > 0"),
        (
            ["--run", "other", "--budget", "1/255"],
            "--run has no effect with the folder with a measurement: --budget chooses from it",
        ),
        (
            ["--scale", "0.5", "--budget", "1/255"],
            "--scale has no effect with the folder with a measurement: --budget chooses from it; another --out makes",
        ),
        (["--threads", "-1", "--out", "new"], "--threads -1 is not allowed; use 0 (all cores) or more"),
    ],
)
def test_mistakes(measured, capsys, words, said):
    assert main(["tradeoff", "--out", str(measured / "out"), *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    "words",
    [
        ["--run", "nope"],
        ["--splats", "nope.ply"],
        ["--splats", "nope.ply", "--budget", "10 ms"],
    ],
)
def test_a_refused_call_leaves_no_folder(words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["tradeoff", *words, "--out", "out"]) == 2
    assert capsys.readouterr().err.startswith("endotsr: error: ") and list(tmp_path.iterdir()) == []


def test_an_output_folder_that_cannot_be_is_refused_before_the_work(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert main(["tradeoff", "--out", str(tmp_path / "file")]) == 2
    assert "is not a folder" in capsys.readouterr().err
    assert main(["tradeoff", "--out", str(tmp_path / "file" / "out")]) == 2
    assert "is not a folder" in capsys.readouterr().err


def test_a_folder_without_permission_is_refused_before_the_work(tmp_path, capsys, monkeypatch):
    """The measurement takes minutes."""
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    monkeypatch.setattr(study, "run_study", lambda *_, **__: pytest.fail("measured"))
    assert main(["tradeoff", "--splats", str(tmp_path / "a.ply"), "--out", str(tmp_path)]) == 2
    assert "no permission" in capsys.readouterr().err


def test_a_measurement_without_its_keys_is_refused(measured, tmp_path, capsys):
    whole = json.loads((measured / "out" / "tradeoff.json").read_text())
    without = {key: value for key, value in whole["points"][0].items() if key != "both"}
    for content, said in (
        ({"format": 1}, "incomplete measurement: Object missing required field `scene`"),
        (whole | {"points": [without]}, "missing required field `both` - at `$.points[0]`"),
        (whole | {"points": 3}, "Expected `array`, got `int` - at `$.points`"),
        (whole | {"points": []}, "which is no point"),
        (whole | {"fronts": {"forward": []}}, "fronts.forward"),
    ):
        (tmp_path / "tradeoff.json").write_text(json.dumps(content))
        assert main(["tradeoff", "--out", str(tmp_path), "--budget", "1/255"]) == 2
        error = capsys.readouterr().err
        assert said in error and "tradeoff.json: " in error


RESULTS = sorted((Path(__file__).parents[3] / "docs" / "results").glob("tradeoff*.json"))


@pytest.mark.parametrize("file", RESULTS, ids=lambda file: file.stem)
def test_recorded_measurements_are_whole(file):
    assert (read_format if "training" in file.name else read_measurement)(file)["format"] == 1


def test_mistakes_of_a_study_of_training(tmp_path):
    for words, said in (
        (["--minutes", "0"], "use --minutes > 0"),
        (["--iterations", "0"], "--iterations >= 1"),
        ([], "not found"),
    ):
        with pytest.raises(InputError, match=said):
            run_training(str(tmp_path / "none"), "--out", str(tmp_path / "out"), *words)
    assert not (tmp_path / "out").exists()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "training.json").write_text("{}")
    with pytest.raises(InputError, match="not a measurement of this version"):
        run_training("simulated", "--out", str(tmp_path / "out"))
