"""The commands after a change: every file that they name exists, and a change reaches its tests and its pages."""

import pytest

import after


def test_a_kernel_reaches_its_room_its_gradients_and_its_twin():
    found = after.commands(["reference/endotsr/method/losses/depth.py"])
    assert "pyright reference/endotsr/method/losses/depth.py" in found
    near, far = (set(command.split()) for command in found[-2:])
    assert near >= {"tests/method/losses", "tests/test_gradcheck.py", "tests/definition/test_twins.py"}
    assert "tests/training/fitting/test_objective.py" in near
    assert "tests/training/fitting/test_packed.py" in far - near and "tests/method/losses/test_depth.py" not in far


def test_lists_that_lack_a_new_component_come_before_the_programs_but_after_the_cases_that_they_read():
    found = after.commands(["reference/endotsr/config.py", "golden/makers/depth.toml"])
    lists = f"pytest -q -n 0 {' '.join(after.LISTS)}"
    assert found.index(f"{after.WRITE} depth") < found.index(lists) < found.index(after.CONSTANTS)
    assert lists in after.commands(["golden/makers/depth.toml"]) and lists not in after.commands(["README.md"])
    for path, _, test in (name.partition("::") for name in after.LISTS):
        assert f"def {test}" in (after.ROOT / path).read_text(encoding="utf-8")


def test_a_table_of_mistakes_reaches_the_slow_test_of_each_of_them():
    (found,) = after.mistakes(["golden/makers/smoothness.toml", "golden/makers/smoothness.py", "README.md"])
    assert f"'{after.MISTAKE}[edges_ignored]'" in found.split(), "zsh takes square brackets for a pattern"
    assert "[module]" not in found
    assert found.split().count("slow") == 1 and found in after.commands(["golden/makers/smoothness.toml"])
    path, _, test = after.MISTAKE.partition("::")
    assert f"def {test}" in (after.ROOT / path).read_text(encoding="utf-8")
    assert after.mistakes(["golden/makers/smoothness.py"]) == []


def test_a_record_reaches_the_pages_that_read_it():
    assert after.makers(["docs/results/levers.json"]) == ["python docs/make.py full_size.levers"]
    assert "python docs/make.py claims" in after.makers(["docs/results/cutting_sharp_seed0.json"])
    assert "python docs/make.py book.chapters" in after.makers(["notebooks/04_deformation.py"])
    assert after.makers(["README.md"]) == []
    assert after.makers(["golden/makers/depth.toml"]) == ["python golden/make.py write depth", after.OPERATIONS]


def test_a_page_of_the_specification_reaches_the_notebooks_that_repeat_its_displays():
    displays = "tests/test_notebooks.py::test_displays_are_those_of_the_specification"
    assert displays in " ".join(after.tested(["docs/specification/06_objective.md"])).split()


def test_a_folder_takes_the_place_of_its_files():
    path = "reference/endotsr/clips/sequences/splits.py"
    words = " ".join(after.tested([path, "tests/clips/sequences/test_splits.py"])).split()
    assert "tests/clips/sequences" in words and "tests/clips/sequences/test_splits.py" not in words


def test_every_path_of_the_tables_exists():
    tests = {test for names in after.MORE.values() for test in names} | {*after.ALWAYS, *after.FORMATTED}
    starts = {*after.MAKERS, *after.MORE}
    programs = {command.split()[1] for commands in after.MAKERS.values() for command in commands}
    paths = [path.partition("::")[0] for path in tests | starts | programs]  # of records, the beginning of the names
    assert not [path for path in paths if not (after.ROOT / path).exists() and not any(after.ROOT.glob(f"{path}*"))]


@pytest.mark.parametrize(("revision", "edited", "base", "told"), [
    (None, [], "HEAD~1", True), (None, ["README.md"], "HEAD", False), ("main", [], "main", False),
])  # fmt: skip
def test_a_clean_tree_is_told(revision, edited, base, told, monkeypatch, capsys):
    """Without the line, the names of files that nobody has edited look like an error."""
    asked = []
    monkeypatch.setattr(after, "git", lambda *words: asked.append(words[-1]) or (edited if words[-1] == "HEAD" else []))
    after.changed(revision)
    assert asked[-1] == base and ("nothing is changed" in capsys.readouterr().err) == told


def test_golden_cases_that_a_run_leaves_out_are_said_to_be_left_out(monkeypatch, capsys):
    monkeypatch.setattr(after, "changed", lambda revision: ["golden/makers/depth.toml"])
    monkeypatch.setattr(after.subprocess, "run", lambda words, **_: after.subprocess.CompletedProcess(words, 1))
    monkeypatch.setattr(after, "commands", lambda paths: ["ruff check", f"{after.WRITE} depth"])
    assert after.main(["--run"]) == 1  # said before the first command, which may fail
    assert capsys.readouterr().out.splitlines() == [f"{after.WRITE} depth  (left out: run it first)", "ruff check"]


def test_an_unknown_revision_is_named_in_one_line(capsys):
    with pytest.raises(SystemExit, match="2"):
        after.main(["no-such-revision"])
    assert "no-such-revision" in capsys.readouterr().err
