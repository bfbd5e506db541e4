"""Places where an output cannot be are refused before the work, and advice fits the command."""

import os
import sys

import pytest
from common_folder import written
from tiny import SETTINGS, assert_refused, run_line, train_words

from endotsr.training.runs import folder as runs
from endotsr.training.runs import sources
from endotsr.untrusted.writing import replace_file


def never(*_):
    raise AssertionError("the work has begun")


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is a folder of Linux")
@pytest.mark.parametrize("out", ["/proc/run", "/proc/self/fd/run"])
def test_proc_is_refused_before_the_sequence_is_read(out, capsys, monkeypatch):
    monkeypatch.setattr(sources, "load_sequence", never)
    assert_refused(capsys, train_words(out), out, "cannot be created")


@pytest.mark.parametrize("inside", ["run", "images/run", "../sequence/run"])
def test_an_output_inside_the_data_is_refused(inside, folder, capsys, monkeypatch):
    monkeypatch.setattr(sources, "load_sequence", never)
    before = sorted(folder.rglob("*"))
    assert_refused(capsys, ["train", str(folder), "--out", str(folder / inside), *SETTINGS], "is inside the sequence")
    assert sorted(folder.rglob("*")) == before


def test_a_run_that_cannot_be_written_is_not_resumed(run, capsys, monkeypatch):
    """The lock of the run was named, after the sequence was read."""
    monkeypatch.setattr("os.access", lambda path, mode: mode & os.W_OK == 0 or run not in (path, *path.parents))
    monkeypatch.setattr(sources, "load_sequence", never)
    said = f"{run}: cannot be written: no permission; use a folder that can be, such as a copy"
    assert_refused(capsys, ["train", "--out", str(run), "--resume", "--iterations", "90"], said)


@pytest.mark.parametrize(("name", "words"), [("masks", ["masks"]), ("depth", ["depth", "--flat"])])
def test_a_link_in_place_of_a_part_is_refused_before_the_work(name, words, tmp_path, capsys, monkeypatch):
    for module in ("cli.depth._made", "clips.masks.make_masks.enter_masks"):
        monkeypatch.setattr(f"endotsr.{module}", never)
    written(tmp_path / "clip")
    part = tmp_path / "clip" / name
    part.rename(tmp_path / "elsewhere")
    part.symlink_to(tmp_path / "elsewhere")
    said = (
        f"{part}: is a link, and only a folder is replaced; put a copy of its folder in its place, or delete the link"
    )
    assert_refused(capsys, [words[0], str(tmp_path / "clip"), *words[1:], "--replace"], said)


def test_pictures_inside_the_data_of_a_run_are_refused(folder, tmp_path, capsys):
    out = tmp_path / "run"
    words = ["train", str(folder), "--out", str(out), *SETTINGS, "--no-evaluate", "--iterations", "1"]
    assert run_line(capsys, *words)[0] == 0
    words = ["render", str(out), "--out", str(folder / "pictures")]
    assert_refused(capsys, words, "is inside the sequence of the run")


def test_times_without_a_time_are_refused(run, tmp_path, capsys):
    assert_refused(capsys, ["render", str(run), "--out", str(tmp_path / "out"), "--times"], "--times: missing value")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("command", "says"), [("train", "--scale"), ("render", "close other programs"), ("golden", "close other programs")]
)
def test_the_advice_on_memory_is_one_that_the_command_can_follow(command, says, capsys, monkeypatch):
    def full(words):
        raise MemoryError

    monkeypatch.setattr(f"endotsr.cli.{command}.run", full)
    code, said = run_line(capsys, command)
    assert code == 2 and "not enough memory" in said and says in said
    assert ("--scale" in said) == (command == "train")


def test_a_folder_that_appears_during_the_work_is_kept(tmp_path):
    """Two processes with one --out: the second does not remove the run of the first."""
    out = tmp_path / "run"
    with pytest.raises(ValueError, match="exists already"), runs.replacing_folder(out, replace=False) as filled:
        (filled / "second").touch()
        out.mkdir()
        (out / "first").touch()
    assert [p.name for p in out.iterdir()] == ["first"] and list(tmp_path.iterdir()) == [out]


def test_a_link_with_the_name_of_a_temporary_file_is_not_followed(tmp_path):
    (tmp_path / "victim").write_text("mine")
    (tmp_path / ".partial-metrics.json").symlink_to("victim")
    replace_file(tmp_path / "metrics.json", lambda temporary: temporary.write_text("new"))
    assert (tmp_path / "victim").read_text() == "mine" and (tmp_path / "metrics.json").read_text() == "new"


def test_a_leftover_that_is_a_link_is_removed_without_its_target(run, tmp_path):
    (tmp_path / "kept").mkdir()
    (run / ".partial-x").symlink_to(tmp_path / "kept")
    runs.RunFolder(run).remove_leftovers()
    assert (tmp_path / "kept").is_dir() and not (run / ".partial-x").is_symlink()


def test_a_message_cannot_steer_the_terminal(tmp_path, capsys):
    assert_refused(capsys, ["evaluate", str(tmp_path / "\x1b]0;title\x07")], "\\u001b]0;title\\u0007")
    assert "\x1b" not in run_line(capsys, "\x1b[31m")[1]


def test_a_processor_without_known_features_has_the_common_registers(monkeypatch):
    from endotsr.method.kernels import vectors

    def unknown():
        raise RuntimeError("no features of this processor")

    monkeypatch.setattr(vectors, "get_host_cpu_features", unknown)
    monkeypatch.setattr(vectors.numba.config, "CPU_FEATURES", None)
    assert vectors._register_bytes() == 32
