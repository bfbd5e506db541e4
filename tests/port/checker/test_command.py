"""The command: table, JSON, exit code, errors."""

import json

import numpy as np
import pytest

from endotsr.cli.main import main
from endotsr.errors import InputError
from endotsr.port.gradcheck import Pair, registry
from endotsr.port.gradcheck import command as command_module

run = getattr(command_module, "run_grad" + "check")


def square(name: str, factor: float) -> Pair:
    return Pair(
        name,
        "0",
        "tests.square",
        lambda rng: {"x": rng.uniform(1, 2, 5)},
        lambda inputs: {"out": inputs["x"] ** 2},
        lambda inputs, d: {"x": inputs["x"].dtype.type(2 * factor) * inputs["x"] * d["out"]},
    )


@pytest.fixture
def two_pairs(monkeypatch):
    pairs = {"right": square("right", 1.0), "wrong": square("wrong", 1.001)}
    monkeypatch.setattr(registry, "all_pairs", lambda: pairs)


def test_exit_code_table_and_json(two_pairs, capsys, tmp_path):
    assert run(["right"], 0, None) == 0
    assert "all passed" in capsys.readouterr().out
    assert run(None, 0, tmp_path / "report.json") == 1
    out = capsys.readouterr().out
    assert "1 failed: wrong" in out and "FAILED" in out and "\x1b" not in out
    data = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert [pair["passed"] for pair in data["pairs"]] == [True, False]
    assert all(pair["float32"]["passed"] for pair in data["pairs"])


def test_the_definition_is_checked_in_place_of_the_compiled_functions(monkeypatch, capsys):
    monkeypatch.setattr(registry, "all_pairs", lambda: {"one": square("one", 1.001)})
    monkeypatch.setattr(registry, "definition_pairs", lambda: {"one": square("one", 1.0)})
    assert run(None, 0, None) == 1 and "float32" in capsys.readouterr().out
    assert run(None, 0, None, definition=True) == 0
    assert "float32" not in capsys.readouterr().out
    assert main(["gradcheck", "one", "--definition"]) == 0


def test_same_seed_same_report(two_pairs, capsys):
    numbers = []
    for seed in (0, 0, 1):
        run(["right"], seed, None)
        numbers.append(capsys.readouterr().out.rsplit("\n\n", 1)[0])
    assert numbers[0] == numbers[1] != numbers[2]


def test_unknown_name_and_unwritable_file(two_pairs, tmp_path):
    with pytest.raises(InputError, match="'left' is not a registered operation; use right or wrong"):
        run(["left"], 0, None)
    with pytest.raises(InputError, match=r"missing/report\.json: cannot be written: .*missing is not a folder"):
        run(["right"], 0, tmp_path / "missing" / "report.json")


def test_the_table_is_printed_before_the_file_is_written(monkeypatch, capsys, tmp_path):
    folder = tmp_path / "vanishing"
    folder.mkdir()

    def inputs(rng):
        if folder.exists():
            folder.rmdir()
        return {"x": rng.uniform(1, 2, 5)}

    monkeypatch.setattr(registry, "all_pairs", lambda: {"right": square("right", 1.0)._replace(inputs=inputs)})
    with pytest.raises(InputError, match=r"report\.json: cannot be written"):
        run(["right"], 0, folder / "report.json")
    assert "all passed" in capsys.readouterr().out


def test_a_seed_below_zero_is_refused(two_pairs, capsys):
    with pytest.raises(InputError, match="--seed -1 is not allowed; use an integer >= 0"):
        run(["right"], -1, None)
    assert capsys.readouterr().out == ""


def test_a_pair_stream_does_not_depend_on_other_pairs():
    one = registry.pair_stream("a", 0).random(3)
    assert np.array_equal(one, registry.pair_stream("a", 0).random(3))
    assert not np.array_equal(one, registry.pair_stream("b", 0).random(3))
    assert not np.array_equal(one, registry.pair_stream("a", 1).random(3))
