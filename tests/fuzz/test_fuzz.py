"""A short, derandomised part of the fuzzing, and every input that was a finding once."""

import pytest
from campaign_of_inputs import bounded_memory, inputs, tried
from readers import CORPUS, READERS

pytestmark = pytest.mark.fuzz

COUNT = 60  # inputs of each reader


@pytest.mark.parametrize("name", READERS)
def test_mutated_files_are_read_or_refused_in_one_line(name, tmp_path, capfd):
    reader = READERS[name]
    path = tmp_path / reader.name
    assert [tried(reader, path, seed) for seed in reader.seeds()] == [""] * len(reader.seeds())
    with bounded_memory():
        assert {tried(reader, path, data) for data in inputs(reader, 7, COUNT)} == {""}
    assert capfd.readouterr().err == ""


KEPT = sorted(CORPUS.rglob("*.bin"))


@pytest.mark.parametrize("file", KEPT, ids=[f"{file.parent.name}-{file.stem}" for file in KEPT])
def test_a_finding_does_not_come_back(file, tmp_path, capfd):
    for name, reader in READERS.items():
        if name.split()[0] == file.parent.name:
            assert tried(reader, tmp_path / reader.name, file.read_bytes()) == ""
    assert capfd.readouterr().err == ""


def test_a_reader_that_raises_something_else_is_a_finding(tmp_path):
    def broken(path):
        raise IndexError("list index out of range")

    reader = READERS["run.json"]._replace(read=broken)
    assert tried(reader, tmp_path / reader.name, b"{}") == "IndexError: list index out of range"
