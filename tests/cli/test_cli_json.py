"""`--json`: every command that prints a result has it, and the file holds the result."""

import json

import pytest
from tiny import assert_refused, written_folder

from endotsr.cli.golden import SUBCOMMANDS
from endotsr.cli.main import COMMANDS, main

NOT_ALONE = {"golden"}  # only with a second word
WITHOUT = {"sweep": "the folder it writes holds results.json"}
EVERY = [*(name for name in COMMANDS if name not in NOT_ALONE), *(f"golden {name}" for name in SUBCOMMANDS)]
PRINTING = [name for name in EVERY if name not in WITHOUT]
NUMBERS = range(len(EVERY))  # not the names: `pytest -k gradcheck` selects the gradient checks alone


@pytest.mark.parametrize("command", EVERY, ids=map(str, NUMBERS))
def test_every_command_that_prints_a_result_writes_json(command, capsys):
    assert main([*command.split(), "--help"]) == 0
    assert ("--json FILE" in capsys.readouterr().out) == (command not in WITHOUT), WITHOUT.get(command, "")


@pytest.mark.parametrize("command", PRINTING, ids=map(str, NUMBERS[: len(PRINTING)]))
def test_a_file_that_cannot_be_written_is_refused_before_the_work(command, tmp_path, finished_run, capsys):
    """Every command gets enough to begin its work; none of it is done."""
    run, out = str(finished_run), str(tmp_path / "out")
    needed = {
        "demo": ["--out", out], "train": ["simulated", "--out", out], "prepare": [run, "--out", out],
        "depth": [run], "masks": [run], "ablate": ["simulated", "--out", out],
        "check": [run], "poses": [run], "simulate": ["still", "--out", out], "inspect": [run],
        "render": [run, "--out", out], "export": [run, "--out", f"{out}.ply"],
        "evaluate": [run], "tradeoff": ["--out", out, "--budget", "10 ms"],
        "golden judge": [run], "golden run": ["--port", "true {requests} {outputs}"], "golden reference": [out],
        "golden verify": [run],
    }  # fmt: skip
    words = [*command.split(), *needed.get(command, []), "--json", str(tmp_path / "no" / "a.json")]
    assert_refused(capsys, words, "a.json: cannot be written")
    assert list(tmp_path.iterdir()) == []


def result(tmp_path, *words):
    """What the command wrote."""
    assert main([*words, "--json", str(tmp_path / "result.json")]) == 0
    return json.loads((tmp_path / "result.json").read_text())


def test_results_of_pictures_pages_and_files(finished_run, tmp_path):
    run = str(finished_run)
    found = result(tmp_path, "render", run, "--out", str(tmp_path / "pictures"), "--times", "0.1", "0.6")
    assert found["times"] == [0.1, 0.6] and found["folder"].endswith("pictures") and found["film"] is None
    page = tmp_path / "page.html"
    assert result(tmp_path, "export", run, "--out", str(page)) == {
        "page": str(page), "bytes": page.stat().st_size, "held_out": True
    }  # fmt: skip
    found = result(tmp_path, "export", run, "--out", str(tmp_path / "files"), "--count", "2")
    assert found["bytes"] == {p.name: p.stat().st_size for p in (tmp_path / "files").iterdir()}
    assert found["content"] == "gaussians" and "2 files" in found["said"]


def test_results_of_sequences(tmp_path):
    folder = written_folder(tmp_path)
    assert result(tmp_path, "check", str(folder))["findings"] is not None
    found = result(tmp_path, "prepare", str(folder), "--out", str(tmp_path / "prepared"))
    assert (found["frames"], found["width"], found["height"], found["layout"]) == (9, 48, 32, "endonerf")
    assert found["depth"] is True and found["folder"] == str(tmp_path / "prepared")
    small = ["--width", "48", "--height", "32", "--frames", "3"]
    found = result(tmp_path, "simulate", "breathing", "--out", str(tmp_path / "simulated"), *small)
    assert found["settings"]["frames"] == 3 and "breathing" in found["effects"]


@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("a.html", ["--times", "0.5"], "the format page with --times: a page contains all times"),
        ("a.html", ["--content", "mesh"], "the format page with --content: a page contains all times"),
        ("a.html", ["--keys", "1"], "--keys 1 is not allowed; use an integer from 2"),
        ("a.ply", ["--keys", "9"], "--keys has no effect without the format page"),
        ("a.ply", ["--title", "mine"], "--title has no effect without the format page"),
        ("a.ply", ["--sequence", "elsewhere"], "--sequence has no effect without the format page"),
    ],
)
def test_options_of_another_format_are_refused(name, words, said, finished_run, tmp_path, capsys):
    assert_refused(capsys, ["export", str(finished_run), "--out", str(tmp_path / name), *words], said)
    assert list(tmp_path.iterdir()) == []
