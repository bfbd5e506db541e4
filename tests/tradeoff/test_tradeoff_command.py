"""`endotsr tradeoff` from the outside: files, second call, budget, mistakes."""

import json

import pytest
from test_splat_file import write_npz

from endotsr.cli import main


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tradeoff")
    write_npz(folder / "few_splats.npz")
    words = ["tradeoff", "--splats", str(folder / "few_splats.npz"), "--scale", "0.1", "--out", str(folder / "out")]
    assert main([*words, "--images"]) == 0
    return folder


def test_files(measured):
    out = measured / "out"
    result = json.loads((out / "tradeoff.json").read_text())
    assert result["scene"]["name"] == "few" and result["scene"]["width"] == 32
    assert result["threads"] == 2 and result["date"] and result["machine"]["processor"]
    assert all(p["forward"]["low"] <= p["forward"]["median"] <= p["both"]["median"] for p in result["points"])
    stems = ("tradeoff", "tradeoff_dials", "tradeoff_dials_visits", "tradeoff_dials_gradients")
    wanted = {f"{stem}{ending}" for stem in stems for ending in (".png", ".svg")}
    assert {p.name for p in out.iterdir()} == wanted | {"tradeoff.json", "tradeoff.html", "images"}
    assert len(list((out / "images").glob("*_gradients.npz"))) == len(result["points"]) + 1


def test_a_measurement_is_not_overwritten(measured, capsys):
    assert main(["tradeoff", "--out", str(measured / "out")]) == 2
    assert "holds a measurement already" in capsys.readouterr().err


def test_budget_reads_the_measurement(measured, capsys):
    before = (measured / "out" / "tradeoff.json").read_bytes()
    assert main(["tradeoff", "--out", str(measured / "out"), "--budget", "1/255"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("1/255: ") and "expected error: largest" in said and "--raster.alpha-cutoff" in said
    assert (measured / "out" / "tradeoff.json").read_bytes() == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--budget", "soon"], 'allowed: a time per frame ("10 ms"'),
        (["--budget", "1 us"], "the fastest is"),
        (["--budget", "5 min"], "no measured trainings; make them with `endotsr tradeoff train"),
        (["--run", "a", "--splats", "b"], "give one of --run and --splats"),
        (["--repeats", "3"], "allowed: an integer >= 7"),
        (["--scale", "0"], "allowed: a number > 0"),
        (["--threads", "-1", "--out", "new"], "--threads -1 is not allowed; allowed: 0 (all cores) or more"),
    ],
)
def test_mistakes(measured, capsys, words, said):
    assert main(["tradeoff", "--out", str(measured / "out"), *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_mistakes_of_train(tmp_path, capsys):
    for words, said in (
        (["--minutes", "0"], "allowed: a number > 0"),
        (["--iterations", "0"], "allowed: an integer >= 1"),
        (["--threads", "-1"], "--threads -1 is not allowed; allowed: 0 (all cores) or more"),
        ([str(tmp_path / "none")], "not found"),
    ):
        assert main(["tradeoff", "train", "--out", str(tmp_path / "out"), *words]) == 2
        assert said in capsys.readouterr().err
    (tmp_path / "out" / "training.json").write_text("{}")
    assert main(["tradeoff", "train", "--out", str(tmp_path / "out")]) == 2
    assert "not a measurement of this version" in capsys.readouterr().err
