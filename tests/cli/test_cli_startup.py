"""`endotsr --help` answers at once, and a command imports what it needs and no more."""

import os
import subprocess
import sys

import pytest
from tiny import assert_refused

from endotsr import __version__
from endotsr.cli.main import COMMANDS, FORMER, main

HEAVY = ("numpy", "numba", "cv2", "scipy", "matplotlib", "skimage", "tyro")


@pytest.mark.parametrize("words", [["--help"], ["--version"], []])
def test_overview_imports_nothing_heavy(words):
    code = (
        f"import sys; from endotsr.cli.main import main; code = main({words!r}); "
        f"print([m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr); sys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stderr.strip() == "[]"


@pytest.mark.parametrize("given, used", [(None, "1"), ("3", "3")])
def test_the_process_of_a_command_has_one_thread_of_blas_unless_the_user_says_otherwise(given, used):
    code = (
        "import os, sys; sys.argv = ['endotsr', '--version']; from endotsr.cli.main import main; main(); "
        "print(os.environ['OPENBLAS_NUM_THREADS'], file=sys.stderr)"
    )
    environment = {key: value for key, value in os.environ.items() if key != "OPENBLAS_NUM_THREADS"}
    environment |= {} if given is None else {"OPENBLAS_NUM_THREADS": given}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60)
    assert done.stderr.strip() == used


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"endotsr {__version__}\n"


@pytest.mark.parametrize("name", COMMANDS, ids=[f"command {k}" for k, _ in enumerate(COMMANDS)])
def test_every_command_has_help(name, capsys):
    assert main([name, "--help"]) == 0
    assert f"endotsr {name}" in capsys.readouterr().out


@pytest.mark.parametrize("former", FORMER)
def test_a_command_that_has_moved_names_its_new_place(former, capsys):
    assert_refused(capsys, [former, "run", "--out", "x"], f"the command {former!r} has moved: `{FORMER[former]}`")
    words = FORMER[former].split()[1:]
    assert words[0] in COMMANDS or words[0] == "--completion"


@pytest.mark.parametrize(
    ("typed", "said"),
    [("trian", " did you mean train?"), ("evalute", " did you mean evaluate?"), ("exprot", " did you mean export?"),
     ("xyz", "")],
)  # fmt: skip
def test_an_unknown_command_is_answered_with_the_similar_one(typed, said, capsys):
    assert_refused(capsys, [typed], f"unknown command {typed!r};{said} use one of demo, prepare")


def test_a_positional_argument_with_a_dot_is_no_section(capsys):
    assert main(["sweep", "--help"]) == 0
    assert "SPEC:" not in capsys.readouterr().out
