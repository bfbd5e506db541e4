"""Answers of a long measurement are kept one by one, and an interrupted one goes on where it stopped."""

import json

import pytest
from pages.store import kept

from endotsr.errors import InputError

KEYS = ("a", "b", "c")
RUNS = [(key,) for key in KEYS]


def interrupted(result, at):
    """Measure until the key `at`, at which the measurement is stopped."""

    def measure(key):
        if key == at:
            raise KeyboardInterrupt
        return {"name": key}

    with pytest.raises(KeyboardInterrupt):
        kept.measured(result, {"frames": 3}, RUNS, measure)


def test_an_interrupted_measurement_goes_on_where_it_stopped(tmp_path):
    result, asked = tmp_path / "result.json", []
    interrupted(result, "b")
    found = kept.measured(result, {"frames": 3}, RUNS, lambda key: asked.append(key) or {"name": key})
    assert asked == ["b", "c"] and found == {(key,): {"name": key} for key in KEYS}
    again = kept.measured(result, {"frames": 3}, RUNS, lambda key: pytest.fail("measured twice"))
    assert again == found
    kept.finished(result)
    assert list(tmp_path.iterdir()) == []


def test_a_line_that_was_cut_off_is_measured_again(tmp_path):
    result = tmp_path / "result.json"
    interrupted(result, "c")
    path = kept.part_of(result)
    path.write_text(path.read_text(encoding="utf-8")[:-5], encoding="utf-8")
    asked = []
    kept.measured(result, {"frames": 3}, RUNS, lambda key: asked.append(key) or {"name": key})
    assert asked == ["b", "c"]
    assert [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()][1:] == [
        {"key": key, "answer": {"name": key}} for key in KEYS
    ]


def test_another_measurement_and_a_damaged_file_are_refused(tmp_path):
    result = tmp_path / "result.json"
    interrupted(result, "b")
    with pytest.raises(InputError, match="belongs to another measurement"):
        kept.measured(result, {"frames": 4}, RUNS, lambda key: {})
    kept.part_of(result).write_text("{}\nno json\n", encoding="utf-8")
    with pytest.raises(InputError, match="damaged"):
        kept.measured(result, {"frames": 3}, RUNS, lambda key: {})


def test_processes_find_the_same_answers(tmp_path):
    result = tmp_path / "result.json"
    found = kept.measured(result, {"frames": 3}, RUNS, dict.fromkeys, jobs=2)
    assert found == {(key,): {key: None} for key in KEYS}
    again = kept.measured(result, {"frames": 3}, RUNS, lambda key: pytest.fail("measured twice"))
    assert again == found


def test_a_changed_source_is_another_measurement(tmp_path, monkeypatch):
    package = tmp_path / "endotsr"
    (package / "effects").mkdir(parents=True)
    (package / "effects" / "one.py").write_text("x = 1\n", encoding="utf-8")
    (package / "__init__.py").write_text("", encoding="utf-8")
    monkeypatch.setattr("endotsr.__file__", str(package / "__init__.py"))
    whole, room = kept.sources(""), kept.sources("effects")
    assert kept.sources("") == whole != room
    with pytest.raises(FileNotFoundError, match="simulator"):
        kept.sources("simulator")
    (package / "effects" / "one.py").write_text("x = 2\n", encoding="utf-8")
    assert kept.sources("") != whole and kept.sources("effects") != room
    assert kept.sources("effects", beside=("store/marks",)) != kept.sources("effects", beside=("store/kept",))


def test_answers_are_sorted_by_names_and_then_by_seed(tmp_path):
    """Whatever the order in which they were measured."""
    runs = [(scene, way, seed) for seed in (0, 1) for scene in ("s", "t") for way in ("a", "b")]
    result = tmp_path / "result.json"
    kept.measured(result, {}, reversed(runs), lambda *run: {"run": kept.key_of(run)})
    answers = kept.measured(result, {}, runs, lambda *run: pytest.fail("measured twice"))
    found = kept.nested(answers)
    assert list(found) == ["s", "t"] and list(found["s"]) == ["a", "b"]
    assert found["t"]["b"] == [{"run": "t, b, seed 0"}, {"run": "t, b, seed 1"}]


def test_a_row_replaces_the_one_of_its_key(tmp_path):
    record = tmp_path / "record.json"
    for size, value in ((2, 1.0), (1, 2.0), (2, 3.0)):
        record.write_text(json.dumps(kept.with_row(record, {"size": size, "value": value}, ("size",))))
    assert json.loads(record.read_text())["rows"] == [{"size": 1, "value": 2.0}, {"size": 2, "value": 3.0}]
